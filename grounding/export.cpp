#include "grounding/export.h"

#include <fmt/format.h>

#include <algorithm>
#include <boost/graph/adjacency_list.hpp>
#include <boost/graph/graphml.hpp>
#include <boost/graph/graphviz.hpp>
#include <boost/property_map/dynamic_property_map.hpp>
#include <cmath>
#include <functional>
#include <map>
#include <ostream>
#include <string>
#include <vector>

namespace sherlog {
namespace {

double sum_of_weights(const GroundNetwork& network) {
  double sum = 0;
  for (const Feature& feature : network.features()) sum += std::abs(feature.weight);
  return sum;
}

// The gates that the literals of features and constraints lead to; those of queries alone are left out.
std::vector<bool> needed_gates(const GroundNetwork& network) {
  std::vector<bool> needed(network.gate_count(), false);
  const auto mark = [&](Literal literal) {
    if (literal.is_gate()) needed[literal.gate().index()] = true;
  };
  for (const Feature& feature : network.features()) mark(feature.literal);
  for (const Constraint& constraint : network.constraints()) mark(constraint.literal);
  for (std::size_t g = network.gate_count(); g-- > 0;) {  // inputs come before their gate
    if (!needed[g]) continue;
    for (Literal input : network.gate_inputs(GateId(g))) mark(input);
  }
  return needed;
}

// --- WCNF -------------------------------------------------------------------------------------------------------------

class WcnfWriter {
 public:
  explicit WcnfWriter(const GroundNetwork& network) : network_(network), scale_(choose_scale(network)) {}

  void write(std::ostream& out) {
    add_blocks();
    add_gates();
    for (const Constraint& constraint : network_.constraints()) hard({number(constraint.literal)});
    add_features();
    const auto top = static_cast<std::uint64_t>(total_) + 1;
    out << "c A ground Markov logic network; log score = offset - cost / scale\n";
    out << fmt::format("c scale {}\nc offset {}\n", scale_, offset_);
    for (std::size_t a = 0; a < network_.atom_count(); ++a) {
      out << fmt::format("c atom {} {}\n", a + 1, network_.atom_text(AtomId(a)));
    }
    out << fmt::format("p wcnf {} {} {}\n", network_.atom_count() + network_.gate_count(), clauses_.size(), top);
    for (const Clause& clause : clauses_) {
      out << (clause.weight == 0 ? top : clause.weight);
      for (std::int64_t literal : clause.literals) out << ' ' << literal;
      out << " 0\n";
    }
  }

 private:
  struct Clause {
    std::uint64_t weight;  // 0: hard
    std::vector<std::int64_t> literals;
  };

  // The finest power of ten up to a million at which all weights together stay far below 2^63.
  static double choose_scale(const GroundNetwork& network) {
    double scale = 1e6;
    const double sum = sum_of_weights(network);
    while (std::isfinite(sum) && sum * scale > 0x1p60) scale /= 10;
    return scale;
  }

  std::int64_t number(Literal literal) const {
    const std::int64_t node = literal.is_gate()
                                  ? static_cast<std::int64_t>(network_.atom_count() + literal.gate().index() + 1)
                                  : static_cast<std::int64_t>(literal.atom().index() + 1);
    return literal.negated() ? -node : node;
  }

  void hard(std::vector<std::int64_t> literals) { clauses_.push_back({0, std::move(literals)}); }

  void add_blocks() {
    for (std::size_t v = 0; v < network_.variable_count(); ++v) {
      const VariableId variable(v);
      const std::int64_t first = static_cast<std::int64_t>(network_.first_atom(variable).index()) + 1;
      const std::int64_t end = first + network_.candidate_count(variable);
      for (std::int64_t a = first; a < end; ++a) {
        for (std::int64_t b = a + 1; b < end; ++b) hard({-a, -b});
      }
      if (network_.has_none(variable)) continue;
      std::vector<std::int64_t> at_least_one;
      for (std::int64_t a = first; a < end; ++a) at_least_one.push_back(a);
      hard(std::move(at_least_one));
    }
  }

  void add_gates() {
    const std::vector<bool> needed = needed_gates(network_);
    for (std::size_t g = 0; g < network_.gate_count(); ++g) {
      if (!needed[g]) continue;
      const std::int64_t self = number(Literal::gate(GateId(g)));
      const auto inputs = network_.gate_inputs(GateId(g));
      if (network_.gate_kind(GateId(g)) == GateKind::kIff) {
        const std::int64_t a = number(inputs[0]), b = number(inputs[1]);
        hard({-self, -a, b});
        hard({-self, a, -b});
        hard({self, a, b});
        hard({self, -a, -b});
        continue;
      }
      std::vector<std::int64_t> some{-self};
      for (Literal input : inputs) {
        some.push_back(number(input));
        hard({self, -number(input)});
      }
      hard(std::move(some));
    }
  }

  void add_features() {
    for (const Feature& feature : network_.features()) {
      const auto weight = static_cast<std::uint64_t>(std::llround(std::abs(feature.weight) * scale_));
      if (feature.weight > 0) offset_ += feature.weight;
      if (weight == 0) continue;
      total_ += static_cast<double>(weight);
      clauses_.push_back({weight, {number(feature.weight > 0 ? feature.literal : ~feature.literal)}});
    }
    offset_ += network_.constant_score();
  }

  const GroundNetwork& network_;
  double scale_;
  double offset_ = 0;
  double total_ = 0;
  std::vector<Clause> clauses_;
};

// --- UAI --------------------------------------------------------------------------------------------------------------

class UaiWriter {
 public:
  explicit UaiWriter(const GroundNetwork& network) : network_(network), gate_variable_(network.gate_count(), kUnset) {
    for (std::size_t v = 0; v < network.variable_count(); ++v) sizes_.push_back(network.value_count(VariableId(v)));
  }

  // More tables than anybody can read would be needed.
  bool too_heavy() const {
    double pieces = pieces_of(network_.constant_score() + network_.free_log_count());
    for (const Feature& feature : network_.features()) pieces += std::max(1.0, pieces_of(feature.weight)) - 1;
    return !(pieces <= kMaxPieces);
  }

  void write(std::ostream& out) {
    for (const Feature& feature : network_.features()) add_feature(feature);
    for (const Constraint& constraint : network_.constraints()) {
      add_literal(constraint.literal, [](bool truth) { return truth ? 1.0 : 0.0; });
    }
    add_constant(network_.constant_score() + network_.free_log_count());
    out << "MARKOV\n" << sizes_.size() << '\n';
    for (std::size_t i = 0; i < sizes_.size(); ++i) out << (i == 0 ? "" : " ") << sizes_[i];
    out << '\n' << factors_.size() << '\n';
    for (const Factor& factor : factors_) {
      out << factor.scope.size();
      for (std::uint32_t variable : factor.scope) out << ' ' << variable;
      out << '\n';
    }
    for (const Factor& factor : factors_) {
      out << '\n' << factor.table.size() << '\n';
      for (std::size_t i = 0; i < factor.table.size(); ++i)
        out << (i == 0 ? "" : " ") << fmt::format("{}", factor.table[i]);
      out << '\n';
    }
  }

 private:
  static constexpr std::uint32_t kUnset = 0xffffffffu;
  static constexpr double kMaxPieces = 1e5;        // of huge weights, all together
  static constexpr double kMaxExponent = 500;      // exp of more could be no double, or 0
  static constexpr double kMaxDirectTable = 1024;  // beyond it auxiliary variables are the smaller file

  struct Factor {
    std::vector<std::uint32_t> scope;
    std::vector<double> table;
  };
  // True where the file's variable has (or, negated, has not) this value.
  struct Test {
    std::uint32_t variable;
    std::uint32_t value;
    bool negated;
  };
  using Values = std::map<std::uint32_t, std::uint32_t>;

  static bool holds(const Test& test, const Values& values) {
    return (values.at(test.variable) == test.value) != test.negated;
  }

  void add_factor(std::vector<std::uint32_t> scope, const std::function<double(const Values&)>& entry) {
    std::sort(scope.begin(), scope.end());
    scope.erase(std::unique(scope.begin(), scope.end()), scope.end());
    Factor factor{scope, {}};
    Values values;
    for (std::uint32_t variable : scope) values[variable] = 0;
    while (true) {
      factor.table.push_back(entry(values));
      std::size_t i = scope.size();
      while (i > 0 && ++values[scope[i - 1]] == sizes_[scope[i - 1]]) values[scope[--i]] = 0;
      if (i == 0) break;
    }
    factors_.push_back(std::move(factor));
  }

  // exp(weight) of a very large weight is no double: exp(w / n) n times.
  static double pieces_of(double weight) { return std::ceil(std::abs(weight) / kMaxExponent); }

  void add_feature(const Feature& feature) {
    const int pieces = std::max(1, static_cast<int>(pieces_of(feature.weight)));
    const double entry = std::exp(feature.weight / pieces);
    for (int i = 0; i < pieces; ++i) {
      add_literal(feature.literal, [entry](bool truth) { return truth ? entry : 1.0; });
    }
  }

  // The same entry whatever the world; over the first variable, because not every reader knows tables over none.
  void add_constant(double log_value) {
    const int pieces = static_cast<int>(pieces_of(log_value));
    std::vector<std::uint32_t> scope;
    if (!sizes_.empty()) scope.push_back(0);
    for (int i = 0; i < pieces; ++i) add_factor(scope, [&](const Values&) { return std::exp(log_value / pieces); });
  }

  void add_literal(Literal literal, const std::function<double(bool)>& entry) {
    std::vector<std::uint32_t> scope;
    if (fits_directly(literal, scope)) {
      add_factor(scope, [&](const Values& values) { return entry(evaluate(literal, values)); });
    } else {
      const Test test = test_of(literal);
      add_factor({test.variable}, [&](const Values& values) { return entry(holds(test, values)); });
    }
  }

  // Collects the variables below a literal, as long as their joint table is small.
  bool fits_directly(Literal literal, std::vector<std::uint32_t>& scope) const {
    std::vector<Literal> open{literal};
    double entries = 1;
    std::size_t visited = 0;
    while (!open.empty()) {
      const Literal next = open.back();
      open.pop_back();
      if (++visited > 64) return false;
      if (next.is_gate()) {
        const auto inputs = network_.gate_inputs(next.gate());
        if (inputs.size() > 64) return false;
        open.insert(open.end(), inputs.begin(), inputs.end());
        continue;
      }
      const std::uint32_t variable = network_.variable_of(next.atom()).value;
      if (std::find(scope.begin(), scope.end(), variable) != scope.end()) continue;
      scope.push_back(variable);
      entries *= sizes_[variable];
      if (entries > kMaxDirectTable) return false;
    }
    return true;
  }

  // Small literals only (see fits_directly), so the recursion is shallow.
  bool evaluate(Literal literal, const Values& values) const {
    bool truth = false;
    if (literal.is_atom()) {
      truth = values.at(network_.variable_of(literal.atom()).value) == network_.value_of(literal.atom());
    } else {
      const auto inputs = network_.gate_inputs(literal.gate());
      if (network_.gate_kind(literal.gate()) == GateKind::kIff) {
        truth = evaluate(inputs[0], values) == evaluate(inputs[1], values);
      } else {
        truth = std::any_of(inputs.begin(), inputs.end(), [&](Literal input) { return evaluate(input, values); });
      }
    }
    return truth != literal.negated();
  }

  // The auxiliary variable of a gate is made when it is first asked for, those of the gates below before it.
  Test test_of(Literal literal) {
    if (literal.is_atom()) {
      return {network_.variable_of(literal.atom()).value, network_.value_of(literal.atom()), literal.negated()};
    }
    std::vector<GateId> open{literal.gate()};
    while (!open.empty()) {  // no recursion: gates may be nested deeply
      const GateId gate = open.back();
      bool ready = true;
      for (Literal input : network_.gate_inputs(gate)) {
        if (!input.is_gate() || gate_variable_[input.gate().index()] != kUnset) continue;
        open.push_back(input.gate());
        ready = false;
      }
      if (!ready) continue;
      open.pop_back();
      if (gate_variable_[gate.index()] == kUnset) gate_variable_[gate.index()] = define(gate);
    }
    return {gate_variable_[literal.gate().index()], 1, literal.negated()};
  }

  Test input_test(Literal input) const {
    if (input.is_gate()) return {gate_variable_[input.gate().index()], 1, input.negated()};
    return {network_.variable_of(input.atom()).value, network_.value_of(input.atom()), input.negated()};
  }

  // An OR of many inputs is a chain: each link is the OR of the links before it and one more input.
  std::uint32_t define(GateId gate) {
    const auto inputs = network_.gate_inputs(gate);
    const bool iff = network_.gate_kind(gate) == GateKind::kIff;
    Test result = input_test(inputs[0]);
    for (std::size_t i = 1; i < inputs.size(); ++i) {
      const Test left = result, right = input_test(inputs[i]);
      const auto link = static_cast<std::uint32_t>(sizes_.size());
      sizes_.push_back(2);
      add_factor({left.variable, right.variable, link}, [&](const Values& values) {
        const bool a = holds(left, values), b = holds(right, values);
        return (values.at(link) == 1) == (iff ? a == b : a || b) ? 1.0 : 0.0;
      });
      result = {link, 1, false};
    }
    return result.variable;
  }

  const GroundNetwork& network_;
  std::vector<std::uint32_t> sizes_;          // of the file's variables
  std::vector<std::uint32_t> gate_variable_;  // the file's variable of each gate
  std::vector<Factor> factors_;
};

// --- the factor graph -------------------------------------------------------------------------------------------------

struct NodeLabel {
  std::string kind;   // "variable", "feature" or "constraint"
  std::string label;  // atoms, or the ground formula
  double weight = 0;  // features
  std::string shape;  // for DOT
};
using FactorGraph = boost::adjacency_list<boost::vecS, boost::vecS, boost::undirectedS, NodeLabel>;

std::string variable_label(const GroundNetwork& network, VariableId variable) {
  const std::uint32_t count = network.candidate_count(variable);
  std::string label = network.atom_text(network.first_atom(variable));
  if (count == 1) return label;
  return fmt::format("{} ... {}", label, network.atom_text(AtomId(network.first_atom(variable).index() + count - 1)));
}

FactorGraph factor_graph(const GroundNetwork& network) {
  FactorGraph graph;
  for (std::size_t v = 0; v < network.variable_count(); ++v) {
    add_vertex({"variable", variable_label(network, VariableId(v)), 0, "ellipse"}, graph);
  }
  std::vector<std::size_t> seen(network.gate_count(), 0);  // the last factor that walked through the gate
  std::size_t factor_count = 0;
  const auto connect = [&](Literal literal, const NodeLabel& label) {
    const auto factor = add_vertex(label, graph);
    ++factor_count;
    std::vector<std::uint32_t> mentioned;
    std::vector<Literal> open{literal};
    while (!open.empty()) {
      const Literal next = open.back();
      open.pop_back();
      if (next.is_atom()) {
        mentioned.push_back(network.variable_of(next.atom()).value);
      } else if (next.is_gate() && seen[next.gate().index()] != factor_count) {
        seen[next.gate().index()] = factor_count;
        const auto inputs = network.gate_inputs(next.gate());
        open.insert(open.end(), inputs.begin(), inputs.end());
      }
    }
    std::sort(mentioned.begin(), mentioned.end());
    mentioned.erase(std::unique(mentioned.begin(), mentioned.end()), mentioned.end());
    for (std::uint32_t variable : mentioned) add_edge(variable, factor, graph);
  };
  for (const Feature& feature : network.features()) {
    connect(feature.literal, {"feature", network.literal_text(feature.literal), feature.weight, "box"});
  }
  for (const Constraint& constraint : network.constraints()) {
    connect(constraint.literal, {"constraint", network.literal_text(constraint.literal), 0, "octagon"});
  }
  return graph;
}

}  // namespace

std::optional<std::string> export_wcnf(const GroundNetwork& network, std::ostream& out) {
  if (!std::isfinite(sum_of_weights(network)) || !std::isfinite(network.constant_score())) {
    return "the weights of ground formulas add up to more than a number can hold";
  }
  WcnfWriter(network).write(out);
  return std::nullopt;
}

std::optional<std::string> export_uai(const GroundNetwork& network, std::ostream& out) {
  UaiWriter writer(network);
  if (writer.too_heavy()) {
    return "the weights are too large for 'uai', which has room for exp(weight) only; export 'wcnf' instead";
  }
  writer.write(out);
  return std::nullopt;
}

void export_graphml(const GroundNetwork& network, std::ostream& out) {
  FactorGraph graph = factor_graph(network);
  boost::dynamic_properties properties;
  properties.property("kind", get(&NodeLabel::kind, graph));
  properties.property("label", get(&NodeLabel::label, graph));
  properties.property("weight", get(&NodeLabel::weight, graph));
  boost::write_graphml(out, graph, properties, true);
}

void export_dot(const GroundNetwork& network, std::ostream& out) {
  const FactorGraph graph = factor_graph(network);
  boost::write_graphviz(out, graph, [&](std::ostream& stream, std::size_t vertex) {
    const NodeLabel& node = graph[vertex];
    std::string label = node.label;
    if (node.kind == "feature") label = fmt::format("{:.4g}  {}", node.weight, label);
    if (node.kind == "constraint") label += '.';
    stream << "[label=" << boost::escape_dot_string(label) << ", shape=" << node.shape << ']';
  });
}

}  // namespace sherlog
