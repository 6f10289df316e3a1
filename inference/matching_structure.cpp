#include "inference/matching_structure.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <numeric>
#include <span>
#include <unordered_map>
#include <utility>

namespace sherlog {
namespace {

constexpr std::uint32_t kMaxAnchors = 1u << 18;
constexpr std::uint32_t kMaxValues = 11;       // on-values of an anchor
constexpr double kMaxClusterValues = 1 << 14;  // joint values that a cluster may have, times the states of its row
constexpr std::uint8_t kMaxBits = 64;          // disjunctions over the cells of one row

// Two literals of different variables of which one has to hold.
struct Exclusion {
  Literal a, b;
};

class Finder {
 public:
  Finder(const GroundNetwork& network, ComponentId component) : network_(network), component_(component) {}

  MatchingStructure run() {
    if (find_exclusions() && find_anchors() && count_exclusions() && find_groups() && colour() && build_clusters()) {
      find_roles();
    }
    return std::move(out_);
  }

 private:
  bool refuse(std::string why) {
    out_.problem = std::move(why);
    return false;
  }

  std::string name(std::uint32_t anchor) const {
    return network_.atom_text(network_.first_atom(out_.cells[anchor].anchor));
  }

  // --- exclusions and anchors

  std::optional<Exclusion> exclusion(Literal root) const {
    if (!root.is_gate() || root.negated() || network_.gate_kind(root.gate()) != GateKind::kOr) return std::nullopt;
    const auto inputs = network_.gate_inputs(root.gate());
    if (inputs.size() != 2 || !inputs[0].is_atom() || !inputs[1].is_atom()) return std::nullopt;
    const VariableId a = network_.variable_of(inputs[0].atom()), b = network_.variable_of(inputs[1].atom());
    if (a == b) return std::nullopt;
    return Exclusion{inputs[0], inputs[1]};
  }

  bool find_exclusions() {
    for (std::uint32_t c : network_.component_constraints(component_)) {
      if (const auto found = exclusion(network_.constraints()[c].literal)) {
        exclusions_.push_back(*found);
        is_exclusion_.push_back(true);
      } else {
        is_exclusion_.push_back(false);
        deny(network_.constraints()[c].literal);
      }
    }
    return exclusions_.empty() ? refuse("no two of its variables exclude each other") : true;
  }

  // What a single literal rules out. Exclusions of such values say nothing.
  void deny(Literal unit) {
    if (!unit.is_atom()) return;
    const VariableId v = network_.variable_of(unit.atom());
    const std::uint32_t value = network_.value_of(unit.atom());
    std::vector<bool>& denied = denied_[v.value];
    denied.resize(network_.value_count(v), false);
    for (std::uint32_t k = 0; k < denied.size(); ++k) {
      if ((k == value) == unit.negated()) denied[k] = true;
    }
  }

  bool is_denied(VariableId v, std::uint32_t value) const {
    if (denied_.empty()) return false;
    const auto found = denied_.find(v.value);
    return found != denied_.end() && found->second[value];
  }

  // The values of the literal's variable under which it is false and that are possible.
  template <class F>
  void for_each_excluded(Literal literal, const F& f) const {
    const VariableId v = network_.variable_of(literal.atom());
    const std::uint32_t value = network_.value_of(literal.atom());
    if (literal.negated()) {
      if (!is_denied(v, value)) f(value);
      return;
    }
    for (std::uint32_t k = 0; k < network_.value_count(v); ++k) {
      if (k != value && !is_denied(v, k)) f(k);
    }
  }

  bool find_anchors() {
    out_.cell_of.assign(network_.variable_count(), kNoGroup);
    for (const Exclusion& e : exclusions_) {
      for (Literal literal : {e.a, e.b}) {
        const VariableId v = network_.variable_of(literal.atom());
        std::uint32_t& cell = out_.cell_of[v.index()];
        if (cell == kNoGroup) {
          cell = static_cast<std::uint32_t>(out_.cells.size());
          if (cell == kMaxAnchors) return refuse(fmt::format("more than {} variables exclude each other", kMaxAnchors));
          out_.cells.push_back({v, std::vector<bool>(network_.value_count(v), false), 0, 0, {}, {}});
        }
        for_each_excluded(literal, [&](std::uint32_t value) { out_.cells[cell].on[value] = true; });
      }
    }
    for (std::uint32_t a = 0; a < out_.cells.size(); ++a) {
      on_count_.push_back(static_cast<std::uint32_t>(std::ranges::count(out_.cells[a].on, true)));
      if (on_count_.back() > kMaxValues) return refuse(fmt::format("too many values of {} exclude others", name(a)));
    }
    return true;
  }

  // In how many values two cells exclude each other; 0: not at all.
  std::uint32_t count(std::uint32_t a, std::uint32_t b) const {
    const std::span<const Neighbour> all(neighbours_);
    const auto around = all.subspan(start_[a], start_[a + 1] - start_[a]);
    const auto found = std::ranges::lower_bound(around, b, {}, &Neighbour::cell);
    return found == around.end() || found->cell != b ? 0 : found->count;
  }

  void add_common_neighbours(std::uint32_t a, std::uint32_t b, std::vector<std::uint32_t>& common) const {
    std::uint32_t i = start_[a], j = start_[b];
    while (i < start_[a + 1] && j < start_[b + 1]) {
      const std::uint32_t x = neighbours_[i].cell, y = neighbours_[j].cell;
      if (x == y) common.push_back(x);
      i += x <= y ? 1U : 0U;
      j += y <= x ? 1U : 0U;
    }
  }

  // Both ways, sorted by cells.
  bool count_exclusions() {
    struct Stated {
      std::uint32_t a, b, count;
      bool at_once;  // a clause with a positive literal excludes several values in one go
    };
    std::vector<Stated> stated;
    stated.reserve(2 * exclusions_.size());
    for (const Exclusion& e : exclusions_) {
      const std::uint32_t a = cell_of(e.a), b = cell_of(e.b);
      std::uint32_t values_a = 0, values_b = 0;
      for_each_excluded(e.a, [&](std::uint32_t) { ++values_a; });
      for_each_excluded(e.b, [&](std::uint32_t) { ++values_b; });
      if (values_a * values_b == 0) continue;
      const bool at_once = !e.a.negated() || !e.b.negated();
      stated.push_back({a, b, values_a * values_b, at_once});
      stated.push_back({b, a, values_a * values_b, at_once});
    }
    std::ranges::sort(stated, {}, [](const Stated& s) { return std::uint64_t{s.a} << 32 | s.b; });
    start_.assign(out_.cells.size() + 1, 0);
    for (std::size_t i = 0; i < stated.size();) {
      const Stated& first = stated[i];
      std::uint32_t sum = 0;
      bool at_once = false;
      std::size_t end = i;
      for (; end < stated.size() && stated[end].a == first.a && stated[end].b == first.b; ++end) {
        sum += stated[end].count;
        at_once = at_once || stated[end].at_once;
      }
      if (at_once && end - i > 1) {
        return refuse(fmt::format("{} and {} exclude each other in several ways", name(first.a), name(first.b)));
      }
      neighbours_.push_back({first.b, sum});
      ++start_[first.a + 1];
      i = end;
    }
    for (std::size_t a = 0; a < out_.cells.size(); ++a) start_[a + 1] += start_[a];
    return true;
  }

  std::uint32_t cell_of(Literal literal) const { return out_.cell_of[network_.variable_of(literal.atom()).index()]; }

  // --- rows and columns

  bool find_groups() {
    const auto cells = static_cast<std::uint32_t>(out_.cells.size());
    groups_of_.assign(cells, {kNoGroup, kNoGroup});
    for (std::uint32_t a = 0; a < cells; ++a) {
      for (std::uint32_t at = start_[a]; at < start_[a + 1]; ++at) {
        const std::uint32_t b = neighbours_[at].cell;
        if (b < a || share_group(a, b)) continue;
        MatchingGroup group;
        group.cells = {a, b};
        add_common_neighbours(a, b, group.cells);
        if (!add_group(std::move(group))) return false;
      }
    }
    return true;
  }

  bool share_group(std::uint32_t a, std::uint32_t b) const {
    for (std::uint32_t g : groups_of_[a]) {
      if (g != kNoGroup && (g == groups_of_[b][0] || g == groups_of_[b][1])) return true;
    }
    return false;
  }

  bool add_group(MatchingGroup group) {
    const auto number = static_cast<std::uint32_t>(out_.groups.size());
    for (std::uint32_t a : group.cells) {
      auto& mine = groups_of_[a];
      if (mine[1] != kNoGroup) return refuse(fmt::format("{} excludes variables of more than two groups", name(a)));
      mine[mine[0] == kNoGroup ? 0 : 1] = number;
      for (std::uint32_t b : group.cells) {
        if (a < b && count(a, b) != on_count_[a] * on_count_[b]) {
          return refuse(fmt::format("{} and {} do not exclude each other in all their values", name(a), name(b)));
        }
      }
    }
    out_.groups.push_back(std::move(group));
    return true;
  }

  bool colour() {
    std::vector<int> colour(out_.groups.size(), -1);
    for (std::uint32_t start = 0; start < colour.size(); ++start) {
      if (colour[start] >= 0) continue;
      colour[start] = 0;
      std::vector<std::uint32_t> todo = {start};
      while (!todo.empty()) {
        const std::uint32_t g = todo.back();
        todo.pop_back();
        for (std::uint32_t a : out_.groups[g].cells) {
          for (std::uint32_t other : groups_of_[a]) {
            if (other == kNoGroup || other == g) continue;
            if (colour[other] == colour[g]) return refuse("its groups are not the rows and columns of one matrix");
            if (colour[other] < 0) todo.push_back(other);
            colour[other] = 1 - colour[g];
          }
        }
      }
    }
    for (std::uint32_t g = 0; g < out_.groups.size(); ++g) {
      MatchingGroup& group = out_.groups[g];
      group.is_row = colour[g] == 0;
      group.number = group.is_row ? out_.rows++ : out_.columns++;
    }
    for (std::uint32_t a = 0; a < out_.cells.size(); ++a) {
      std::uint32_t row = kNoGroup, column = kNoGroup;
      for (std::uint32_t g : groups_of_[a]) {
        if (g != kNoGroup) (out_.groups[g].is_row ? row : column) = out_.groups[g].number;
      }
      out_.cells[a].row = row != kNoGroup ? row : out_.rows++;
      out_.cells[a].column = column != kNoGroup ? column : out_.columns++;
    }
    return true;
  }

  // --- clusters of what is left

  std::uint32_t root(std::uint32_t x) {
    while (parent_[x] != x) x = parent_[x] = parent_[parent_[x]];
    return x;
  }

  // Nodes: variables of the network, then groups.
  bool build_clusters() {
    const auto variables = static_cast<std::uint32_t>(network_.variable_count());
    parent_.resize(variables + out_.groups.size());
    std::iota(parent_.begin(), parent_.end(), 0u);
    visited_.assign(network_.gate_count(), 0);
    out_.group_of_gate.assign(network_.gate_count(), kNoGroup);
    out_.bit_of_gate.assign(network_.gate_count(), 0);
    bits_of_group_.assign(out_.groups.size(), 0);
    for (const MatchingCell& cell : out_.cells) masks_.push_back({Masks(cell.on.size(), 0), Masks(cell.on.size(), 0)});
    out_.anchors_only.assign(network_.gate_count(), 0);
    const auto constraints = network_.component_constraints(component_);
    for (std::size_t i = 0; i < constraints.size(); ++i) {
      if (!is_exclusion_[i] && !join(network_.constraints()[constraints[i]].literal)) return false;
    }
    for (std::uint32_t f : network_.component_features(component_)) {
      if (!join(network_.features()[f].literal)) return false;
    }
    for (std::uint32_t q : network_.component_queries(component_)) {
      if (!join(network_.queries()[q].literal)) return false;
    }
    cluster_at_.assign(parent_.size(), kNoGroup);
    for (VariableId v : network_.component_variables(component_)) cluster(v.value).variables.push_back(v);
    for (std::size_t i = 0; i < constraints.size(); ++i) {
      if (!is_exclusion_[i])
        cluster(network_.constraints()[constraints[i]].literal).constraints.push_back(constraints[i]);
    }
    for (std::uint32_t f : network_.component_features(component_)) {
      cluster(network_.features()[f].literal).features.push_back(f);
    }
    for (std::uint32_t q : network_.component_queries(component_)) {
      if (!network_.queries()[q].literal.is_constant()) cluster(network_.queries()[q].literal).queries.push_back(q);
    }
    return true;
  }

  MatchingCluster& cluster(std::uint32_t node) {
    std::uint32_t& at = cluster_at_[root(node)];
    if (at == kNoGroup) {
      at = static_cast<std::uint32_t>(out_.clusters.size());
      out_.clusters.emplace_back();
    }
    return out_.clusters[at];
  }
  MatchingCluster& cluster(Literal literal) {
    return cluster(literal.is_atom() ? network_.variable_of(literal.atom()).value : node_of_gate(literal.gate()));
  }

  // Some node of the gate's support; they are all in one cluster.
  std::uint32_t node_of_gate(GateId gate) const {
    const std::uint32_t group = out_.group_of_gate[gate.index()];
    if (group != kNoGroup) return static_cast<std::uint32_t>(network_.variable_count()) + group;
    const Literal first = network_.gate_inputs(gate)[0];
    return first.is_atom() ? network_.variable_of(first.atom()).value : node_of_gate(first.gate());
  }

  // Puts everything that the literal depends on into one cluster.
  bool join(Literal literal) {
    if (literal.is_constant()) return true;
    std::vector<std::uint32_t> nodes;
    ++visit_;
    if (!support(literal, nodes)) return false;
    for (std::uint32_t node : nodes) parent_[root(node)] = root(nodes[0]);
    return true;
  }

  bool support(Literal literal, std::vector<std::uint32_t>& nodes) {
    if (literal.is_atom()) {
      nodes.push_back(network_.variable_of(literal.atom()).value);
      return true;
    }
    const GateId gate = literal.gate();
    if (visited_[gate.index()] == visit_) return true;
    const bool seen_before = visited_[gate.index()] != 0;
    visited_[gate.index()] = visit_;
    if (network_.gate_kind(gate) == GateKind::kAtMostOne) return refuse("it has folded constraints");
    if (!seen_before && network_.gate_kind(gate) == GateKind::kOr && !recognise_group(gate)) return false;
    const std::uint32_t group = out_.group_of_gate[gate.index()];
    const bool grouped = group != kNoGroup;
    if (grouped) nodes.push_back(static_cast<std::uint32_t>(network_.variable_count()) + group);
    for (Literal input : network_.gate_inputs(gate)) {
      if (grouped && anchors_only(input)) continue;
      if (!support(input, nodes)) return false;
    }
    return true;
  }

  // Speaks of anchors only: an atom of one, or a disjunction of such.
  bool anchors_only(Literal literal) {
    if (literal.is_atom()) return cell_of(literal) != kNoGroup;
    if (literal.negated() || network_.gate_kind(literal.gate()) != GateKind::kOr) return false;
    std::uint8_t& known = out_.anchors_only[literal.gate().index()];
    if (known == 0) {
      const bool all =
          std::ranges::all_of(network_.gate_inputs(literal.gate()), [&](Literal input) { return anchors_only(input); });
      known = all ? 1 : 2;
    }
    return known == 1;
  }

  // The values under which some input that speaks of anchors only is true.
  template <class F>
  void for_each_named(GateId gate, const F& f) {
    for (Literal input : network_.gate_inputs(gate)) {
      if (!anchors_only(input)) continue;
      if (input.is_gate()) {
        for_each_named(input.gate(), f);
        continue;
      }
      const std::uint32_t cell = cell_of(input), value = network_.value_of(input.atom());
      const VariableId anchor = out_.cells[cell].anchor;
      for (std::uint32_t k = 0; k < network_.value_count(anchor); ++k) {
        if ((k == value) != input.negated() && !is_denied(anchor, k)) f(cell, k);
      }
    }
  }

  // A disjunction over several anchors has to be over cells of one row or column, in some of their on-values.
  bool recognise_group(GateId gate) {
    named_.clear();
    for_each_named(gate, [&](std::uint32_t cell, std::uint32_t value) { named_.emplace_back(cell, value); });
    const bool several =
        std::ranges::any_of(named_, [&](const auto& cell_value) { return cell_value.first != named_[0].first; });
    if (!several) return true;
    for (std::uint32_t g : groups_of_[named_[0].first]) {
      if (g == kNoGroup || !std::ranges::all_of(named_, [&](const auto& cell_value) {
            return side_of(cell_value.first, g) < 2 && out_.cells[cell_value.first].on[cell_value.second];
          })) {
        continue;
      }
      if (bits_of_group_[g] == kMaxBits) {
        return refuse(
            fmt::format("more than {} disjunctions over the row or column of {}", kMaxBits, name(named_[0].first)));
      }
      const std::uint8_t bit = bits_of_group_[g]++;
      for (const auto& [cell, value] : named_) masks_[cell][side_of(cell, g)][value] |= std::uint64_t{1} << bit;
      out_.group_of_gate[gate.index()] = g;
      out_.bit_of_gate[gate.index()] = bit;
      return true;
    }
    return refuse(
        fmt::format("a disjunction over {} and others is not one over a row or column", name(named_[0].first)));
  }

  // Which of the cell's groups that is; 2: none.
  std::size_t side_of(std::uint32_t cell, std::uint32_t group) const {
    return groups_of_[cell][0] == group ? 0 : groups_of_[cell][1] == group ? 1 : 2;
  }

  void number_states() {
    for (std::uint32_t a = 0; a < out_.cells.size(); ++a) {
      MatchingCell& cell = out_.cells[a];
      cell.row_state.assign(cell.on.size(), 0);
      cell.column_state.assign(cell.on.size(), 0);
      for (std::size_t side = 0; side < 2; ++side) {
        if (groups_of_[a][side] == kNoGroup) continue;
        MatchingGroup& group = out_.groups[groups_of_[a][side]];
        for (std::size_t value = 0; value < cell.on.size(); ++value) {
          const auto found = std::ranges::find(group.states, masks_[a][side][value]);
          (group.is_row ? cell.row_state : cell.column_state)[value] =
              static_cast<std::uint32_t>(found - group.states.begin());
          if (found == group.states.end()) group.states.push_back(masks_[a][side][value]);
        }
      }
    }
  }

  bool find_roles() {
    number_states();
    for (std::uint32_t a = 0; a < out_.cells.size(); ++a) {
      MatchingCluster& own = cluster(out_.cells[a].anchor.value);
      if (own.cell != kNoGroup) return refuse(fmt::format("a formula ties {} to {}", name(a), name(own.cell)));
      own.cell = a;
    }
    for (std::uint32_t g = 0; g < out_.groups.size(); ++g) {
      const std::uint32_t at = cluster_at_[root(static_cast<std::uint32_t>(network_.variable_count()) + g)];
      if (at == kNoGroup) continue;  // nobody asks whether this row is empty
      MatchingCluster& own = out_.clusters[at];
      if (own.cell != kNoGroup || own.group != kNoGroup) {
        return refuse(fmt::format("a formula ties {} to other rows or columns", name(out_.groups[g].cells[0])));
      }
      own.group = g;
    }
    for (const MatchingCluster& c : out_.clusters) {
      double values = c.group == kNoGroup ? 1.0 : static_cast<double>(out_.groups[c.group].states.size());
      for (VariableId v : c.variables) values *= network_.value_count(v);
      if (values > kMaxClusterValues) return refuse(fmt::format("{} variables are tied together", c.variables.size()));
      if (c.cell == kNoGroup && c.group == kNoGroup) return refuse("some of its variables belong to no pair");
    }
    return true;
  }

  const GroundNetwork& network_;
  ComponentId component_;
  MatchingStructure out_;
  std::vector<Exclusion> exclusions_;
  std::vector<bool> is_exclusion_;                               // by position in component_constraints
  std::unordered_map<std::uint32_t, std::vector<bool>> denied_;  // by variable
  std::vector<std::uint32_t> on_count_;                          // by cell
  struct Neighbour {
    std::uint32_t cell, count;  // excluded pairs of values
  };
  std::vector<Neighbour> neighbours_;                    // cell by cell, sorted
  std::vector<std::uint32_t> start_;                     // by cell
  std::vector<std::array<std::uint32_t, 2>> groups_of_;  // by cell
  std::vector<std::uint32_t> parent_, cluster_at_, visited_;
  std::uint32_t visit_ = 0;
  using Masks = std::vector<std::uint64_t>;  // by value
  std::vector<std::array<Masks, 2>> masks_;  // by cell and side: the disjunctions that the value makes true
  std::vector<std::uint8_t> bits_of_group_;
  std::vector<std::pair<std::uint32_t, std::uint32_t>> named_;  // cell, value
};

}  // namespace

MatchingStructure find_matching(const GroundNetwork& network, ComponentId component) {
  return Finder(network, component).run();
}

}  // namespace sherlog
