#include "inference/linear_program.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <span>
#include <unordered_map>
#include <utility>

#include "inference/at_most_one.h"
#include "inference/soft_cliques.h"

namespace sherlog {
namespace {

constexpr std::uint32_t kNone = 0xffffffffu;
constexpr double kInfinity = std::numeric_limits<double>::infinity();

std::uint64_t mix(std::uint64_t x) {
  x ^= x >> 30, x *= 0xbf58476d1ce4e5b9ULL;
  x ^= x >> 27, x *= 0x94d049bb133111ebULL;
  return x ^ (x >> 31);
}

// Sets of (variable, value) of which at most one holds: blocks first, then the groups found among hard clauses.
class Groups {
 public:
  explicit Groups(const GroundNetwork& network) : network_(network) {
    std::vector<std::uint32_t> all(network.constraints().size());
    for (std::size_t i = 0; i < all.size(); ++i) all[i] = static_cast<std::uint32_t>(i);
    found_ = find_at_most_one(network, all);
    first_value_.assign(network.variable_count() + 1, 0);
    for (std::size_t v = 0; v < network.variable_count(); ++v) {
      first_value_[v + 1] = first_value_[v] + network.value_count(VariableId(v));
    }
    begin_.assign(first_value_.back() + 1, 0);
    for (const auto& group : found_.groups) {
      for (const VariableValue& x : group) ++begin_[slot(x) + 1];
    }
    for (std::size_t i = 0; i + 1 < begin_.size(); ++i) begin_[i + 1] += begin_[i];
    list_.resize(begin_.back());
    std::vector<std::uint32_t> next(begin_.begin(), begin_.end() - 1);
    for (std::uint32_t g = 0; g < found_.groups.size(); ++g) {
      for (const VariableValue& x : found_.groups[g]) list_[next[slot(x)]++] = g;
    }
  }

  const AtMostOne& found() const { return found_; }
  std::uint32_t count() const { return static_cast<std::uint32_t>(network_.variable_count() + found_.groups.size()); }

  // The value that makes an atom's literal true; false where that is not one value.
  bool value_of(Literal literal, VariableValue& x) const {
    if (!literal.is_atom()) return false;
    x.variable = network_.variable_of(literal.atom());
    x.value = network_.value_of(literal.atom());
    if (!literal.negated()) return true;
    if (network_.value_count(x.variable) != 2) return false;
    x.value = 1 - x.value;
    return true;
  }

  template <class Visit>
  void for_each(const VariableValue& x, Visit visit) const {
    if (network_.candidate_count(x.variable) > 1) visit(x.variable.value);
    const auto variables = static_cast<std::uint32_t>(network_.variable_count());
    for (std::uint32_t i = begin_[slot(x)]; i < begin_[slot(x) + 1]; ++i) visit(variables + list_[i]);
  }

 private:
  std::uint32_t slot(const VariableValue& x) const { return first_value_[x.variable.index()] + x.value; }

  const GroundNetwork& network_;
  AtMostOne found_;
  std::vector<std::uint32_t> first_value_, begin_, list_;
};

// Equal weights on R v !a for several a of one group: one weight on R v !(some a).
struct Merged {
  double weight = 0.0;
  std::vector<Literal> rest;       // R
  std::vector<Literal> violators;  // the literals a
};

class ProgramBuilder {
 public:
  explicit ProgramBuilder(const GroundNetwork& network) : network_(network), groups_(network) {}

  LinearProgram build() {
    sum_weights();
    merge();
    count_pairs();
    find_pushes();
    add_columns();
    add_blocks();
    for (std::uint32_t g = 0; g < network_.gate_count(); ++g) {
      if (gate_column_[g] >= 0) add_gate(g);
    }
    for (const Merged& m : merged_) add_merged(m);
    for (const SoftClique& c : cliques_) add_clique(c);
    add_constraints();
    program_.constant = constant_;
    return std::move(program_);
  }

 private:
  std::size_t node(Literal literal) const {
    return literal.is_gate() ? network_.atom_count() + literal.gate().index() : literal.atom().index();
  }

  void sum_weights() {
    weight_.assign(network_.atom_count() + network_.gate_count(), 0.0);
    for (const Feature& f : network_.features()) weight_[node(f.literal)] += f.weight;
    is_root_.assign(network_.gate_count(), true);
    for (std::size_t g = 0; g < network_.gate_count(); ++g) {
      for (Literal input : network_.gate_inputs(GateId(g))) {
        if (input.is_gate()) is_root_[input.gate().index()] = false;
      }
    }
    for (const Constraint& c : network_.constraints()) {
      if (c.literal.is_gate()) is_root_[c.literal.gate().index()] = false;
    }
  }

  // --- merging

  struct Member {
    std::uint32_t gate, input;  // R v !a without its literal number `input`
  };
  struct Bucket {
    std::uint32_t group = 0;
    std::vector<Member> members;
  };

  bool same_rest(const Member& a, const Member& b) const {
    const auto x = network_.gate_inputs(GateId(a.gate)), y = network_.gate_inputs(GateId(b.gate));
    if (x.size() != y.size()) return false;
    for (std::size_t i = 0, j = 0; i < x.size(); ++i, ++j) {
      if (i == a.input && ++i >= x.size()) return true;
      if (j == b.input) ++j;
      if (j >= y.size() || x[i] != y[j]) return false;
    }
    return true;
  }

  void merge() {
    std::unordered_map<std::uint64_t, std::uint32_t> place;
    std::vector<Bucket> buckets;
    for (std::uint32_t g = 0; g < network_.gate_count(); ++g) {
      const double weight = weight_[network_.atom_count() + g];
      if (weight == 0.0 || !is_root_[g] || network_.gate_kind(GateId(g)) != GateKind::kOr) continue;
      const auto inputs = network_.gate_inputs(GateId(g));
      std::uint64_t hash = std::hash<double>()(weight);
      for (Literal l : inputs) hash += mix(l.code());
      for (std::uint32_t i = 0; i < inputs.size(); ++i) {
        VariableValue violator;
        if (!groups_.value_of(~inputs[i], violator)) continue;
        groups_.for_each(violator, [&](std::uint32_t group) {
          const std::uint64_t key = mix(hash - mix(inputs[i].code()) + 0x9e3779b97f4a7c15ULL * (group + 1));
          const auto [entry, is_new] = place.try_emplace(key, static_cast<std::uint32_t>(buckets.size()));
          if (is_new) buckets.push_back({group, {}});
          Bucket& bucket = buckets[entry->second];
          const Member member{g, i};
          // Buckets of equal keys but different content lose the later ones: less is merged, nothing wrong.
          if (!is_new && (bucket.group != group || !same_rest(bucket.members[0], member) ||
                          weight_[network_.atom_count() + bucket.members[0].gate] != weight)) {
            return;
          }
          bucket.members.push_back(member);
        });
      }
    }
    take_largest(buckets);
  }

  void take_largest(std::vector<Bucket>& buckets) {
    std::erase_if(buckets, [](const Bucket& b) { return b.members.size() < 2; });
    std::stable_sort(buckets.begin(), buckets.end(),
                     [](const Bucket& a, const Bucket& b) { return a.members.size() > b.members.size(); });
    for (Bucket& bucket : buckets) {
      std::erase_if(bucket.members, [&](const Member& m) { return weight_[network_.atom_count() + m.gate] == 0.0; });
      if (bucket.members.size() < 2) continue;
      Merged merged;
      const Member& first = bucket.members[0];
      merged.weight = weight_[network_.atom_count() + first.gate];
      const auto inputs = network_.gate_inputs(GateId(first.gate));
      for (std::uint32_t i = 0; i < inputs.size(); ++i) {
        if (i != first.input) merged.rest.push_back(inputs[i]);
      }
      for (const Member& m : bucket.members) {
        merged.violators.push_back(~network_.gate_inputs(GateId(m.gate))[m.input]);
        weight_[network_.atom_count() + m.gate] = 0.0;
        constant_ += merged.weight;  // all hold, but for the one whose a is true while R is false
      }
      merged_.push_back(std::move(merged));
    }
  }

  // --- counting

  // Clauses of two literals: the literals' denials must not come together.
  void count_pairs() {
    std::vector<SoftEdge> edges;
    std::vector<std::uint32_t> gate_of_edge;
    std::unordered_map<std::uint32_t, std::uint32_t> vertex_of;
    const auto vertex = [&](Literal denied) {
      const auto [entry, is_new] = vertex_of.try_emplace(denied.code(), static_cast<std::uint32_t>(vertices_.size()));
      if (is_new) vertices_.push_back(denied);
      return entry->second;
    };
    for (std::uint32_t g = 0; g < network_.gate_count(); ++g) {
      const double weight = weight_[network_.atom_count() + g];
      const auto inputs = network_.gate_inputs(GateId(g));
      if (weight <= 0.0 || !is_root_[g] || inputs.size() != 2 || network_.gate_kind(GateId(g)) != GateKind::kOr)
        continue;
      if (!inputs[0].is_atom() || !inputs[1].is_atom()) continue;
      const std::uint32_t a = vertex(~inputs[0]), b = vertex(~inputs[1]);
      edges.push_back({a, b, weight});
      gate_of_edge.push_back(g);
    }
    cliques_ = find_soft_cliques(static_cast<std::uint32_t>(vertices_.size()), edges);
    for (std::size_t e = 0; e < edges.size(); ++e) weight_[network_.atom_count() + gate_of_edge[e]] = edges[e].weight;
    for (const SoftClique& c : cliques_) {
      const auto k = static_cast<double>(c.vertices.size());
      constant_ += c.weight * k * (k - 1.0) / 2.0;
    }
  }

  // --- columns

  void push(Literal literal, bool up, bool down) {
    if (!literal.is_gate()) return;
    if (literal.negated()) std::swap(up, down);
    std::uint8_t& p = pushes_[literal.gate().index()];
    p = static_cast<std::uint8_t>(p | (up ? 1u : 0u) | (down ? 2u : 0u));
  }

  void push_inputs(std::uint32_t gate, bool up, bool down) {
    const bool both = network_.gate_kind(GateId(gate)) == GateKind::kIff;
    for (Literal input : network_.gate_inputs(GateId(gate))) push(input, up || both, down || both);
  }

  // Which gates need a column (any bit), and in which directions it has to be right.
  void find_pushes() {
    pushes_.assign(network_.gate_count(), 0);
    for (const Merged& m : merged_) {
      for (Literal l : m.rest) push(l, m.weight > 0.0, m.weight < 0.0);
    }
    for (const Constraint& c : network_.constraints()) {
      if (c.literal.is_gate()) push_inputs(c.literal.gate().value, !c.literal.negated(), c.literal.negated());
    }
    for (std::size_t g = network_.gate_count(); g-- > 0;) {
      const double weight = weight_[network_.atom_count() + g];
      if (weight != 0.0) push(Literal::gate(GateId(g)), weight > 0.0, weight < 0.0);
      if (pushes_[g] != 0) push_inputs(static_cast<std::uint32_t>(g), (pushes_[g] & 1) != 0, (pushes_[g] & 2) != 0);
    }
  }

  void add_columns() {
    for (std::size_t a = 0; a < network_.atom_count(); ++a) {
      program_.add_column(-weight_[a]);
      program_.is_whole.back() = true;
    }
    gate_column_.assign(network_.gate_count(), -1);
    for (std::size_t g = 0; g < network_.gate_count(); ++g) {
      if (pushes_[g] == 0) continue;
      gate_column_[g] = program_.add_column(-weight_[network_.atom_count() + g]);
      if (network_.gate_inputs(GateId(g)).size() > 2) program_.is_whole.back() = true;
    }
  }

  // --- rows

  void add(int column, double factor) { row_.push_back({column, factor}); }
  void add(Literal literal, double factor) {
    const int column =
        literal.is_gate() ? gate_column_[literal.gate().index()] : static_cast<int>(literal.atom().value);
    if (literal.negated()) row_constant_ += factor;
    add(column, literal.negated() ? -factor : factor);
  }
  void add(const VariableValue& x, double factor) {
    const std::uint32_t first = network_.first_atom(x.variable).value, n = network_.candidate_count(x.variable);
    if (x.value < n) return add(static_cast<int>(first + x.value), factor);
    row_constant_ += factor;
    for (std::uint32_t i = 0; i < n; ++i) add(static_cast<int>(first + i), -factor);
  }
  // Ends the row: lower <= what was added <= upper.
  void finish(double lower, double upper) {
    std::sort(row_.begin(), row_.end());
    const std::size_t begin = program_.index.size();
    for (const auto& [column, factor] : row_) {
      if (program_.index.size() > begin && program_.index.back() == column) {
        program_.value.back() += factor;
      } else {
        program_.index.push_back(column);
        program_.value.push_back(factor);
      }
    }
    program_.row_start.push_back(static_cast<int>(program_.index.size()));
    program_.row_lower.push_back(std::isfinite(lower) ? lower - row_constant_ : -kUnlimited);
    program_.row_upper.push_back(std::isfinite(upper) ? upper - row_constant_ : kUnlimited);
    row_.clear();
    row_constant_ = 0.0;
  }

  void add_blocks() {
    for (std::size_t v = 0; v < network_.variable_count(); ++v) {
      const VariableId variable(v);
      const std::uint32_t n = network_.candidate_count(variable);
      const bool none = network_.has_none(variable);
      if (n == 1 && none) continue;
      if (none && inside_a_group(variable)) continue;
      for (std::uint32_t i = 0; i < n; ++i) add(VariableValue{variable, i}, 1.0);
      finish(none ? -kInfinity : 1.0, 1.0);
    }
    for (const auto& group : groups_.found().groups) {
      for (const VariableValue& x : group) add(x, 1.0);
      finish(-kInfinity, 1.0);
    }
  }

  bool inside_a_group(VariableId variable) {
    const std::uint32_t n = network_.candidate_count(variable);
    count_.resize(groups_.count(), 0);
    bool inside = false;
    const auto for_all = [&](auto visit) {
      for (std::uint32_t i = 0; i < n; ++i) groups_.for_each({variable, i}, visit);
    };
    for_all([&](std::uint32_t g) { inside = ++count_[g] == n && g >= network_.variable_count() ? true : inside; });
    for_all([&](std::uint32_t g) { count_[g] = 0; });
    return inside;
  }

  // `top` is at least each input; at least the sum of those of one group.
  template <class Top>
  void at_least_inputs(std::span<const Literal> inputs, Top add_top) {
    count_.resize(groups_.count(), 0);
    std::vector<std::vector<std::uint32_t>> groups_of(inputs.size());
    for (std::size_t i = 0; i < inputs.size(); ++i) {
      VariableValue x;
      if (!groups_.value_of(inputs[i], x)) continue;
      groups_.for_each(x, [&](std::uint32_t g) { groups_of[i].push_back(g), ++count_[g]; });
    }
    std::vector<bool> done(inputs.size(), false);
    for (std::size_t i = 0; i < inputs.size(); ++i) {
      if (done[i]) continue;
      std::uint32_t best = kNone;
      for (std::uint32_t g : groups_of[i]) {
        if (count_[g] > 1 && (best == kNone || count_[g] > count_[best])) best = g;
      }
      for (std::size_t k = i; k < inputs.size(); ++k) {
        const bool in = k == i || (!done[k] && best != kNone && std::ranges::count(groups_of[k], best) > 0);
        if (!in) continue;
        done[k] = true;
        add(inputs[k], -1.0);
        for (std::uint32_t g : groups_of[k]) --count_[g];
      }
      add_top();
      finish(0.0, kInfinity);
    }
  }

  void add_gate(std::uint32_t g) {
    const auto inputs = network_.gate_inputs(GateId(g));
    const int y = gate_column_[g];
    const bool up = (pushes_[g] & 1) != 0, down = (pushes_[g] & 2) != 0;
    if (network_.gate_kind(GateId(g)) == GateKind::kOr) {
      if (up) {
        for (Literal l : inputs) add(l, 1.0);
        add(y, -1.0);
        finish(0.0, kInfinity);
      }
      if (down) at_least_inputs(inputs, [&] { add(y, 1.0); });
      return;
    }
    for (const double sign : {1.0, -1.0}) {
      if (up) {  // y <= 1 - a + b and y <= 1 + a - b
        add(y, 1.0), add(inputs[0], sign), add(inputs[1], -sign);
        finish(-kInfinity, 1.0);
      }
      if (down) {  // y >= a + b - 1 and y >= 1 - a - b
        add(y, 1.0), add(inputs[0], -sign), add(inputs[1], -sign);
        finish(-sign, kInfinity);
      }
    }
  }

  // z: R is false and some a is true; it costs the weight.
  void add_merged(const Merged& m) {
    const int z = program_.add_column(m.weight);
    if (m.weight > 0.0) {
      add(z, 1.0);
      for (Literal l : m.rest) add(l, 1.0);
      for (Literal a : m.violators) add(a, -1.0);
      finish(0.0, kInfinity);
      return;
    }
    add(z, -1.0);
    for (Literal a : m.violators) add(a, 1.0);
    finish(0.0, kInfinity);
    for (Literal l : m.rest) {
      add(z, 1.0), add(l, 1.0);
      finish(-kInfinity, 1.0);
    }
  }

  // The number of true members is a sum of steps; the second costs the weight, the third twice the weight, and so on.
  void add_clique(const SoftClique& c) {
    for (std::size_t t = 0; t < c.vertices.size(); ++t)
      add(program_.add_column(c.weight * static_cast<double>(t)), 1.0);
    for (std::uint32_t v : c.vertices) add(vertices_[v], -1.0);
    finish(0.0, kInfinity);
  }

  void add_constraints() {
    const auto& covered = groups_.found().covered;
    for (std::uint32_t k = 0; k < network_.constraints().size(); ++k) {
      if (std::binary_search(covered.begin(), covered.end(), k)) continue;
      const Literal literal = network_.constraints()[k].literal;
      if (literal.is_atom()) {
        add(literal, 1.0);
        finish(1.0, 1.0);
        continue;
      }
      const auto inputs = network_.gate_inputs(literal.gate());
      if (network_.gate_kind(literal.gate()) == GateKind::kOr) {
        if (literal.negated()) {
          for (Literal l : inputs) add(l, 1.0), finish(0.0, 0.0);
        } else {
          for (Literal l : inputs) add(l, 1.0);
          finish(1.0, kInfinity);
        }
      } else {
        add(inputs[0], 1.0), add(inputs[1], literal.negated() ? 1.0 : -1.0);
        finish(literal.negated() ? 1.0 : 0.0, literal.negated() ? 1.0 : 0.0);
      }
    }
  }

  const GroundNetwork& network_;
  Groups groups_;
  LinearProgram program_;
  double constant_ = 0.0;       // of the score
  std::vector<double> weight_;  // by node, merged ones taken out
  std::vector<bool> is_root_;   // gates that feed no gate and are not demanded
  std::vector<Merged> merged_;
  std::vector<SoftClique> cliques_;
  std::vector<Literal> vertices_;     // of the cliques
  std::vector<std::uint8_t> pushes_;  // by gate; 1: up, 2: down
  std::vector<int> gate_column_;
  std::vector<std::pair<int, double>> row_;
  double row_constant_ = 0.0;
  std::vector<std::uint32_t> count_;
};

}  // namespace

LinearProgram state_linear_program(const GroundNetwork& network) { return ProgramBuilder(network).build(); }

}  // namespace sherlog
