#include "inference/matching_weights.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace sherlog {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kMostWeight = 0x1p14;  // beyond this in size, sums of weights could compete with kForced

// Enumerates the joint values of one cluster.
class ClusterSum {
 public:
  ClusterSum(const GroundNetwork& network, const MatchingStructure& structure, std::span<const double> atom_bias)
      : network_(network), structure_(structure), bias_(atom_bias), values_(network.variable_count(), 0) {}

  ClusterStates run(const MatchingCluster& cluster, bool maximise) {
    ClusterStates states(state_count(cluster));
    worlds_.clear();
    for_each_world(cluster, [&](std::size_t number) {
      const double score = score_of(cluster);
      worlds_.push_back(score);
      ClusterState& state = states[number];
      if (score <= state.log_weight) return;
      state.log_weight = score;
      if (!maximise) return;
      state.best.clear();
      for (VariableId v : cluster.variables) state.best.push_back(values_[v.index()]);
    });
    if (!maximise) sum(cluster, states);
    return states;
  }

 private:
  std::size_t state_count(const MatchingCluster& cluster) const {
    if (cluster.group != kNoGroup) return structure_.groups[cluster.group].states.size();
    return 1 + static_cast<std::size_t>(std::ranges::count(structure_.cells[cluster.cell].on, true));
  }

  // log_weight is the largest score so far.
  void sum(const MatchingCluster& cluster, ClusterStates& states) {
    total_.assign(states.size(), 0.0);
    for (ClusterState& s : states) s.probability.assign(cluster.queries.size(), 0.0);
    std::size_t world = 0;
    for_each_world(cluster, [&](std::size_t number) {
      const double score = worlds_[world++];
      if (score == -kInfinity) return;
      const double weight = std::exp(score - states[number].log_weight);
      total_[number] += weight;
      for (std::size_t q = 0; q < cluster.queries.size(); ++q) {
        if (is_true(network_.queries()[cluster.queries[q]].literal)) states[number].probability[q] += weight;
      }
    });
    for (std::size_t number = 0; number < states.size(); ++number) {
      if (total_[number] == 0) continue;
      states[number].log_weight += std::log(total_[number]);
      for (double& p : states[number].probability) p /= total_[number];
    }
  }

  // Calls f(state) for each joint value of the cluster in each of its states.
  template <class F>
  void for_each_world(const MatchingCluster& cluster, const F& f) {
    if (cluster.cell != kNoGroup) {
      const MatchingCell& cell = structure_.cells[cluster.cell];
      state_of_.clear();
      std::size_t on = 0;
      for (const bool is_on : cell.on) state_of_.push_back(is_on ? ++on : 0);
      for_each_value(cluster, [&] { f(state_of_[values_[cell.anchor.index()]]); });
      return;
    }
    const std::vector<std::uint64_t>& states = structure_.groups[cluster.group].states;
    for (std::size_t s = 0; s < states.size(); ++s) {
      true_bits_ = states[s];
      for_each_value(cluster, [&] { f(s); });
    }
  }

  template <class F>
  void for_each_value(const MatchingCluster& cluster, const F& f) {
    for (VariableId v : cluster.variables) values_[v.index()] = 0;
    for (std::size_t i = 0; i < cluster.variables.size() || i == 0;) {
      f();
      for (i = 0; i < cluster.variables.size(); ++i) {
        const VariableId v = cluster.variables[i];
        if (++values_[v.index()] < network_.value_count(v)) break;
        values_[v.index()] = 0;
      }
      if (i == cluster.variables.size()) return;
    }
  }

  double score_of(const MatchingCluster& cluster) const {
    for (std::uint32_t c : cluster.constraints) {
      if (!is_true(network_.constraints()[c].literal)) return -kInfinity;
    }
    double score = 0;
    for (std::uint32_t f : cluster.features) {
      const Feature& feature = network_.features()[f];
      if (is_true(feature.literal)) score += feature.weight;
    }
    if (bias_.empty()) return score;
    for (VariableId v : cluster.variables) {
      const std::uint32_t value = values_[v.index()];
      if (value < network_.candidate_count(v)) score += bias_[network_.first_atom(v).index() + value];
    }
    return score;
  }

  bool is_true(Literal literal) const {
    if (literal.is_constant()) return literal == Literal::constant(true);
    if (literal.is_atom()) {
      return (values_[network_.variable_of(literal.atom()).index()] == network_.value_of(literal.atom())) !=
             literal.negated();
    }
    const GateId gate = literal.gate();
    const bool grouped = structure_.group_of_gate[gate.index()] != kNoGroup;
    std::uint32_t count =
        grouped ? static_cast<std::uint32_t>((true_bits_ >> structure_.bit_of_gate[gate.index()]) & 1u) : 0u;
    for (Literal input : network_.gate_inputs(gate)) {
      if (grouped && structure_.speaks_of_cells(network_, input)) continue;  // the bit speaks for it
      count += is_true(input) ? 1u : 0u;
    }
    return gate_truth(network_.gate_kind(gate), count) != literal.negated();
  }

  const GroundNetwork& network_;
  const MatchingStructure& structure_;
  std::span<const double> bias_;
  std::vector<std::uint32_t> values_;  // by variable of the network
  std::vector<double> worlds_;         // scores, in the order of the enumeration
  std::vector<double> total_;          // by state
  std::vector<std::size_t> state_of_;  // by value of a cell's anchor
  std::uint64_t true_bits_ = 0;        // of the row's or column's disjunctions
};

class Weigher {
 public:
  Weigher(const GroundNetwork& network, const MatchingStructure& structure, std::span<const double> atom_bias)
      : structure_(structure), sums_(network, structure, atom_bias) {}

  WeightedMatching run(bool maximise) {
    out_.log_weights.assign(std::size_t{structure_.rows} * structure_.columns, -kInfinity);
    out_.value_weight.resize(structure_.cells.size());
    row_.assign(structure_.rows, {});
    column_.assign(structure_.columns, {});
    for (const MatchingCluster& cluster : structure_.clusters) {
      out_.states.push_back(sums_.run(cluster, maximise));
      std::vector<double> changes = weigh(out_.states.back());
      if (out_.termination != Termination::kCompleted) return std::move(out_);
      if (cluster.group != kNoGroup) {
        const MatchingGroup& group = structure_.groups[cluster.group];
        (group.is_row ? row_ : column_)[group.number] = std::move(changes);
      } else {
        out_.value_weight[cluster.cell].assign(changes.begin() + 1, changes.end());
      }
    }
    for (std::size_t c = 0; c < structure_.cells.size(); ++c) weigh_cell(c, maximise);
    return std::move(out_);
  }

 private:
  // What each state adds to being off; what being off weighs goes to log_base.
  std::vector<double> weigh(const ClusterStates& states) {
    const double off = states[0].log_weight;
    double most = -kInfinity;
    for (std::size_t s = 1; s < states.size(); ++s) most = std::max(most, states[s].log_weight);
    const bool forced = off == -kInfinity;
    const double base = forced ? most : off;
    std::vector<double> changes;
    if (base == -kInfinity) return stop(Termination::kNoPossibleWorld, "");
    out_.log_base += base;
    out_.forced += forced ? 1 : 0;
    for (const ClusterState& state : states) {
      const double change = state.log_weight - base;
      if (change != -kInfinity && std::abs(change) > kMostWeight) {
        return stop(Termination::kRefused, "its weights are too large for a matching");
      }
      changes.push_back(forced ? change + kForced : change);
    }
    return changes;
  }

  // A cell with what its on-values make of its row and column.
  void weigh_cell(std::size_t number, bool maximise) {
    const MatchingCell& cell = structure_.cells[number];
    std::vector<double>& weights = out_.value_weight[number];
    double most = -kInfinity;
    std::size_t on = 0;
    for (std::size_t value = 0; value < cell.on.size(); ++value) {
      if (!cell.on[value]) continue;
      double& weight = weights[on++];
      weight += of(row_[cell.row], cell.row_state[value]) + of(column_[cell.column], cell.column_state[value]);
      most = std::max(most, weight);
    }
    double sum = 0;
    for (const double weight : weights) sum += most == -kInfinity ? 0.0 : std::exp(weight - most);
    out_.log_weights[std::size_t{cell.row} * structure_.columns + cell.column] =
        maximise || most == -kInfinity ? most : most + std::log(sum);
  }

  // Rows that nobody asks about weigh nothing.
  static double of(const std::vector<double>& changes, std::uint32_t state) {
    return changes.empty() ? 0.0 : changes[state];
  }

  std::vector<double> stop(Termination termination, std::string message) {
    out_.termination = termination;
    out_.message = std::move(message);
    return {};
  }

  const MatchingStructure& structure_;
  ClusterSum sums_;
  std::vector<std::vector<double>> row_, column_;  // by state
  WeightedMatching out_;
};

}  // namespace

WeightedMatching weigh_matching(const GroundNetwork& network, const MatchingStructure& structure,
                                std::span<const double> atom_bias, bool maximise) {
  return Weigher(network, structure, atom_bias).run(maximise);
}

}  // namespace sherlog
