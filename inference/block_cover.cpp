#include "inference/block_cover.h"

#include <algorithm>
#include <numeric>
#include <queue>
#include <unordered_map>

namespace sherlog {
namespace {

// A gate with more inputs than this ties its variables too loosely to say who belongs together.
constexpr std::size_t kTightGate = 16;
constexpr std::size_t kLongGate = 5, kLongestGateInFull = 4096;
constexpr std::size_t kMostTies = 256;
constexpr std::uint32_t kMostSteps = 4096;  // through gates around one variable
constexpr std::uint32_t kVariablesPerStopCheck = 1024;
// Builds of blocks, in gates above their variables, for each use of an atom of the component.
constexpr double kBuildsPerUse = 200.0;

class Grower {
 public:
  Grower(const WorldIndex& index, std::span<const VariableId> variables, std::span<const std::uint32_t> numbers,
         double budget, const StopCondition& stop, const BlockCoverOptions& options)
      : index_(index),
        network_(index.network()),
        variables_(variables),
        local_(numbers),
        budget_(budget),
        stop_(stop),
        options_(options) {
    tie_.assign(variables_.size(), 0.0f);
    taken_.assign(variables_.size(), false);
    find_neighbours();
  }

  // The work is done, or has become too much.
  bool exhausted() const { return budget_ <= 0.0 || stop_.reached(); }

  // The block around `start` as large as it may be; its variables in the order of joining.
  std::optional<JointBlock> grow(std::vector<VariableId> start) {
    const std::vector<VariableId> order = order_around(std::move(start));
    std::optional<JointBlock> best;
    std::size_t good = 0, bad = order.size() + 1;
    for (std::size_t size = std::min<std::size_t>(order.size(), 12); good + 1 < bad;) {
      const auto members = std::span(order).first(size);
      auto block = JointBlock::make(index_, members, options_.block_cost, &stop_);
      budget_ -= uses_of(members);
      if (block) {
        best = std::move(block);
        good = size;
        if (size == order.size()) break;
        size = bad <= order.size() ? (good + bad) / 2 : std::min(order.size(), size * 2);
      } else {
        bad = size;
        size = (good + bad) / 2;
        if (bad - good <= 1 + good / 6) break;
      }
    }
    return best;
  }

  std::uint32_t local(VariableId v) const { return local_[v.index()]; }

  // Variables of the atoms below a gate (not through further gates).
  std::vector<VariableId> variables_of(std::uint32_t gate) const {
    std::vector<VariableId> result;
    for (Literal input : network_.gate_inputs(GateId(gate))) {
      if (input.is_atom() && local(network_.variable_of(input.atom())) != kNoNumber) {
        result.push_back(network_.variable_of(input.atom()));
      }
    }
    std::ranges::sort(result);
    result.erase(std::unique(result.begin(), result.end()), result.end());
    return result;
  }

 private:
  // What a build looks at: gates right above the variables, but no more than it does before it gives up.
  double uses_of(std::span<const VariableId> members) const {
    double uses = static_cast<double>(members.size());
    for (VariableId v : members) {
      for (std::uint32_t c = 0; c < network_.candidate_count(v); ++c)
        uses += static_cast<double>(index_.uses(network_.first_atom(v).value + c).size());
    }
    return std::min(uses, options_.block_cost);
  }

  struct Neighbour {
    std::uint32_t variable;
    float tie;
  };

  void find_neighbours() {
    neighbour_start_.assign(variables_.size() + 1, 0);
    std::unordered_map<std::uint32_t, float> ties;
    std::vector<std::uint32_t> below;
    for (std::uint32_t i = 0; i < variables_.size(); ++i) {
      neighbour_start_[i + 1] = neighbour_start_[i];
      if (i % kVariablesPerStopCheck == kVariablesPerStopCheck - 1 && stop_.reached()) budget_ = 0.0;
      if (budget_ <= 0.0) continue;
      ties.clear();
      steps_ = 0;
      const VariableId v = variables_[i];
      for (std::uint32_t c = 0; c < network_.candidate_count(v); ++c) climb(network_.first_atom(v).value + c, i, ties);
      for (const auto& [variable, tie] : ties) neighbours_.push_back({variable, tie});
      std::sort(neighbours_.begin() + neighbour_start_[i], neighbours_.end(),
                [](const Neighbour& a, const Neighbour& b) { return a.variable < b.variable; });
      neighbour_start_[i + 1] = static_cast<std::uint32_t>(neighbours_.size());
    }
  }

  void climb(std::uint32_t node, std::uint32_t self, std::unordered_map<std::uint32_t, float>& ties) {
    for (const WorldIndex::Use& use : index_.uses(node)) {
      if (++steps_ > kMostSteps) return;
      const auto inputs = network_.gate_inputs(GateId(use.gate));
      if (inputs.size() > kTightGate) continue;  // nor do those above it say much
      descend(use.gate, self, 1.0f / static_cast<float>(inputs.size()), ties);
      if (ties.size() > kMostTies) return;
      climb(index_.gate_node(use.gate), self, ties);
    }
  }

  void descend(std::uint32_t gate, std::uint32_t self, float tie,
               std::unordered_map<std::uint32_t, float>& ties) const {
    for (Literal input : network_.gate_inputs(GateId(gate))) {
      if (input.is_gate()) {
        if (network_.gate_inputs(input.gate()).size() <= kTightGate) descend(input.gate().value, self, tie, ties);
        continue;
      }
      const std::uint32_t other = local_[network_.variable_of(input.atom()).index()];
      if (other != self && other != kNoNumber) ties[other] += tie;
    }
  }

  std::vector<VariableId> order_around(std::vector<VariableId> order) {
    touched_.clear();
    std::priority_queue<std::pair<float, std::uint32_t>> next;
    const auto take = [&](std::uint32_t v) {
      taken_[v] = true;
      touched_.push_back(v);
      for (std::uint32_t i = neighbour_start_[v]; i < neighbour_start_[v + 1]; ++i) {
        const Neighbour& n = neighbours_[i];
        if (taken_[n.variable]) continue;
        tie_[n.variable] += n.tie;
        touched_.push_back(n.variable);
        // Few ties outside: a leaf costs nothing and belongs to its stem.
        const auto degree = static_cast<float>(neighbour_start_[n.variable + 1] - neighbour_start_[n.variable]);
        next.push({tie_[n.variable] / degree, ~n.variable});
      }
    };
    for (VariableId v : order) take(local(v));
    while (!next.empty() && order.size() < options_.block_variables) {
      const std::uint32_t v = ~next.top().second;
      next.pop();
      if (taken_[v]) continue;
      take(v);
      order.push_back(variables_[v]);
    }
    for (std::uint32_t v : touched_) {
      tie_[v] = 0.0f;
      taken_[v] = false;
    }
    return order;
  }

  const WorldIndex& index_;
  const GroundNetwork& network_;
  std::span<const VariableId> variables_;
  std::span<const std::uint32_t> local_;
  double budget_;
  const StopCondition& stop_;
  const BlockCoverOptions& options_;
  std::vector<std::uint32_t> neighbour_start_;
  std::vector<Neighbour> neighbours_;
  std::vector<float> tie_;   // of one order, 0 between two
  std::vector<bool> taken_;  // likewise
  std::vector<std::uint32_t> touched_;
  std::uint32_t steps_ = 0;
};

}  // namespace

BlockCover cover_component(const WorldIndex& index, std::span<const VariableId> variables,
                           std::span<const std::uint32_t> numbers, std::uint64_t seed, const StopCondition& stop,
                           const BlockCoverOptions& options) {
  BlockCover cover;
  double uses = 0.0, atoms = 0.0;
  for (VariableId v : variables) {
    for (std::uint32_t i = 0; i < index.network().candidate_count(v); ++i) {
      uses += static_cast<double>(index.uses(index.network().first_atom(v).value + i).size());
    }
    atoms += index.network().candidate_count(v);
  }
  if (uses > options.most_uses * atoms) return cover;
  const double whole_cost =
      std::max(options.whole_cost, options.whole_cost_of_variable * static_cast<double>(variables.size()));
  if (auto whole = JointBlock::make(index, variables, whole_cost, &stop)) {
    cover.blocks.push_back(std::move(*whole));
    cover.whole = true;
    return cover;
  }
  if (stop.reached()) return cover;
  Grower grower(index, variables, numbers, kBuildsPerUse * (uses + atoms), stop, options);
  const GroundNetwork& network = index.network();
  // Long gates first: their variables move together or hardly at all.
  std::vector<std::uint32_t> long_gates;
  for (VariableId v : variables) {
    for (std::uint32_t c = 0; c < network.candidate_count(v); ++c) {
      for (const WorldIndex::Use& use : index.uses(network.first_atom(v).value + c)) {
        if (network.gate_inputs(GateId(use.gate)).size() >= kLongGate) long_gates.push_back(use.gate);
      }
    }
  }
  std::ranges::sort(long_gates);
  long_gates.erase(std::unique(long_gates.begin(), long_gates.end()), long_gates.end());
  std::vector<std::vector<VariableId>> seen;
  for (std::uint32_t gate : long_gates) {
    if (network.gate_inputs(GateId(gate)).size() > kLongestGateInFull) continue;
    std::vector<VariableId> start = grower.variables_of(gate);
    if (start.size() < kLongGate || start.size() > options.block_variables ||
        std::ranges::find(seen, start) != seen.end())
      continue;
    if (grower.exhausted()) return cover;
    if (auto block = grower.grow(start)) cover.blocks.push_back(std::move(*block));
    seen.push_back(std::move(start));
    if (seen.size() >= 256) break;  // comparing all with all is quadratic
  }
  Rng rng(seed, 0xb10c);
  std::vector<std::uint32_t> order(variables.size());
  std::iota(order.begin(), order.end(), 0u);
  for (std::uint32_t round = 0; round < options.covers; ++round) {
    for (std::size_t i = order.size(); i > 1; --i)
      std::swap(order[i - 1], order[rng.below(static_cast<std::uint32_t>(i))]);
    std::vector<bool> covered(variables.size(), false);
    for (std::uint32_t v : order) {
      if (covered[v]) continue;
      if (grower.exhausted()) return cover;
      covered[v] = true;
      auto block = grower.grow({variables[v]});
      if (!block) continue;
      for (VariableId member : block->variables()) covered[grower.local(member)] = true;
      if (block->variables().size() > 1) cover.blocks.push_back(std::move(*block));
    }
  }
  return cover;
}

}  // namespace sherlog
