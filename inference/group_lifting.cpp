#include "inference/group_lifting.h"

#include <algorithm>
#include <bit>
#include <map>
#include <numeric>
#include <tuple>
#include <unordered_map>

#include "inference/at_most_one.h"

namespace sherlog {
namespace {

// Constraint cliques too small to be worth it, and how many weighted clauses there must be.
constexpr std::size_t kFewestClauses = 4;

class Lifting {
 public:
  Lifting(const GroundNetwork& network, const StopCondition* stop)
      : network_(network), stop_(stop), weight_(network.gate_count(), 0.0) {
    for (const Feature& f : network.features()) {
      if (f.literal.is_gate()) weight_[f.literal.gate().index()] += f.weight;
    }
  }

  std::optional<GroundNetwork> run() {
    if (!worth_looking()) return std::nullopt;
    find_groups();
    if (stop_ != nullptr && stop_->reached()) return std::nullopt;
    collect();
    choose();
    if (lifted_.empty()) return std::nullopt;
    return rebuild();
  }

 private:
  struct Clause {
    std::uint32_t gate;
    Literal member;  // x of A v !x
  };
  using Key = std::tuple<std::uint32_t, std::uint64_t, std::uint32_t>;  // A, bits of the weight, group
  struct Lifted {
    Literal rest;  // A
    double weight;
    std::vector<Literal> members;
  };

  bool pair_clause(std::uint32_t gate) const {
    return weight_[gate] != 0.0 && network_.gate_kind(GateId(gate)) == GateKind::kOr &&
           network_.gate_inputs(GateId(gate)).size() == 2;
  }

  bool worth_looking() const {
    if (network_.constraints().size() < 3) return false;
    std::size_t clauses = 0;
    for (std::uint32_t g = 0; g < network_.gate_count() && clauses < kFewestClauses; ++g)
      clauses += pair_clause(g) ? 1u : 0u;
    return clauses >= kFewestClauses;
  }

  void find_groups() {
    std::vector<std::uint32_t> all(network_.constraints().size());
    std::iota(all.begin(), all.end(), 0u);
    const AtMostOne found = find_at_most_one(network_, all, stop_);
    for (std::uint32_t group = 0; group < found.groups.size(); ++group) {
      for (const VariableValue& v : found.groups[group]) {
        const AtomId first = network_.first_atom(v.variable);
        const std::uint32_t candidates = network_.candidate_count(v.variable);
        if (v.value == candidates && candidates > 1) continue;  // "none" of a block is no literal
        const Literal literal =
            v.value < candidates ? Literal::atom(AtomId(first.value + v.value)) : Literal::atom(first, true);
        groups_of_[literal.code()].push_back(group);
      }
    }
  }

  void collect() {
    for (std::uint32_t g = 0; g < network_.gate_count(); ++g) {
      if (!pair_clause(g)) continue;
      const auto inputs = network_.gate_inputs(GateId(g));
      for (std::size_t i = 0; i < 2; ++i) {
        const auto found = groups_of_.find((~inputs[i]).code());
        if (found == groups_of_.end()) continue;
        for (std::uint32_t group : found->second) {
          buckets_[{inputs[1 - i].code(), std::bit_cast<std::uint64_t>(weight_[g]), group}].push_back({g, ~inputs[i]});
        }
      }
    }
  }

  // Largest first; every clause goes into one.
  void choose() {
    std::vector<const std::pair<const Key, std::vector<Clause>>*> order;
    for (const auto& bucket : buckets_) order.push_back(&bucket);
    std::ranges::stable_sort(order, [](const auto* a, const auto* b) { return a->second.size() > b->second.size(); });
    std::vector<bool> used(network_.gate_count(), false);
    for (const auto* bucket : order) {
      std::vector<Clause> clauses;
      for (const Clause& c : bucket->second) {
        if (!used[c.gate]) clauses.push_back(c);
      }
      if (clauses.size() < 2) continue;
      Lifted lifted{
          Literal::from_code(std::get<0>(bucket->first)), std::bit_cast<double>(std::get<1>(bucket->first)), {}};
      for (const Clause& c : clauses) {
        used[c.gate] = true;
        weight_[c.gate] = 0.0;
        lifted.members.push_back(c.member);
      }
      lifted_.push_back(std::move(lifted));
    }
  }

  // Every longer weighted disjunction by what it is about, whatever its brackets.
  void index_disjunctions() {
    for (std::uint32_t g = 0; g < network_.gate_count(); ++g) {
      if (weight_[g] == 0.0 || network_.gate_kind(GateId(g)) != GateKind::kOr) continue;
      std::vector<Literal> literals;
      flatten(g, literals);
      std::ranges::sort(literals);
      literals.erase(std::unique(literals.begin(), literals.end()), literals.end());
      if (literals.size() > 2) disjunctions_.emplace(std::move(literals), g);
    }
  }

  void flatten(std::uint32_t gate, std::vector<Literal>& out) const {
    for (Literal input : network_.gate_inputs(GateId(gate))) {
      if (input.is_gate() && !input.negated() && network_.gate_kind(input.gate()) == GateKind::kOr) {
        flatten(input.gate().value, out);
      } else {
        out.push_back(input);
      }
    }
  }

  GroundNetwork rebuild() {
    index_disjunctions();
    NetworkBuilder builder(network_);
    const std::vector<Feature> features = builder.take_features();
    std::vector<bool> keep(network_.gate_count(), true);
    for (const auto& [key, clauses] : buckets_) {
      for (const Clause& c : clauses) keep[c.gate] = weight_[c.gate] != 0.0;
    }
    const WeightId weight_id = features.front().weight_id;
    for (Lifted& l : lifted_) {
      std::vector<Literal> inputs = l.members;
      const Literal any = builder.make_or(inputs);
      builder.add_constant_score(l.weight * static_cast<double>(l.members.size() - 1));
      inputs = l.members;
      inputs.push_back(~l.rest);
      std::ranges::sort(inputs);
      const auto converse = disjunctions_.find(inputs);
      if (converse != disjunctions_.end() && weight_[converse->second] == l.weight) {
        weight_[converse->second] = 0.0;
        keep[converse->second] = false;
        builder.add_constant_score(l.weight);
        builder.add_feature(builder.make_iff(l.rest, any), l.weight, weight_id);
      } else {
        inputs = {l.rest, ~any};
        builder.add_feature(builder.make_or(inputs), l.weight, weight_id);
      }
    }
    for (const Feature& f : features) {
      if (f.literal.is_gate() && !keep[f.literal.gate().index()]) continue;
      builder.add_feature(f.literal, f.weight, f.weight_id);
    }
    return builder.build();
  }

  const GroundNetwork& network_;
  const StopCondition* stop_;
  std::vector<double> weight_;                                               // by gate; 0 once lifted
  std::unordered_map<std::uint32_t, std::vector<std::uint32_t>> groups_of_;  // by literal code
  std::map<Key, std::vector<Clause>> buckets_;
  std::vector<Lifted> lifted_;
  std::map<std::vector<Literal>, std::uint32_t> disjunctions_;  // sorted literals to gate
};

}  // namespace

std::optional<GroundNetwork> lift_over_groups(const GroundNetwork& network, const StopCondition* stop) {
  return Lifting(network, stop).run();
}

}  // namespace sherlog
