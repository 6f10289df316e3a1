#include "inference/at_most_one.h"

#include <algorithm>

namespace sherlog {
namespace {

constexpr std::size_t kMaxExcludedValues = 16;  // a positive literal excludes all other values of its variable
constexpr std::uint64_t kLeastSteps = 100'000'000, kStepsPerEdge = 16;  // then no more groups are looked for
constexpr std::size_t kConstraintsPerStopCheck = 1 << 16;

class CliqueCover {
 public:
  CliqueCover(const GroundNetwork& network, std::span<const std::uint32_t> constraints, const StopCondition* stop)
      : network_(network), constraints_(constraints), stop_(stop) {}

  AtMostOne run() {
    AtMostOne out;
    if (!number_nodes() || !build_adjacency()) return out;
    const std::uint64_t most_steps = kLeastSteps + kStepsPerEdge * neighbour_.size();
    for (std::uint32_t a = 0; a + 1 < start_.size() && steps_ < most_steps && !stopped(); ++a) {
      for (std::uint32_t i = start_[a]; i < start_[a + 1]; ++i) {
        if (neighbour_[i] < a || covered_[i] != 0) continue;
        grow(a, neighbour_[i]);
        if (clique_.size() < 3 || mark_covered() < 2) {
          covered_[i] = 2;  // looked at; stays a clause unless a later clique takes it
          continue;
        }
        std::vector<VariableValue> group;
        for (const std::uint32_t node : clique_) {
          group.push_back(nodes_[node]);
          groups_of_[node].push_back(static_cast<std::uint32_t>(out.groups.size()));
        }
        out.groups.push_back(std::move(group));
      }
    }
    // A constraint is implied once all its edges are.
    std::vector<bool> open(constraints_.size(), true);
    for_each_constraint([&](std::size_t c) {
      open[c] = false;
      for_each_edge([&](std::uint32_t x, std::uint32_t y) { open[c] = open[c] || !in_one_group(x, y); });
    });
    for (std::size_t c = 0; c < open.size(); ++c) {
      if (!open[c]) out.covered.push_back(constraints_[c]);
    }
    std::sort(out.covered.begin(), out.covered.end());
    out.covered.erase(std::unique(out.covered.begin(), out.covered.end()), out.covered.end());
    return out;
  }

 private:
  bool stopped() const { return stop_ != nullptr && stop_->reached(); }

  // Calls `visit` for each constraint that excludes pairs of values; left_ and right_ are these values as slots.
  // False: stopped.
  template <class Visit>
  bool for_each_constraint(Visit visit) {
    for (std::size_t i = 0; i < constraints_.size(); ++i) {
      if (i % kConstraintsPerStopCheck == 0 && stopped()) return false;
      const Literal root = network_.constraints()[constraints_[i]].literal;
      if (!root.is_gate() || root.negated() || network_.gate_kind(root.gate()) != GateKind::kOr) continue;
      const auto inputs = network_.gate_inputs(root.gate());
      if (inputs.size() != 2 || !inputs[0].is_atom() || !inputs[1].is_atom()) continue;
      if (network_.variable_of(inputs[0].atom()) == network_.variable_of(inputs[1].atom())) continue;
      if (excluded_values(inputs[0], left_) && excluded_values(inputs[1], right_)) visit(i);
    }
    return true;
  }

  // Slots of the values under which the literal is false. False: too many.
  bool excluded_values(Literal literal, std::vector<std::uint32_t>& out) const {
    const VariableId variable = network_.variable_of(literal.atom());
    const std::uint32_t value = network_.value_of(literal.atom()), slot = first_slot_[variable.index()];
    out.clear();
    if (literal.negated()) {
      out.push_back(slot + value);
      return true;
    }
    if (network_.value_count(variable) > kMaxExcludedValues + 1) return false;
    for (std::uint32_t k = 0; k < network_.value_count(variable); ++k) {
      if (k != value) out.push_back(slot + k);
    }
    return true;
  }

  template <class Visit>
  void for_each_edge(Visit visit) const {
    for (const std::uint32_t x : left_) {
      for (const std::uint32_t y : right_) visit(node_of_[x], node_of_[y]);
    }
  }

  // Values that some constraint excludes, in the order of variables and values.
  bool number_nodes() {
    first_slot_.assign(network_.variable_count() + 1, 0);
    for (std::size_t v = 0; v < network_.variable_count(); ++v)
      first_slot_[v + 1] = first_slot_[v] + network_.value_count(VariableId(v));
    node_of_.assign(first_slot_.back(), 0);
    const bool all = for_each_constraint([&](std::size_t) {
      for (const std::uint32_t slot : left_) node_of_[slot] = 1;
      for (const std::uint32_t slot : right_) node_of_[slot] = 1;
    });
    if (!all) return false;
    for (std::size_t v = 0; v < network_.variable_count(); ++v) {
      for (std::uint32_t slot = first_slot_[v]; slot < first_slot_[v + 1]; ++slot) {
        if (node_of_[slot] == 0) continue;
        node_of_[slot] = static_cast<std::uint32_t>(nodes_.size());
        nodes_.push_back({VariableId(v), slot - first_slot_[v]});
      }
    }
    groups_of_.resize(nodes_.size());
    return true;
  }

  // Neighbours of each node, sorted: written down as they come, and then, node by node, into the lists of their neighbours.
  bool build_adjacency() {
    std::vector<std::size_t> begin(nodes_.size() + 1, 0);
    const auto count = [&](std::uint32_t x, std::uint32_t y) { ++begin[x + 1], ++begin[y + 1]; };
    if (!for_each_constraint([&](std::size_t) { for_each_edge(count); })) return false;
    for (std::size_t i = 1; i < begin.size(); ++i) begin[i] += begin[i - 1];
    if (begin.back() >= kTooMany) return false;
    std::vector<std::uint32_t> unsorted(begin.back());
    std::vector<std::size_t> end(begin.begin(), begin.end() - 1);
    const auto write = [&](std::uint32_t x, std::uint32_t y) { unsorted[end[x]++] = y, unsorted[end[y]++] = x; };
    if (!for_each_constraint([&](std::size_t) { for_each_edge(write); })) return false;
    std::vector<std::uint32_t> sorted(begin.back());
    end.assign(begin.begin(), begin.end() - 1);
    for (std::uint32_t x = 0; x < nodes_.size(); ++x) {
      for (std::size_t i = begin[x]; i < begin[x + 1]; ++i) {
        const std::uint32_t y = unsorted[i];
        if (end[y] == begin[y] || sorted[end[y] - 1] != x) sorted[end[y]++] = x;  // two constraints may say the same
      }
    }
    unsorted = {};
    start_.assign(nodes_.size() + 1, 0);
    for (std::uint32_t x = 0; x < nodes_.size(); ++x) {
      const auto from = sorted.begin() + static_cast<std::ptrdiff_t>(begin[x]);
      std::copy(from, sorted.begin() + static_cast<std::ptrdiff_t>(end[x]), sorted.begin() + start_[x]);
      start_[x + 1] = start_[x] + static_cast<std::uint32_t>(end[x] - begin[x]);
    }
    sorted.resize(start_.back());
    neighbour_ = std::move(sorted);
    covered_.assign(neighbour_.size(), 0);
    return true;
  }

  bool in_one_group(std::uint32_t x, std::uint32_t y) const {
    const auto &a = groups_of_[x], &b = groups_of_[y];
    for (std::size_t i = 0, j = 0; i < a.size() && j < b.size();) {
      if (a[i] == b[j]) return true;
      a[i] < b[j] ? ++i : ++j;
    }
    return false;
  }

  bool siblings(std::uint32_t a, std::uint32_t b) const { return nodes_[a].variable == nodes_[b].variable; }

  // Keeps the candidates that exclude `node` (itself dropped).
  void restrict_to_neighbours(std::uint32_t node) {
    std::uint32_t i = start_[node];
    const std::uint32_t end = start_[node + 1];
    std::size_t kept = 0;
    steps_ += candidates_.size() + (end - i);
    for (const std::uint32_t c : candidates_) {
      while (i < end && neighbour_[i] < c) ++i;
      if (c != node && ((i < end && neighbour_[i] == c) || siblings(c, node))) candidates_[kept++] = c;
    }
    candidates_.resize(kept);
  }

  void grow(std::uint32_t a, std::uint32_t b) {
    // Candidates: neighbours and siblings of a, in order.
    candidates_.clear();
    std::uint32_t first = a, last = a;
    while (first > 0 && siblings(first - 1, a)) --first;
    while (last + 1 < nodes_.size() && siblings(last + 1, a)) ++last;
    for (std::uint32_t s = first; s <= last; ++s) candidates_.push_back(s);
    candidates_.insert(candidates_.end(), neighbour_.begin() + start_[a], neighbour_.begin() + start_[a + 1]);
    std::sort(candidates_.begin(), candidates_.end());
    restrict_to_neighbours(a);
    restrict_to_neighbours(b);
    clique_ = {a, b};
    while (!candidates_.empty()) {
      const std::uint32_t next = candidates_.front();
      clique_.push_back(next);
      restrict_to_neighbours(next);
    }
    std::sort(clique_.begin(), clique_.end());
  }

  // Marks the clique's edges; returns how many were not covered before. Nothing is marked where that is fewer than two.
  std::size_t mark_covered() {
    fresh_.clear();
    for (const std::uint32_t node : clique_) {
      std::size_t j = 0;
      for (std::uint32_t i = start_[node]; i < start_[node + 1] && j < clique_.size(); ++i) {
        while (j < clique_.size() && clique_[j] < neighbour_[i]) ++j;
        if (j < clique_.size() && clique_[j] == neighbour_[i] && covered_[i] != 1 && !siblings(node, clique_[j]))
          fresh_.push_back(i);
      }
      steps_ += start_[node + 1] - start_[node];
    }
    const std::size_t count = fresh_.size() / 2;
    if (count >= 2) {
      for (const std::uint32_t e : fresh_) covered_[e] = 1;
    }
    return count;
  }

  static constexpr std::size_t kTooMany = 0xffffffffu;

  const GroundNetwork& network_;
  std::span<const std::uint32_t> constraints_;
  const StopCondition* stop_;
  std::vector<std::uint32_t> first_slot_, node_of_;  // by variable: of its values; by slot
  std::vector<std::uint32_t> left_, right_;          // of the constraint at hand
  std::vector<VariableValue> nodes_;                 // sorted
  std::vector<std::vector<std::uint32_t>> groups_of_;
  std::vector<std::uint32_t> start_, neighbour_;  // sorted adjacency
  std::vector<std::uint8_t> covered_;             // by position in neighbour_: 0 no, 1 yes, 2 tried in vain
  std::vector<std::uint32_t> candidates_, clique_, fresh_;
  std::uint64_t steps_ = 0;
};

}  // namespace

AtMostOne find_at_most_one(const GroundNetwork& network, std::span<const std::uint32_t> constraints,
                           const StopCondition* stop) {
  return CliqueCover(network, constraints, stop).run();
}

GroundNetwork fold_at_most_one(const GroundNetwork& network, const AtMostOne& found) {
  NetworkBuilder builder(network);
  builder.remove_constraints(found.covered);
  for (const auto& group : found.groups) {
    std::vector<Literal> literals;
    for (const VariableValue& v : group) {
      const AtomId first = network.first_atom(v.variable);
      if (v.value < network.candidate_count(v.variable)) {
        literals.push_back(Literal::atom(AtomId(first.value + v.value)));
        continue;
      }
      // "None of the candidates": a negated atom, or a negated disjunction of a block's atoms.
      std::vector<Literal> candidates;
      for (std::uint32_t i = 0; i < network.candidate_count(v.variable); ++i) {
        candidates.push_back(Literal::atom(AtomId(first.value + i)));
      }
      literals.push_back(~builder.make_or(candidates));
    }
    builder.add_constraint(builder.make_at_most_one(std::move(literals)), FormulaId(0));
  }
  return builder.build();
}

}  // namespace sherlog
