#include "inference/joint_block.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <unordered_map>

namespace sherlog {
namespace {

// Formulas whose variables inside the block have at most this many joint values (times outside variants) stay one table.
constexpr std::size_t kInlineEntries = 64;
constexpr std::size_t kLargestTable = 8192;
constexpr double kLargestWeight = 30.0, kLargestWeights = 600.0;  // nats, of one formula and of a block in all
constexpr double kTableOverhead = 40.0;                           // what handling one table costs, in entries
constexpr std::size_t kRunningSums = 64;  // a self-contained block of at most so many joint values is drawn from a list
constexpr std::size_t kFewGates = 1024;   // above a block; many more than it has table entries are not worth looking at
constexpr std::uint64_t kOrderSteps = 5000;  // for each variable: an order that takes longer to find is of no use

}  // namespace

class JointBlockBuilder {
 public:
  JointBlockBuilder(const WorldIndex& index, std::span<const VariableId> variables)
      : index_(index), network_(index.network()), variables_(variables.begin(), variables.end()) {}

  std::optional<JointBlock> build(double max_cost, const StopCondition* stop) {
    for (std::uint32_t i = 0; i < variables_.size(); ++i) {
      local_of_variable_[variables_[i].value] = i;
      cardinalities_.push_back(network_.value_count(variables_[i]));
    }
    if (!find_gates(std::max(kFewGates, static_cast<std::size_t>(max_cost)))) return std::nullopt;
    for (std::uint32_t gate : gates_) {
      if (!prepare_gate(gate)) return std::nullopt;
    }
    for (VariableId v : variables_) {
      for (std::uint32_t i = 0; i < network_.candidate_count(v); ++i) {
        if (!weigh_node(network_.first_atom(v).value + i)) return std::nullopt;
      }
    }
    for (std::uint32_t gate : gates_) {
      if (!weigh_node(index_.gate_node(gate))) return std::nullopt;
    }
    return finish(max_cost, stop);
  }

 private:
  struct Gate {
    std::vector<Literal> inside;       // inputs that depend on the block
    std::uint32_t first = 0;           // the first of the block's variables below it
    std::int32_t outside_bit = -1;     // into block_.bits_
    std::int32_t auxiliary = -1;       // the plan's variable that carries its truth, where it has one
    std::vector<std::uint32_t> scope;  // plan variables that its truth reads, where it has none; sorted
    std::vector<std::uint32_t> bits;   // outside bits likewise; sorted
    bool weighed = false;              // an at-most-one chain that enforces itself
  };
  struct Table {
    std::vector<std::uint32_t> scope;
    std::vector<double> values;
  };

  // Every gate above an atom of the block, in topological order, and which of its inputs depend on the block. Gates may have far more
  // inputs than that, so they are met from below only. False where there are too many.
  bool find_gates(std::size_t most) {
    std::vector<std::uint32_t> stack;
    std::vector<std::vector<Literal>> inside;  // by order of discovery
    for (VariableId v : variables_) {
      for (std::uint32_t i = 0; i < network_.candidate_count(v); ++i) stack.push_back(network_.first_atom(v).value + i);
    }
    while (!stack.empty()) {
      const std::uint32_t node = stack.back();
      stack.pop_back();
      const bool is_atom = node < index_.atom_count();
      for (const WorldIndex::Use& use : index_.uses(node)) {
        const auto [found, is_new] = local_gate_.try_emplace(use.gate, static_cast<std::uint32_t>(gates_.size()));
        if (is_new) {
          if (gates_.size() == most) return false;
          gates_.push_back(use.gate);
          inside.emplace_back();
          stack.push_back(index_.gate_node(use.gate));
        }
        inside[found->second].push_back(is_atom ? Literal::atom(AtomId(node), use.negated)
                                                : Literal::gate(GateId(node - index_.atom_count()), use.negated));
      }
    }
    std::ranges::sort(gates_);
    // Only what leads to something with weight or demand is worth a table. Uses come after what they use.
    std::vector<std::uint32_t> useful;
    for (std::size_t i = gates_.size(); i-- > 0;) {
      const std::uint32_t node = index_.gate_node(gates_[i]);
      const bool matters = index_.weight(node) != 0.0 || index_.demand(node) != 0 ||
                           std::ranges::any_of(index_.uses(node), [&](const WorldIndex::Use& use) {
                             return local_gate_.contains(use.gate);
                           });
      if (matters) {
        useful.push_back(gates_[i]);
      } else {
        local_gate_.erase(gates_[i]);
      }
    }
    gates_.assign(useful.rbegin(), useful.rend());
    gate_.resize(gates_.size());
    for (std::uint32_t i = 0; i < gates_.size(); ++i) {
      std::uint32_t& local = local_gate_.find(gates_[i])->second;
      gate_[i].inside = std::move(inside[local]);
      std::ranges::sort(gate_[i].inside);
      local = i;
    }
    return true;
  }

  static void merge(std::vector<std::uint32_t>& into, const std::vector<std::uint32_t>& from) {
    std::vector<std::uint32_t> both;
    std::ranges::set_union(into, from, std::back_inserter(both));
    into = std::move(both);
  }

  // What a literal inside the block reads.
  void reads(Literal literal, std::vector<std::uint32_t>& scope, std::vector<std::uint32_t>& bits) const {
    if (literal.is_atom()) {
      merge(scope, {local_of_variable_.at(network_.variable_of(literal.atom()).value)});
      return;
    }
    const Gate& gate = gate_[local_gate_.at(literal.gate().value)];
    if (gate.auxiliary >= 0) {
      merge(scope, {static_cast<std::uint32_t>(gate.auxiliary)});
    } else {
      merge(scope, gate.scope);
      merge(bits, gate.bits);
    }
  }

  std::size_t entries(const std::vector<std::uint32_t>& scope, std::size_t bits) const {
    if (bits > 12) return kLargestTable + 1;
    std::size_t product = std::size_t{1} << bits;
    for (std::uint32_t v : scope) {
      product *= cardinalities_[v];
      if (product > kLargestTable) return kLargestTable + 1;
    }
    return product;
  }

  bool prepare_gate(std::uint32_t id) {
    Gate& gate = gate_[local_gate_.at(id)];
    gate.first = 0xffffffffu;
    for (Literal input : gate.inside) gate.first = std::min(gate.first, first_variable(input));
    const bool has_outside = gate.inside.size() < network_.gate_inputs(GateId(id)).size();
    if (has_outside) {
      gate.outside_bit = static_cast<std::int32_t>(block_.bits_.size());
      const auto begin = static_cast<std::uint32_t>(block_.inside_.size());
      block_.inside_.insert(block_.inside_.end(), gate.inside.begin(), gate.inside.end());
      block_.bits_.push_back({id, begin, static_cast<std::uint32_t>(block_.inside_.size())});
      gate.bits.push_back(static_cast<std::uint32_t>(gate.outside_bit));
    }
    for (Literal input : gate.inside) {
      reads(input, gate.scope, gate.bits);
      if (entries(gate.scope, gate.bits.size()) > kInlineEntries)
        break;  // to be cut: the rest of the scope is not needed
    }
    if (entries(gate.scope, gate.bits.size()) <= kInlineEntries) return true;
    if (network_.gate_kind(GateId(id)) != GateKind::kIff) return make_chain(id, gate);
    return split_iff(gate);
  }

  using Groups = std::map<std::pair<std::uint32_t, std::uint32_t>, std::vector<Literal>>;

  // What the links of a chain test, where each tests one variable and nothing comes from outside: chains of the same tests are one.
  // Empty otherwise.
  std::vector<std::uint32_t> chain_key(const Gate& gate, const Groups& groups) {
    std::vector<std::uint32_t> key;
    if (gate.outside_bit >= 0) return key;
    assignment_.resize(cardinalities_.size());
    in_scope_.resize(cardinalities_.size(), false);
    for (const auto& group : groups) {
      const std::vector<Literal>& inputs = group.second;
      std::vector<std::uint32_t> scope, bits;
      for (Literal input : inputs) reads(input, scope, bits);
      if (scope.size() != 1 || !bits.empty() || scope[0] >= variables_.size() || cardinalities_[scope[0]] > 32)
        return {};
      std::uint32_t accepted = 0;
      for (std::uint32_t value = 0; value < cardinalities_[scope[0]]; ++value) {
        assignment_[scope[0]] = value;
        if (std::ranges::any_of(inputs, [&](Literal l) { return evaluate(l); })) accepted |= 1u << value;
      }
      key.push_back(scope[0]);
      key.push_back(accepted);
    }
    return key;
  }

  std::uint32_t first_variable(Literal literal) const {
    if (literal.is_atom()) return local_of_variable_.at(network_.variable_of(literal.atom()).value);
    return gate_[local_gate_.at(literal.gate().value)].first;
  }

  std::uint32_t new_auxiliary() {
    cardinalities_.push_back(2);
    return static_cast<std::uint32_t>(cardinalities_.size() - 1);
  }

  // An IFF of two wide sides: each side gets a variable that carries its truth.
  bool split_iff(Gate& gate) {
    for (Literal input : gate.inside) {
      if (!input.is_gate()) continue;
      Gate& below = gate_[local_gate_.at(input.gate().value)];
      if (below.auxiliary >= 0 || below.scope.size() < 2) continue;
      const auto auxiliary = new_auxiliary();
      std::vector<std::uint32_t> scope = below.scope;
      scope.push_back(auxiliary);
      const bool fits = add_table(
          scope, below.bits, [&] { return evaluate(input.gate().value) == (assignment_[auxiliary] == 1) ? 1.0 : 0.0; });
      if (!fits) return false;
      below.auxiliary = static_cast<std::int32_t>(auxiliary);
    }
    gate.scope.clear();
    gate.bits.clear();
    if (gate.outside_bit >= 0) gate.bits.push_back(static_cast<std::uint32_t>(gate.outside_bit));
    for (Literal input : gate.inside) reads(input, gate.scope, gate.bits);
    return entries(gate.scope, gate.bits.size()) <= kInlineEntries;
  }

  // p_i = p_{i-1} v (some input of group i), groups being the inputs of one variable or one gate; the outside bit is p_0. An
  // at-most-one gate allows no group to be true once p is.
  bool make_chain(std::uint32_t id, Gate& gate) {
    const bool at_most_one = network_.gate_kind(GateId(id)) == GateKind::kAtMostOne;
    if (at_most_one && index_.demand(index_.gate_node(id)) != 1) return false;
    // In the order of their first variables: chains over the same variables then run side by side.
    Groups groups;
    for (Literal input : gate.inside) {
      if (input.is_gate()) {
        groups[{first_variable(input), input.gate().value + 1}].push_back(input);
      } else {
        groups[{first_variable(input), 0u}].push_back(input);
      }
    }
    const std::vector<std::uint32_t> key = chain_key(gate, groups);
    const auto [known, is_new] =
        chain_of_key_.try_emplace(key.empty() ? std::vector<std::uint32_t>{id, 0xffffffffu} : key);
    std::vector<std::uint32_t>& chain = known->second;
    std::int32_t previous = -1;
    std::size_t link = 0;
    for (const auto& group : groups) {
      const std::vector<Literal>& inputs = group.second;
      if (is_new) chain.push_back(new_auxiliary());
      const std::uint32_t next = chain[link++];
      std::vector<std::uint32_t> scope, bits;
      for (Literal input : inputs) reads(input, scope, bits);
      if (previous >= 0) {
        scope.push_back(static_cast<std::uint32_t>(previous));
      } else if (gate.outside_bit >= 0) {
        merge(bits, {static_cast<std::uint32_t>(gate.outside_bit)});
      }
      scope.push_back(next);
      const bool fits = add_table(scope, bits, [&] {
        const bool before =
            previous >= 0 ? assignment_[static_cast<std::uint32_t>(previous)] == 1
                          : gate.outside_bit >= 0 && bit_assignment_[static_cast<std::uint32_t>(gate.outside_bit)] != 0;
        const auto true_inputs = std::ranges::count_if(inputs, [&](Literal l) { return evaluate(l); });
        if (at_most_one && (true_inputs > 1 || (before && true_inputs > 0))) return 0.0;
        return (before || true_inputs > 0) == (assignment_[next] == 1) ? 1.0 : 0.0;
      });
      if (!fits) return false;
      previous = static_cast<std::int32_t>(next);
    }
    gate.auxiliary = previous;
    gate.weighed = at_most_one;
    return true;
  }

  bool evaluate(Literal literal) const {
    if (literal.is_gate()) return evaluate(literal.gate().value) != literal.negated();
    const std::uint32_t local = local_of_variable_.at(network_.variable_of(literal.atom()).value);
    return (assignment_[local] == network_.value_of(literal.atom())) != literal.negated();
  }

  // Truth of a gate under assignment_ and bit_assignment_.
  bool evaluate(std::uint32_t id) const {
    const Gate& gate = gate_[local_gate_.at(id)];
    // A gate may have got its variable after others had read through it; their tables know nothing of that variable.
    if (gate.auxiliary >= 0 && in_scope_[static_cast<std::uint32_t>(gate.auxiliary)]) {
      return assignment_[static_cast<std::uint32_t>(gate.auxiliary)] == 1;
    }
    auto count = static_cast<std::uint32_t>(std::ranges::count_if(gate.inside, [&](Literal l) { return evaluate(l); }));
    if (gate.outside_bit >= 0) count += bit_assignment_[static_cast<std::uint32_t>(gate.outside_bit)];
    return gate_truth(network_.gate_kind(GateId(id)), count);
  }

  bool weigh_node(std::uint32_t node) {
    const double weight = index_.weight(node);
    const std::int8_t demand = index_.demand(node);
    if (weight == 0.0 && demand == 0) return true;
    const Literal literal =
        node < index_.atom_count() ? Literal::atom(AtomId(node)) : Literal::gate(GateId(node - index_.atom_count()));
    if (literal.is_gate() && gate_[local_gate_.at(literal.gate().value)].weighed) return weight == 0.0;
    std::vector<std::uint32_t> scope, bits;
    reads(literal, scope, bits);
    // Plain numbers would make a large weight a hard one.
    if ((weight_sum_ += std::abs(weight)) > kLargestWeights && std::abs(weight) > kLargestWeight) return false;
    // Scaled so that the larger of both is 1.
    const double if_true = weight > 0.0 ? 1.0 : std::exp(weight), if_false = weight > 0.0 ? std::exp(-weight) : 1.0;
    return add_table(scope, bits, [&] {
      const bool truth = evaluate(literal);
      if (demand != 0 && (demand == WorldIndex::kImpossibleDemand || truth != (demand > 0))) return 0.0;
      return truth ? if_true : if_false;
    });
  }

  // Multiplies value() into the table of that scope, for every assignment and every outcome of the outside bits.
  template <class Value>
  bool add_table(std::vector<std::uint32_t> scope, const std::vector<std::uint32_t>& bits, Value value) {
    std::ranges::sort(scope);
    const std::size_t all = entries(scope, bits.size());
    if (all > kLargestTable) return false;
    const std::size_t size = all >> bits.size();
    const auto [found, is_new] = table_of_scope_.try_emplace(scope, tables_.size());
    if (is_new) tables_.push_back({scope, std::vector<double>(size, 1.0)});
    Table& table = tables_[found->second];
    assignment_.resize(cardinalities_.size());
    in_scope_.resize(cardinalities_.size(), false);
    for (std::uint32_t v : scope) in_scope_[v] = true;
    bit_assignment_.resize(block_.bits_.size(), 0);
    const auto values_begin = static_cast<std::uint32_t>(block_.variant_values_.size());
    for (std::size_t variant = 0; variant < std::size_t{1} << bits.size(); ++variant) {
      for (std::size_t b = 0; b < bits.size(); ++b)
        bit_assignment_[bits[b]] = static_cast<std::uint8_t>(variant >> b & 1);
      for (std::uint32_t v : scope) assignment_[v] = 0;
      for (std::size_t i = 0; i < size; ++i) {
        if (bits.empty()) {
          table.values[i] *= value();
        } else {
          block_.variant_values_.push_back(value());
        }
        for (std::size_t k = scope.size(); k-- > 0;) {  // the last variable runs fastest
          if (++assignment_[scope[k]] < cardinalities_[scope[k]]) break;
          assignment_[scope[k]] = 0;
        }
      }
    }
    for (std::uint32_t v : scope) in_scope_[v] = false;
    if (!bits.empty()) {
      const auto bits_begin = static_cast<std::uint32_t>(block_.variant_bits_.size());
      block_.variant_bits_.insert(block_.variant_bits_.end(), bits.begin(), bits.end());
      block_.variants_.push_back({static_cast<std::uint32_t>(found->second), bits_begin,
                                  static_cast<std::uint32_t>(block_.variant_bits_.size()), values_begin});
    }
    return true;
  }

  std::optional<JointBlock> finish(double max_cost, const StopCondition* stop) {
    block_.variables_ = std::move(variables_);
    if (block_.bits_.empty() && list_joint_values()) return std::move(block_);
    std::vector<std::vector<std::uint32_t>> scopes;
    for (const Table& table : tables_) scopes.push_back(table.scope);
    OrderLimits limits;
    limits.max_table_log2 = std::log2(max_cost);
    limits.max_total = max_cost;
    limits.max_steps = kOrderSteps * (cardinalities_.size() + 1);
    limits.thorough = false;
    limits.stop = stop;
    block_.plan_.emplace(cardinalities_, scopes, limits);
    if (!(block_.plan_->cost() <= max_cost)) return std::nullopt;
    for (const Table& table : tables_)
      block_.base_.insert(block_.base_.end(), table.values.begin(), table.values.end());
    block_.cost_ = block_.plan_->cost() + static_cast<double>(block_.base_.size() + block_.inside_.size()) +
                   kTableOverhead * static_cast<double>(tables_.size() + cardinalities_.size());
    if (block_.self_contained()) block_.prepare_once();
    return std::move(block_);
  }

  // Multiplies all tables out where the joint values are few.
  bool list_joint_values() {
    std::size_t joint = 1;
    for (std::uint32_t k : cardinalities_) {
      joint *= k;
      if (joint > kRunningSums) return false;
    }
    if (cardinalities_.size() > block_.variables_.size()) return false;  // auxiliary variables are not drawn
    std::vector<std::uint32_t> value(cardinalities_.size(), 0);
    double sum = 0.0;
    for (std::size_t i = 0; i < joint; ++i) {
      double product = 1.0;
      for (const Table& table : tables_) {
        std::size_t entry = 0;
        for (std::uint32_t v : table.scope) entry = entry * cardinalities_[v] + value[v];
        product *= table.values[entry];
      }
      block_.running_sums_.push_back(sum += product);
      for (std::size_t k = value.size(); k-- > 0;) {
        if (++value[k] < cardinalities_[k]) break;
        value[k] = 0;
      }
    }
    // Products of very small numbers, or none: the careful way decides.
    if (!(sum > 1e-200)) {
      block_.running_sums_.clear();
      return false;
    }
    block_.cost_ = static_cast<double>(joint);
    return true;
  }

  const WorldIndex& index_;
  const GroundNetwork& network_;
  std::vector<VariableId> variables_;
  std::unordered_map<std::uint32_t, std::uint32_t> local_of_variable_;
  std::unordered_map<std::uint32_t, std::uint32_t> local_gate_;
  std::vector<std::uint32_t> gates_;
  std::vector<Gate> gate_;
  std::vector<std::uint32_t> cardinalities_;  // block variables, then auxiliaries
  std::vector<Table> tables_;
  std::map<std::vector<std::uint32_t>, std::size_t> table_of_scope_;
  std::map<std::vector<std::uint32_t>, std::vector<std::uint32_t>> chain_of_key_;
  std::vector<std::uint32_t> assignment_;
  std::vector<std::uint8_t> bit_assignment_;
  double weight_sum_ = 0.0;
  std::vector<bool> in_scope_;  // of the table that is being made, by plan variable
  JointBlock block_;
};

std::optional<JointBlock> JointBlock::make(const WorldIndex& index, std::span<const VariableId> variables,
                                           double max_cost, const StopCondition* stop) {
  return JointBlockBuilder(index, variables).build(max_cost, stop);
}

void JointBlock::prepare_once() {
  EliminationPlan::Scratch scratch;
  std::vector<std::uint8_t> no_bits;
  plan_->make_room(own_contents_, scratch);
  fill(nullptr, own_contents_, no_bits);
  possible_ = plan_->prepare(own_contents_, scratch);
  std::vector<double>().swap(base_);
}

// The World is read for outside bits only.
void JointBlock::fill(const World* world, EliminationPlan::Contents& contents, std::vector<std::uint8_t>& bits) const {
  bits.resize(bits_.size());
  for (std::size_t b = 0; b < bits_.size(); ++b) {
    std::uint32_t inside_true = 0;
    for (std::uint32_t i = bits_[b].inside_begin; i < bits_[b].inside_end; ++i)
      inside_true += world->is_true(inside_[i]) ? 1u : 0u;
    bits[b] = world->true_inputs(bits_[b].gate) > inside_true ? 1 : 0;
  }
  const double* base = base_.data();
  for (std::size_t t = 0; t < plan_->table_count(); ++t) {
    const std::span<double> table = plan_->table(contents, t);
    std::copy_n(base, table.size(), table.begin());
    base += table.size();
  }
  for (const Variants& v : variants_) {
    std::size_t variant = 0;
    for (std::uint32_t b = v.bits_begin; b < v.bits_end; ++b) {
      variant |= std::size_t{bits[variant_bits_[b]]} << (b - v.bits_begin);
    }
    const std::span<double> table = plan_->table(contents, v.table);
    const double* values = variant_values_.data() + v.values_begin + variant * table.size();
    for (std::size_t i = 0; i < table.size(); ++i) table[i] *= values[i];
  }
}

bool JointBlock::draw_from_running_sums(World& world, Rng& rng) const {
  const double u = rng.uniform() * running_sums_.back();
  std::size_t joint = static_cast<std::size_t>(std::ranges::upper_bound(running_sums_, u) - running_sums_.begin());
  // Rounding may lead beyond the end: the last joint value that is possible.
  if (joint == running_sums_.size())
    joint =
        static_cast<std::size_t>(std::ranges::lower_bound(running_sums_, running_sums_.back()) - running_sums_.begin());
  for (std::size_t i = variables_.size(); i-- > 0;) {
    const std::uint32_t values = world.index().network().value_count(variables_[i]);
    world.set(variables_[i], static_cast<std::uint32_t>(joint % values));
    joint /= values;
  }
  return true;
}

bool JointBlock::draw(World& world, Rng& rng, Workspace& workspace) const {
  if (!plan_) return draw_from_running_sums(world, rng);
  plan_->make_room(workspace.contents, workspace.scratch);
  if (workspace.drawn.size() < plan_->variable_count()) workspace.drawn.resize(plan_->variable_count());
  if (self_contained()) {
    if (!possible_) return false;
    plan_->sample(own_contents_, workspace.scratch, rng, workspace.drawn);
  } else {
    fill(&world, workspace.contents, workspace.bits);
    if (!plan_->prepare(workspace.contents, workspace.scratch)) return false;
    plan_->sample(workspace.contents, workspace.scratch, rng, workspace.drawn);
  }
  for (std::size_t i = 0; i < variables_.size(); ++i) world.set(variables_[i], workspace.drawn[i]);
  return true;
}

bool gibbs_step(World& world, VariableId v, Rng& rng, bool uniform, std::vector<double>& scratch) {
  const GroundNetwork& network = world.index().network();
  const std::uint32_t candidates = network.candidate_count(v), first = network.first_atom(v).value;
  const std::uint32_t current = world.value(v);
  if (candidates == 1) {  // boolean: the other value is one flip away
    if (!network.has_none(v)) return false;
    const double change = world.peek(first);
    if (change == World::kBreaks) return false;
    if (uniform ? rng.coin() : rng.uniform() * (1.0 + std::exp(-change)) >= 1.0) return false;
    world.flip_atom(first);
    world.note_value(v, 1 - current);
    return true;
  }
  const std::uint32_t values = network.value_count(v);
  scratch.resize(values);
  // All candidates false first: from there each value is one flip, and "none" is no flip. Where demands are broken in
  // between (exactly-one chains of other formulas), peeks are not exact and the values are tried out.
  double base = 0.0;
  if (current < candidates) base = world.flip_atom(first + current);
  const bool clean = world.broken().empty();
  double best = World::kBreaks;
  for (std::uint32_t i = 0; i < values; ++i) {
    double change = World::kBreaks;
    if (i == candidates) {
      if (clean) change = 0.0;
    } else if (i == current) {
      change = -base;
    } else if (clean) {
      change = world.peek(first + i);
    } else {
      change = world.flip_atom(first + i);
      if (!world.broken().empty()) change = World::kBreaks;
      world.flip_atom(first + i);
    }
    scratch[i] = change;
    best = std::max(best, change);
  }
  double total = 0.0;
  for (double& s : scratch) {
    s = s == World::kBreaks ? 0.0 : uniform ? 1.0 : std::exp(s - best);
    total += s;
  }
  double u = rng.uniform() * total;
  std::uint32_t chosen = current;
  for (std::uint32_t i = 0; i < values; ++i) {
    if (scratch[i] == 0.0) continue;
    chosen = i;
    if ((u -= scratch[i]) < 0.0) break;
  }
  if (chosen < candidates) world.flip_atom(first + chosen);
  world.note_value(v, chosen);
  return chosen != current;
}

}  // namespace sherlog
