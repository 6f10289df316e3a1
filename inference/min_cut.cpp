#include "inference/min_cut.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace sherlog {
namespace {

constexpr std::uint32_t kNone = 0xffffffffu;
constexpr std::uint64_t kAugmentationsPerCheck = 4096;

}  // namespace

// --- maximum flow ----------------------------------------------------------------------------------------------------

void FlowGraph::add_arc(std::uint32_t a, std::uint32_t b, std::int64_t forward, std::int64_t backward) {
  if (forward > 0 || backward > 0) pending_.push_back({a, b, forward, backward});
}

void FlowGraph::index_arcs() {
  arc_begin_.assign(nodes_ + 1, 0);
  for (const Pending& p : pending_) ++arc_begin_[p.a + 1], ++arc_begin_[p.b + 1];
  for (std::uint32_t i = 0; i < nodes_; ++i) arc_begin_[i + 1] += arc_begin_[i];
  arcs_.resize(arc_begin_.back());
  std::vector<std::uint32_t> next(arc_begin_.begin(), arc_begin_.end() - 1);
  for (const Pending& p : pending_) {
    const std::uint32_t there = next[p.a]++, back = next[p.b]++;
    arcs_[there] = {p.b, back, p.forward};
    arcs_[back] = {p.a, there, p.backward};
  }
  pending_.clear();
}

bool FlowGraph::find_levels(std::uint32_t source, std::uint32_t sink) {
  level_.assign(nodes_, -1);
  std::vector<std::uint32_t> queue{source};
  level_[source] = 0;
  for (std::size_t i = 0; i < queue.size(); ++i) {
    const std::uint32_t node = queue[i];
    for (std::uint32_t k = arc_begin_[node]; k < arc_begin_[node + 1]; ++k) {
      if (arcs_[k].residual == 0 || level_[arcs_[k].head] >= 0) continue;
      level_[arcs_[k].head] = level_[node] + 1;
      queue.push_back(arcs_[k].head);
    }
  }
  return level_[sink] >= 0;
}

// Depth first along rising levels, with the path as an explicit stack of arcs.
bool FlowGraph::block_flow(std::uint32_t source, std::uint32_t sink, const StopCondition& stop) {
  next_arc_.assign(arc_begin_.begin(), arc_begin_.end() - 1);
  std::vector<std::uint32_t> path;
  std::uint32_t node = source;
  for (std::uint64_t augmentations = 1;;) {
    if (node == sink) {
      std::int64_t amount = std::numeric_limits<std::int64_t>::max();
      for (std::uint32_t k : path) amount = std::min(amount, arcs_[k].residual);
      flow_ += amount;
      std::size_t keep = path.size();
      for (std::size_t i = path.size(); i-- > 0;) {
        Arc& arc = arcs_[path[i]];
        arc.residual -= amount;
        arcs_[arc.reverse].residual += amount;
        if (arc.residual == 0) keep = i;
      }
      node = arcs_[arcs_[path[keep]].reverse].head;
      path.resize(keep);
      if (++augmentations % kAugmentationsPerCheck == 0 && stop.reached()) return false;
      continue;
    }
    std::uint32_t& k = next_arc_[node];
    while (k < arc_begin_[node + 1] && (arcs_[k].residual == 0 || level_[arcs_[k].head] != level_[node] + 1)) ++k;
    if (k < arc_begin_[node + 1]) {
      path.push_back(k);
      node = arcs_[k].head;
    } else if (node == source) {
      return true;
    } else {
      node = arcs_[arcs_[path.back()].reverse].head;
      path.pop_back();
      ++next_arc_[node];
    }
  }
}

bool FlowGraph::solve(std::uint32_t source, std::uint32_t sink, const StopCondition& stop) {
  index_arcs();
  while (find_levels(source, sink)) {
    if (stop.reached() || !block_flow(source, sink, stop)) return false;
  }
  return true;
}

// --- the quadratic function ------------------------------------------------------------------------------------------

namespace {

// A function of 0/1 variables to be minimised: constant + sum a_i x_i + sum b_ij x_i x_j, in whole numbers.
struct Quadratic {
  struct Product {
    std::uint32_t i, j;  // i < j
    std::int64_t coefficient;
  };
  std::vector<std::int64_t> linear;
  std::vector<Product> products;
  std::int64_t constant = 0;

  void add_product(std::uint32_t i, std::uint32_t j, std::int64_t c) {
    if (c != 0) products.push_back({std::min(i, j), std::max(i, j), c});
  }
  void merge_products() {
    std::sort(products.begin(), products.end(),
              [](const Product& a, const Product& b) { return a.i != b.i ? a.i < b.i : a.j < b.j; });
    std::size_t n = 0;
    for (const Product& p : products) {
      if (n > 0 && products[n - 1].i == p.i && products[n - 1].j == p.j) {
        products[n - 1].coefficient += p.coefficient;
      } else {
        products[n++] = p;
      }
    }
    products.resize(n);
    std::erase_if(products, [](const Product& p) { return p.coefficient == 0; });
  }
};

// What a node of the network is as a boolean function.
struct Function {
  enum class Kind : std::uint8_t { kSmall, kPunishedOr, kOther };
  Kind kind = Kind::kSmall;
  std::uint32_t i = kNone, j = kNone;  // kSmall: its variables, j may be missing; kPunishedOr: i is its own variable
  std::uint8_t table = 0;              // kSmall: bit (2 x_i + x_j) is its truth
};

class QuadraticBuilder {
 public:
  explicit QuadraticBuilder(const GroundNetwork& network) : network_(network) {}

  // False where the network is not quadratic.
  bool build() {
    if (!number_variables()) return false;
    sum_weights();
    find_upward_pushes();
    functions_.resize(network_.gate_count());
    for (std::size_t g = 0; g < network_.gate_count(); ++g) functions_[g] = function_of(GateId(g));
    set_scale();
    for (std::size_t a = 0; a < network_.atom_count(); ++a) {
      if (!add_node(atom_function(AtomId(a)), weight_[a], demand_[a])) return false;
    }
    for (std::size_t g = 0; g < network_.gate_count(); ++g) {
      const std::size_t node = network_.atom_count() + g;
      if (!add_node(functions_[g], weight_[node], demand_[node])) return false;
    }
    tie_punished();
    q_.merge_products();
    return true;
  }

  const Quadratic& function() const { return q_; }
  double to_score(double energy) const { return -energy / scale_; }
  std::int64_t hard() const { return hard_; }

 private:
  // x_v: value 0 of variable v. Blocks with three and more values are not quadratic.
  bool number_variables() {
    for (std::size_t v = 0; v < network_.variable_count(); ++v) {
      if (network_.value_count(VariableId(v)) > 2) return false;
    }
    q_.linear.assign(network_.variable_count(), 0);
    return true;
  }

  std::size_t node(Literal literal) const {
    return literal.is_gate() ? network_.atom_count() + literal.gate().index() : literal.atom().index();
  }

  void sum_weights() {
    weight_.assign(network_.atom_count() + network_.gate_count(), 0.0);
    demand_.assign(weight_.size(), 0);
    for (const Feature& f : network_.features()) weight_[node(f.literal)] += f.weight;
    for (const Constraint& c : network_.constraints()) {
      std::uint8_t& demand = demand_[node(c.literal)];
      demand = static_cast<std::uint8_t>(demand | (c.literal.negated() ? 2u : 1u));
    }
  }

  // Whether anything wants the gate to be true.
  void find_upward_pushes() {
    const std::size_t atoms = network_.atom_count();
    std::vector<std::uint8_t> up(network_.gate_count(), 0), down(network_.gate_count(), 0);
    for (std::size_t g = network_.gate_count(); g-- > 0;) {
      if (weight_[atoms + g] > 0.0 || (demand_[atoms + g] & 1) != 0) up[g] = 1;
      if (weight_[atoms + g] < 0.0 || (demand_[atoms + g] & 2) != 0) down[g] = 1;
      const bool both = network_.gate_kind(GateId(g)) == GateKind::kIff;
      for (Literal input : network_.gate_inputs(GateId(g))) {
        if (!input.is_gate()) continue;
        const std::size_t below = input.gate().index();
        if (both ? (up[g] | down[g]) != 0 : (input.negated() ? down[g] : up[g]) != 0) up[below] = 1;
        if (both ? (up[g] | down[g]) != 0 : (input.negated() ? up[g] : down[g]) != 0) down[below] = 1;
      }
    }
    pushed_up_ = std::move(up);
  }

  Function atom_function(AtomId a) const {
    Function f;
    f.i = network_.variable_of(a).value;
    if (network_.value_count(VariableId(f.i)) == 1) {
      f.table = 0xf;
    } else {
      f.table = network_.value_of(a) == 0 ? 0b1100 : 0b0011;
    }
    return f;
  }
  Function function_of(Literal literal) const {
    Function f = literal.is_gate() ? functions_[literal.gate().index()] : atom_function(literal.atom());
    if (literal.negated()) f.table = static_cast<std::uint8_t>(~f.table & 0xf);
    return f;
  }

  // The function's table over (i, j), which hold its variables.
  static std::uint8_t table_over(const Function& f, std::uint32_t i, std::uint32_t j) {
    std::uint8_t table = 0;
    for (std::uint8_t row = 0; row < 4; ++row) {
      const auto value = [&](std::uint32_t v) -> unsigned {
        if (v == i) return row >> 1;
        return v == j ? row & 1u : 0u;
      };
      if ((f.table >> (2 * value(f.i) + value(f.j)) & 1) != 0) table = static_cast<std::uint8_t>(table | 1u << row);
    }
    return table;
  }

  Function function_of(GateId g) {
    Function result;
    bool small = true, punishable = pushed_up_[g.index()] == 0 && network_.gate_kind(g) == GateKind::kOr;
    const auto mention = [&](std::uint32_t v) {
      if (v == kNone || v == result.i || v == result.j) return;
      if (result.i == kNone) {
        result.i = v;
      } else if (result.j == kNone) {
        result.j = v;
      } else {
        small = false;
      }
    };
    for (Literal input : network_.gate_inputs(g)) {
      const Function f = function_of(input);
      small = small && f.kind == Function::Kind::kSmall;
      if (small) mention(f.i), mention(f.j);
      // At least a small function of one variable, or another such OR.
      const bool single = f.kind == Function::Kind::kSmall && f.j == kNone;
      punishable = punishable && (single || (f.kind == Function::Kind::kPunishedOr && !input.negated()));
    }
    if (small) {
      const bool is_or = network_.gate_kind(g) == GateKind::kOr;
      result.table = is_or ? 0 : 0xf;
      for (Literal input : network_.gate_inputs(g)) {
        const std::uint8_t table = table_over(function_of(input), result.i, result.j);
        result.table = static_cast<std::uint8_t>(is_or ? result.table | table : ~(result.table ^ table) & 0xf);
      }
      return result;
    }
    result = Function();
    result.kind = punishable ? Function::Kind::kPunishedOr : Function::Kind::kOther;
    if (punishable) {
      result.i = static_cast<std::uint32_t>(q_.linear.size());
      q_.linear.push_back(0);
      punished_.push_back(g);
    }
    return result;
  }

  // All weights together are at most 2^bits; a hard formula costs more; and sums of hard costs stay below 2^62.
  void set_scale() {
    double total = 0.0;
    for (double w : weight_) total += std::abs(w);
    std::size_t inputs = 0;
    for (GateId g : punished_) inputs += network_.gate_inputs(g).size();
    const double many = static_cast<double>(network_.constraints().size() + inputs + weight_.size() + 2);
    const int bits = std::min(44, 59 - static_cast<int>(std::ceil(std::log2(many))));
    scale_ = total > 0.0 ? std::exp2(bits) / total : 1.0;
    // Rounding adds at most one half for each node.
    hard_ = (std::int64_t{1} << bits) + static_cast<std::int64_t>(weight_.size()) + 1;
  }

  void add_table(const Function& f, bool of_truth, std::int64_t cost) {
    const auto at = [&](unsigned row) { return ((f.table >> row & 1) != 0) == of_truth ? cost : 0; };
    q_.constant += at(0);
    q_.linear[f.i] += at(2) - at(0);
    if (f.j == kNone) return;
    q_.linear[f.j] += at(1) - at(0);
    q_.add_product(f.i, f.j, at(3) - at(2) - at(1) + at(0));
  }

  bool add_node(const Function& f, double weight, std::uint8_t demand) {
    if (weight == 0.0 && demand == 0) return true;
    if (f.kind == Function::Kind::kOther) return false;
    const auto cost = static_cast<std::int64_t>(std::llround(-weight * scale_));
    if (f.kind == Function::Kind::kPunishedOr) {
      q_.linear[f.i] += cost + ((demand & 2) != 0 ? hard_ : 0);
      return true;
    }
    add_table(f, true, cost);
    if ((demand & 1) != 0) add_table(f, false, hard_);
    if ((demand & 2) != 0) add_table(f, true, hard_);
    return true;
  }

  // y >= each input: hard_ where the input is true and y is false, that is hard_ * (x - x y).
  void tie_punished() {
    for (GateId g : punished_) {
      const std::uint32_t y = functions_[g.index()].i;
      for (Literal input : network_.gate_inputs(g)) {
        const Function f = function_of(input);
        const bool plain = f.kind == Function::Kind::kPunishedOr || f.table == 0b1100;
        if (plain) {
          q_.linear[f.i] += hard_;
          q_.add_product(f.i, y, -hard_);
        } else if (f.table == 0b0011) {  // (1 - x)(1 - y)
          q_.constant += hard_;
          q_.linear[f.i] -= hard_;
          q_.linear[y] -= hard_;
          q_.add_product(f.i, y, hard_);
        } else if (f.table != 0) {  // always true
          q_.constant += hard_;
          q_.linear[y] -= hard_;
        }
      }
    }
  }

  const GroundNetwork& network_;
  std::vector<double> weight_;
  std::vector<std::uint8_t> demand_;  // by node; 1: true, 2: false
  std::vector<std::uint8_t> pushed_up_;
  std::vector<Function> functions_;
  std::vector<GateId> punished_;
  Quadratic q_;
  double scale_ = 1.0;
  std::int64_t hard_ = 1;
};

// Which variables to turn round so that no product is positive: a 2-colouring with "equal" for negative products and
// "different" for positive ones. Empty where there is none.
std::vector<bool> find_turns(const Quadratic& q) {
  const std::size_t n = q.linear.size();
  std::vector<std::uint32_t> begin(n + 1, 0);
  for (const auto& p : q.products) ++begin[p.i + 1], ++begin[p.j + 1];
  for (std::size_t i = 0; i < n; ++i) begin[i + 1] += begin[i];
  std::vector<std::uint32_t> list(begin.back()), next(begin.begin(), begin.end() - 1);
  for (std::uint32_t k = 0; k < q.products.size(); ++k) {
    list[next[q.products[k].i]++] = k;
    list[next[q.products[k].j]++] = k;
  }
  std::vector<std::int8_t> turned(n, -1);
  std::vector<std::uint32_t> open;
  for (std::uint32_t root = 0; root < n; ++root) {
    if (turned[root] >= 0) continue;
    turned[root] = 0;
    open.push_back(root);
    while (!open.empty()) {
      const std::uint32_t i = open.back();
      open.pop_back();
      for (std::uint32_t e = begin[i]; e < begin[i + 1]; ++e) {
        const auto& p = q.products[list[e]];
        const std::uint32_t j = p.i == i ? p.j : p.i;
        const auto wanted = static_cast<std::int8_t>(p.coefficient > 0 ? 1 - turned[i] : turned[i]);
        if (turned[j] < 0) {
          turned[j] = wanted;
          open.push_back(j);
        } else if (turned[j] != wanted) {
          return {};
        }
      }
    }
  }
  std::vector<bool> result(n);
  for (std::size_t i = 0; i < n; ++i) result[i] = turned[i] == 1;
  return result;
}

// Source side: x = 0. Cost u x is an arc source -> i, cost u (1 - x) is an arc i -> sink, cost c x_i (1 - x_j) is an arc j -> i.
struct CutBuilder {
  FlowGraph& graph;
  std::uint32_t source, sink;
  void linear(std::uint32_t i, std::int64_t u) {
    if (u > 0) {
      graph.add_arc(source, i, u);
    } else {
      graph.add_arc(i, sink, -u);
    }
  }
};

struct CutAnswer {
  bool finished = false;
  std::vector<std::int8_t> x;  // -1: undecided
  double energy = 0.0;         // lower bound on the function; its minimum where all are decided
};

CutAnswer submodular_cut(Quadratic q, const std::vector<bool>& turned, const StopCondition& stop) {
  const auto n = static_cast<std::uint32_t>(q.linear.size());
  // x = 1 - x' for turned variables: a x = a - a x'; b x y = b (1 - x') y = b y - b x' y, and so on.
  std::vector<std::int64_t> linear(n, 0);
  for (std::uint32_t i = 0; i < n; ++i) {
    if (turned[i]) q.constant += q.linear[i];
    linear[i] = turned[i] ? -q.linear[i] : q.linear[i];
  }
  FlowGraph graph(n + 2);
  CutBuilder cut{graph, n, n + 1};
  for (const auto& p : q.products) {
    std::int64_t c = p.coefficient;
    if (turned[p.i] && turned[p.j]) {
      q.constant += c, linear[p.i] -= c, linear[p.j] -= c;
    } else if (turned[p.i]) {
      linear[p.j] += c, c = -c;
    } else if (turned[p.j]) {
      linear[p.i] += c, c = -c;
    }
    // c <= 0 now: c x y = c x - c x (1 - y)
    linear[p.i] += c;
    graph.add_arc(p.j, p.i, -c);
  }
  std::int64_t constant = q.constant;
  for (std::uint32_t i = 0; i < n; ++i) {
    if (linear[i] < 0) constant += linear[i];
    cut.linear(i, linear[i]);
  }
  CutAnswer answer;
  answer.finished = graph.solve(n, n + 1, stop);
  if (!answer.finished) return answer;
  answer.energy = static_cast<double>(constant + graph.flow());
  answer.x.resize(n);
  for (std::uint32_t i = 0; i < n; ++i) answer.x[i] = (!graph.reachable(i)) != turned[i] ? 1 : 0;
  return answer;
}

// Node i stands for x_i, node n + i for 1 - x_i; every term is there twice, once in each spelling.
CutAnswer roof_dual(const Quadratic& q, const StopCondition& stop) {
  const auto n = static_cast<std::uint32_t>(q.linear.size());
  std::vector<std::int64_t> linear = q.linear;
  FlowGraph graph(2 * n + 2);
  CutBuilder cut{graph, 2 * n, 2 * n + 1};
  for (const auto& p : q.products) {
    if (p.coefficient < 0) {  // c x y = c x - c x (1 - y)
      linear[p.i] += p.coefficient;
      graph.add_arc(p.j, p.i, -p.coefficient);
      graph.add_arc(n + p.i, n + p.j, -p.coefficient);
    } else {
      graph.add_arc(n + p.j, p.i, p.coefficient);
      graph.add_arc(n + p.i, p.j, p.coefficient);
    }
  }
  std::int64_t constant = q.constant;
  for (std::uint32_t i = 0; i < n; ++i) {
    if (linear[i] < 0) constant += linear[i];
    cut.linear(i, linear[i]);
    // a x = a - a (1 - x); the constant is the same as above where a < 0 and drops out where a > 0
    cut.linear(n + i, -linear[i]);
  }
  CutAnswer answer;
  answer.finished = graph.solve(2 * n, 2 * n + 1, stop);
  if (!answer.finished) return answer;
  answer.energy = static_cast<double>(2 * constant + graph.flow()) / 2.0;
  answer.x.assign(n, -1);
  for (std::uint32_t i = 0; i < n; ++i) {
    if (graph.reachable(i) != graph.reachable(n + i)) answer.x[i] = graph.reachable(i) ? 0 : 1;
  }
  return answer;
}

}  // namespace

MinCutResult min_cut(const GroundNetwork& network, const StopCondition& stop) {
  MinCutResult result;
  QuadraticBuilder builder(network);
  if (!builder.build()) return result;
  const Quadratic& q = builder.function();
  const std::vector<bool> turned = find_turns(q);
  const bool exact = q.linear.empty() || !turned.empty();
  const CutAnswer answer = exact ? submodular_cut(q, turned, stop) : roof_dual(q, stop);
  if (!answer.finished) {
    result.status = MinCutStatus::kStopped;
    return result;
  }
  result.bound = builder.to_score(answer.energy);
  // The soft costs of any world lie within +-(hard - 1): a larger minimum breaks something hard.
  if (answer.energy >= static_cast<double>(builder.hard())) {
    result.status = MinCutStatus::kImpossible;
    return result;
  }
  result.status = exact ? MinCutStatus::kOptimal : MinCutStatus::kPartial;
  result.values.assign(network.variable_count(), MinCutResult::kUndecided);
  bool all = true;
  for (std::size_t v = 0; v < network.variable_count(); ++v) {
    if (network.value_count(VariableId(v)) == 1) {
      result.values[v] = 0;
    } else if (answer.x[v] >= 0) {
      result.values[v] = answer.x[v] > 0 ? 0 : 1;
    } else {
      all = false;
    }
  }
  if (all) result.status = MinCutStatus::kOptimal;
  return result;
}

}  // namespace sherlog
