#include "inference/at_most_one.h"

#include <algorithm>

namespace sherlog {
namespace {

constexpr std::size_t kMaxExcludedValues = 16;  // a positive literal excludes all other values of its variable
constexpr std::uint64_t kMaxSteps = 100'000'000;

struct Edge {
  std::uint32_t a, b;  // nodes
  std::uint32_t constraint;
};

// The values under which the literal is false.
void excluded_values(const GroundNetwork& network, Literal literal, std::vector<VariableValue>& out) {
  const VariableId variable = network.variable_of(literal.atom());
  const std::uint32_t value = network.value_of(literal.atom());
  out.clear();
  if (literal.negated()) {
    out.push_back({variable, value});
    return;
  }
  for (std::uint32_t k = 0; k < network.value_count(variable); ++k) {
    if (k != value) out.push_back({variable, k});
  }
}

class CliqueCover {
 public:
  CliqueCover(const GroundNetwork& network, std::span<const std::uint32_t> constraints) {
    collect(network, constraints);
    build_adjacency();
  }

  AtMostOne run() {
    AtMostOne out;
    for (std::uint32_t a = 0; a + 1 < start_.size() && steps_ < kMaxSteps; ++a) {
      for (std::uint32_t i = start_[a]; i < start_[a + 1]; ++i) {
        if (neighbour_[i] < a || covered_[i] != 0) continue;
        grow(a, neighbour_[i]);
        if (clique_.size() < 3 || mark_covered() < 2) {
          covered_[i] = 2;  // looked at; stays a clause unless a later clique takes it
          continue;
        }
        std::vector<VariableValue> group;
        for (const std::uint32_t node : clique_) group.push_back(nodes_[node]);
        out.groups.push_back(std::move(group));
      }
    }
    // A constraint is implied once all its edges are.
    std::vector<std::uint32_t> open;
    for (const Edge& edge : edges_) {
      if (covered_[find(edge.a, edge.b)] != 1) open.push_back(edge.constraint);
    }
    std::sort(open.begin(), open.end());
    for (const Edge& edge : edges_) {
      if (!std::binary_search(open.begin(), open.end(), edge.constraint)) out.covered.push_back(edge.constraint);
    }
    std::sort(out.covered.begin(), out.covered.end());
    out.covered.erase(std::unique(out.covered.begin(), out.covered.end()), out.covered.end());
    return out;
  }

 private:
  void collect(const GroundNetwork& network, std::span<const std::uint32_t> constraints) {
    struct Pair {
      VariableValue a, b;
      std::uint32_t constraint;
    };
    std::vector<Pair> pairs;
    std::vector<VariableValue> left, right;
    for (const std::uint32_t c : constraints) {
      const Literal root = network.constraints()[c].literal;
      if (!root.is_gate() || root.negated() || network.gate_kind(root.gate()) != GateKind::kOr) continue;
      const auto inputs = network.gate_inputs(root.gate());
      if (inputs.size() != 2 || !inputs[0].is_atom() || !inputs[1].is_atom()) continue;
      if (network.variable_of(inputs[0].atom()) == network.variable_of(inputs[1].atom())) continue;
      excluded_values(network, inputs[0], left);
      excluded_values(network, inputs[1], right);
      if (left.size() > kMaxExcludedValues || right.size() > kMaxExcludedValues) continue;
      for (const auto& a : left) {
        for (const auto& b : right) {
          pairs.push_back({a, b, c});
          nodes_.push_back(a);
          nodes_.push_back(b);
        }
      }
    }
    std::sort(nodes_.begin(), nodes_.end());
    nodes_.erase(std::unique(nodes_.begin(), nodes_.end()), nodes_.end());
    const auto number = [&](const VariableValue& x) {
      return static_cast<std::uint32_t>(std::lower_bound(nodes_.begin(), nodes_.end(), x) - nodes_.begin());
    };
    edges_.reserve(pairs.size());
    for (const Pair& pair : pairs) edges_.push_back({number(pair.a), number(pair.b), pair.constraint});
  }

  void build_adjacency() {
    std::vector<std::uint64_t> both;
    both.reserve(edges_.size() * 2);
    for (const Edge& edge : edges_) {
      both.push_back(std::uint64_t{edge.a} << 32 | edge.b);
      both.push_back(std::uint64_t{edge.b} << 32 | edge.a);
    }
    std::sort(both.begin(), both.end());
    both.erase(std::unique(both.begin(), both.end()), both.end());
    start_.assign(nodes_.size() + 1, 0);
    neighbour_.reserve(both.size());
    for (const std::uint64_t pair : both) {
      ++start_[(pair >> 32) + 1];
      neighbour_.push_back(static_cast<std::uint32_t>(pair));
    }
    for (std::size_t i = 1; i < start_.size(); ++i) start_[i] += start_[i - 1];
    covered_.assign(both.size(), 0);
  }

  std::uint32_t find(std::uint32_t a, std::uint32_t b) const {
    const auto begin = neighbour_.begin() + start_[a], end = neighbour_.begin() + start_[a + 1];
    return static_cast<std::uint32_t>(std::lower_bound(begin, end, b) - neighbour_.begin());
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
    for (std::size_t i = 0; i < clique_.size(); ++i) {
      for (std::size_t j = 0; j < clique_.size(); ++j) {
        if (i == j || siblings(clique_[i], clique_[j])) continue;
        const std::uint32_t e = find(clique_[i], clique_[j]);
        if (covered_[e] != 1) fresh_.push_back(e);
      }
    }
    steps_ += clique_.size() * clique_.size();
    const std::size_t count = fresh_.size() / 2;
    if (count >= 2) {
      for (const std::uint32_t e : fresh_) covered_[e] = 1;
    }
    return count;
  }

  std::vector<VariableValue> nodes_;  // sorted
  std::vector<Edge> edges_;
  std::vector<std::uint32_t> start_, neighbour_;  // sorted adjacency
  std::vector<std::uint8_t> covered_;             // by position in neighbour_: 0 no, 1 yes, 2 tried in vain
  std::vector<std::uint32_t> candidates_, clique_, fresh_;
  std::uint64_t steps_ = 0;
};

}  // namespace

AtMostOne find_at_most_one(const GroundNetwork& network, std::span<const std::uint32_t> constraints) {
  return CliqueCover(network, constraints).run();
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
