#include "inference/sample_sat.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

namespace sherlog {
namespace {

constexpr double kAnnealingShare = 0.1;  // of the moves; the rest are WalkSAT's
constexpr double kNoise = 0.3;           // share of WalkSAT's moves that are random among the repairs
constexpr double kTemperature = 0.3;     // in broken demands

struct Move {
  VariableId variable;
  std::uint32_t value;
};

class Search {
 public:
  Search(World& world, Rng& rng, std::span<const VariableId> variables)
      : world_(world), rng_(rng), network_(world.index().network()), variables_(variables) {}

  bool run(std::uint64_t max_flips, const StopCondition* stop) {
    for (std::uint64_t flip = 0; !world_.broken().empty(); ++flip) {
      if (flip >= max_flips || (stop != nullptr && (flip & 1023u) == 1023u && stop->reached())) return false;
      if (rng_.uniform() < kAnnealingShare) {
        anneal();
      } else {
        walk();
      }
    }
    return true;
  }

 private:
  // A Metropolis move of a random variable on the number of broken demands.
  void anneal() {
    const VariableId v = variables_[rng_.below(static_cast<std::uint32_t>(variables_.size()))];
    const std::uint32_t before = world_.value(v);
    const double broken = static_cast<double>(world_.broken().size());
    world_.set(v, rng_.below(network_.value_count(v)));
    const double change = static_cast<double>(world_.broken().size()) - broken;
    if (change > 0 && rng_.uniform() >= std::exp(-change / kTemperature)) world_.set(v, before);
  }

  void walk() {
    const auto broken = world_.broken();
    const std::uint32_t node = broken[rng_.below(static_cast<std::uint32_t>(broken.size()))];
    moves_.clear();
    collect(node, !world_.is_true(node));
    if (moves_.empty()) return;
    Move best = moves_[rng_.below(static_cast<std::uint32_t>(moves_.size()))];
    if (rng_.uniform() >= kNoise) {
      std::size_t fewest = SIZE_MAX;
      std::uint32_t ties = 0;
      for (const Move& move : moves_) {
        const std::uint32_t before = world_.value(move.variable);
        world_.set(move.variable, move.value);
        const std::size_t broken_then = world_.broken().size();
        world_.set(move.variable, before);
        if (broken_then < fewest) ties = 0;
        if (broken_then <= fewest && rng_.below(++ties) == 0) best = move;
        fewest = std::min(fewest, broken_then);
      }
    }
    world_.set(best.variable, best.value);
  }

  // The single changes that bring the node nearer to `wanted`, which it is not.
  void collect(std::uint32_t node, bool wanted) {
    const std::uint32_t atoms = world_.index().atom_count();
    if (node < atoms) {
      const VariableId v = network_.variable_of(AtomId(node));
      if (wanted) {
        moves_.push_back({v, network_.value_of(AtomId(node))});
        return;
      }
      for (std::uint32_t value = 0; value < network_.value_count(v); ++value) {
        if (value != world_.value(v)) moves_.push_back({v, value});
      }
      return;
    }
    const GateId gate(node - atoms);
    for (Literal input : network_.gate_inputs(gate)) {
      const bool truth = world_.is_true(input);
      bool may_help = true;
      switch (network_.gate_kind(gate)) {
        case GateKind::kOr:
          may_help = truth != wanted;
          break;
        case GateKind::kIff:
          break;
        case GateKind::kAtMostOne:
          may_help = truth == wanted;
          break;
      }
      const std::uint32_t below = world_.index().node(input);
      if (may_help) collect(below, !world_.is_true(below));
    }
  }

  World& world_;
  Rng& rng_;
  const GroundNetwork& network_;
  std::span<const VariableId> variables_;
  std::vector<Move> moves_;
};

}  // namespace

bool sample_sat(World& world, Rng& rng, std::span<const VariableId> variables, std::uint64_t max_flips,
                const StopCondition* stop) {
  return Search(world, rng, variables).run(max_flips, stop);
}

}  // namespace sherlog
