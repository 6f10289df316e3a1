#include "inference/matching.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include "inference/assignment.h"
#include "inference/conflict.h"
#include "inference/exact.h"
#include "inference/matching_sampler.h"
#include "inference/matching_sum.h"

namespace sherlog {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kForced = 0x1p20;       // nats
constexpr double kMostWeight = 0x1p14;   // beyond this in size, sums of weights could compete with kForced
constexpr double kMostTableLog2 = 24.0;  // entries of the sum's table: 128 MB
constexpr std::uint64_t kConflictDecisions = 100000;

// One cluster with its pair or row on, or off.
struct ClusterState {
  double log_weight = -kInfinity;   // log of the sum, or the maximum
  std::vector<double> probability;  // sums: by query of the cluster
  std::vector<std::uint32_t> best;  // maxima: by variable of the cluster
};
using ClusterStates = std::array<ClusterState, 2>;  // off, on

// Enumerates the joint values of one cluster.
class ClusterSum {
 public:
  ClusterSum(const GroundNetwork& network, const MatchingStructure& structure, std::span<const double> atom_bias)
      : network_(network), structure_(structure), bias_(atom_bias), values_(network.variable_count(), 0) {}

  ClusterStates run(const MatchingCluster& cluster, bool maximise) {
    ClusterStates states;
    worlds_.clear();
    for_each_world(cluster, [&](std::size_t on) {
      const double score = score_of(cluster);
      worlds_.push_back(score);
      ClusterState& state = states[on];
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
  // log_weight is the largest score so far.
  void sum(const MatchingCluster& cluster, ClusterStates& states) {
    std::array<double, 2> total = {0, 0};
    for (ClusterState& s : states) s.probability.assign(cluster.queries.size(), 0.0);
    std::size_t world = 0;
    for_each_world(cluster, [&](std::size_t on) {
      const double score = worlds_[world++];
      if (score == -kInfinity) return;
      const double weight = std::exp(score - states[on].log_weight);
      total[on] += weight;
      for (std::size_t q = 0; q < cluster.queries.size(); ++q) {
        if (is_true(network_.queries()[cluster.queries[q]].literal)) states[on].probability[q] += weight;
      }
    });
    for (std::size_t on = 0; on < 2; ++on) {
      if (total[on] == 0) continue;
      states[on].log_weight += std::log(total[on]);
      for (double& p : states[on].probability) p /= total[on];
    }
  }

  // Calls f(1) with values where the pair or row is on, f(0) where it is off.
  template <class F>
  void for_each_world(const MatchingCluster& cluster, const F& f) {
    if (cluster.cell != kNoGroup) {
      const MatchingCell& cell = structure_.cells[cluster.cell];
      for_each_value(cluster, [&] { f(cell.on[values_[cell.anchor.index()]] ? 1 : 0); });
      return;
    }
    for (const bool on : {false, true}) {
      group_on_ = on;
      for_each_value(cluster, [&] { f(on ? 1 : 0); });
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
    std::uint32_t count = grouped && group_on_ ? 1 : 0;
    for (Literal input : network_.gate_inputs(gate)) {
      if (grouped && structure_.speaks_of_cells(network_, input)) continue;  // group_on_ speaks for it
      count += is_true(input) ? 1u : 0u;
    }
    return gate_truth(network_.gate_kind(gate), count) != literal.negated();
  }

  const GroundNetwork& network_;
  const MatchingStructure& structure_;
  std::span<const double> bias_;
  std::vector<std::uint32_t> values_;  // by variable of the network
  std::vector<double> worlds_;         // scores, in the order of the enumeration
  bool group_on_ = false;
};

// The component as a weighted bipartite matching.
struct WeightedMatching {
  Termination termination = Termination::kCompleted;
  std::string message;
  std::vector<ClusterStates> states;  // by cluster
  double log_base = 0.0;              // everything off
  std::vector<double> log_weights;    // rows x columns
  std::size_t forced = 0;             // each adds kForced to every matching that is possible
};

class Weigher {
 public:
  Weigher(const GroundNetwork& network, const MatchingStructure& structure, std::span<const double> atom_bias)
      : structure_(structure), sums_(network, structure, atom_bias) {}

  WeightedMatching run(bool maximise) {
    out_.log_weights.assign(std::size_t{structure_.rows} * structure_.columns, -kInfinity);
    std::vector<double> row(structure_.rows, 0.0), column(structure_.columns, 0.0);
    for (const MatchingCluster& cluster : structure_.clusters) {
      out_.states.push_back(sums_.run(cluster, maximise));
      const double change = weigh(out_.states.back());
      if (out_.termination != Termination::kCompleted) return std::move(out_);
      if (cluster.group != kNoGroup) {
        const MatchingGroup& group = structure_.groups[cluster.group];
        (group.is_row ? row : column)[group.number] += change;
      } else {
        const MatchingCell& cell = structure_.cells[cluster.cell];
        out_.log_weights[std::size_t{cell.row} * structure_.columns + cell.column] = change;
      }
    }
    for (std::size_t r = 0; r < row.size(); ++r) {
      for (std::size_t c = 0; c < column.size(); ++c) out_.log_weights[r * column.size() + c] += row[r] + column[c];
    }
    return std::move(out_);
  }

 private:
  // What being on adds; what being off weighs goes to log_base.
  double weigh(const ClusterStates& states) {
    const double off = states[0].log_weight, on = states[1].log_weight;
    if (off == -kInfinity && on == -kInfinity) return stop(Termination::kNoPossibleWorld, "");
    if (on == -kInfinity) {
      out_.log_base += off;
      return -kInfinity;
    }
    if (off == -kInfinity) {
      ++out_.forced;
      out_.log_base += on;
      return kForced;
    }
    if (std::abs(on - off) > kMostWeight)
      return stop(Termination::kRefused, "its weights are too large for a matching");
    out_.log_base += off;
    return on - off;
  }

  double stop(Termination termination, std::string message) {
    out_.termination = termination;
    out_.message = std::move(message);
    return 0;
  }

  const MatchingStructure& structure_;
  ClusterSum sums_;
  WeightedMatching out_;
};

// Whether a matching that gains so much has all that is forced.
bool all_forced(double gain, std::size_t forced) { return gain > (static_cast<double>(forced) - 0.5) * kForced; }

// The best matching; the shorter side comes first, since the Hungarian algorithm wants it so.
Assignment assignment_of(const WeightedMatching& weighted, const MatchingStructure& structure) {
  const bool turned = structure.rows > structure.columns;
  const std::size_t rows = std::min(structure.rows, structure.columns);
  const std::size_t columns = std::max(structure.rows, structure.columns);
  std::vector<double> gains(weighted.log_weights.size());
  for (std::size_t r = 0; r < rows; ++r) {
    for (std::size_t c = 0; c < columns; ++c) {
      gains[r * columns + c] = weighted.log_weights[turned ? c * rows + r : r * columns + c];
    }
  }
  return best_assignment(gains, rows, columns);
}

// P(on) of each cluster's pair or row. `paired`: (rows + 1) x (columns + 1), the sums of rows and columns at their ends.
std::vector<Marginal> probability_of_on(const MatchingStructure& structure, const std::vector<Marginal>& paired) {
  const std::size_t width = std::size_t{structure.columns} + 1;
  std::vector<Marginal> out;
  for (const MatchingCluster& cluster : structure.clusters) {
    std::size_t row = structure.rows, column = structure.columns;
    if (cluster.group != kNoGroup) {
      const MatchingGroup& group = structure.groups[cluster.group];
      (group.is_row ? row : column) = group.number;
    } else {
      row = structure.cells[cluster.cell].row;
      column = structure.cells[cluster.cell].column;
    }
    out.push_back(paired[row * width + column]);
  }
  return out;
}

std::vector<Marginal> with_sums(const MatchingSum& sum, std::size_t rows, std::size_t columns) {
  std::vector<Marginal> out((rows + 1) * (columns + 1));
  for (std::size_t r = 0; r < rows; ++r) {
    for (std::size_t c = 0; c < columns; ++c) {
      const double p = sum.paired[r * columns + c];
      out[r * (columns + 1) + c].probability = p;
      out[r * (columns + 1) + columns].probability += p;
      out[rows * (columns + 1) + c].probability += p;
    }
  }
  for (Marginal& m : out) m.probability = std::min(1.0, m.probability);
  return out;
}

struct ComponentAnswer {
  Termination termination = Termination::kCompleted;
  std::string message;
  std::optional<double> log_partition;  // where it was summed exactly
  std::uint64_t samples = 0;
};

// A mixture of the cluster's answers with its pair or row on and off.
void answer_queries(const MatchingCluster& cluster, const ClusterStates& states, const Marginal& on,
                    std::vector<Marginal>& marginals) {
  for (std::size_t q = 0; q < cluster.queries.size(); ++q) {
    Marginal& m = marginals[cluster.queries[q]];
    const double if_on = states[1].probability[q], if_off = states[0].probability[q];
    m = on;
    m.probability = std::clamp(on.probability * if_on + (1 - on.probability) * if_off, 0.0, 1.0);
    if (m.mcse) *m.mcse *= std::abs(if_on - if_off);
  }
}

bool fits(const MatchingStructure& structure, const InferenceOptions& options) {
  const double log2 = matching_sum_log2(structure.rows, structure.columns);
  return log2 <= std::min(kMostTableLog2, options.max_table_log2) &&
         8 * std::exp2(log2) <= static_cast<double>(options.max_memory);
}

ComponentAnswer answer(const MethodContext& context, const MatchingStructure& structure,
                       std::vector<Marginal>& marginals) {
  ComponentAnswer out;
  const auto stopped = [&](Termination t, std::string message) {
    out.termination = t;
    out.message = std::move(message);
    return out;
  };
  if (!structure.found()) return stopped(Termination::kRefused, structure.problem);
  const WeightedMatching weighted = Weigher(context.network, structure, context.atom_bias).run(false);
  if (weighted.termination != Termination::kCompleted) return stopped(weighted.termination, weighted.message);
  std::vector<Marginal> paired;
  if (fits(structure, context.options)) {
    const MatchingSum sum = matching_sum(weighted.log_weights, structure.rows, structure.columns, context.stop);
    if (sum.paired.size() < weighted.log_weights.size()) return stopped(context.stop.reason(), "");
    if (!all_forced(sum.log_total, weighted.forced)) return stopped(Termination::kNoPossibleWorld, "");
    paired = with_sums(sum, structure.rows, structure.columns);
    out.log_partition = weighted.log_base + (sum.log_total - kForced * static_cast<double>(weighted.forced));
  } else {
    const Assignment best = assignment_of(weighted, structure);
    if (!all_forced(best.gain, weighted.forced)) return stopped(Termination::kNoPossibleWorld, "");
    SampledMatching sampled =
        sample_matchings(weighted.log_weights, structure.rows, structure.columns, context.options, context.stop);
    out.samples = sampled.samples;
    if (sampled.paired.empty()) return stopped(context.stop.reason(), "no sweep was finished");
    if (context.stop.reached() && sampled.samples + context.options.chains * 25 < context.options.samples) {
      out.termination = context.stop.reason();
      out.message = "fewer draws than asked for";
    }
    paired = std::move(sampled.paired);
  }
  const std::vector<Marginal> on = probability_of_on(structure, paired);
  for (std::size_t c = 0; c < structure.clusters.size(); ++c) {
    answer_queries(structure.clusters[c], weighted.states[c], on[c], marginals);
  }
  return out;
}

// Which constraints of the component contradict each other.
void explain_conflict(const MethodContext& context, ComponentId component, MethodResult& result) {
  result.message = "no world meets all hard formulas";
  const auto check = check_constraints(context.network, context.network.component_constraints(component),
                                       kConflictDecisions, context.stop);
  if (check && !check->possible) result.conflict = small_conflict(context.network, check->core, context.stop);
}

}  // namespace

std::optional<MatchingStructure> quick_matching(const GroundNetwork& network, ComponentId component) {
  MatchingStructure structure = find_matching(network, component);
  if (!structure.found() || std::min(structure.rows, structure.columns) < 2) return std::nullopt;
  return structure;
}

MethodResult run_matching(const MethodContext& context, std::vector<MatchingStructure> structures) {
  MethodResult result;
  result.marginals.resize(context.network.queries().size());
  double log_partition = 0;
  bool exact = true;
  for (std::size_t i = 0; i < context.components.size(); ++i) {
    const ComponentAnswer one = answer(context, structures[i], result.marginals);
    result.samples += one.samples;
    exact = exact && one.log_partition;
    log_partition += one.log_partition.value_or(0.0);
    if (one.termination == Termination::kCompleted) continue;
    const bool partly = one.samples > 0;
    for (std::uint32_t q : context.network.component_queries(context.components[i])) {
      if (!partly) result.marginals[q].probability = kNan;
    }
    if (result.termination != Termination::kCompleted) continue;
    result.termination = one.termination;
    result.message = one.message;
    if (one.termination == Termination::kNoPossibleWorld) {
      explain_conflict(context, context.components[i], result);
      return result;
    }
    if (one.termination == Termination::kRefused) return result;
  }
  if (result.termination == Termination::kCompleted && exact) result.log_partition = log_partition;
  return result;
}

std::optional<MatchingOptimum> best_matching_world(const GroundNetwork& network, const MatchingStructure& structure,
                                                   std::span<const double> atom_bias) {
  const WeightedMatching weighted = Weigher(network, structure, atom_bias).run(true);
  if (weighted.termination != Termination::kCompleted) return std::nullopt;
  const Assignment best = assignment_of(weighted, structure);
  if (!all_forced(best.gain, weighted.forced)) return std::nullopt;
  const bool turned = structure.rows > structure.columns;
  const std::size_t rows = std::min(structure.rows, structure.columns);
  std::vector<bool> row_on(structure.rows, false), column_on(structure.columns, false);
  for (std::size_t r = 0; r < rows; ++r) {
    if (!best.column_of[r]) continue;
    (turned ? column_on : row_on)[r] = true;
    (turned ? row_on : column_on)[*best.column_of[r]] = true;
  }
  const auto is_paired = [&](const MatchingCell& cell) {
    const std::size_t r = turned ? cell.column : cell.row, c = turned ? cell.row : cell.column;
    return best.column_of[r] && *best.column_of[r] == c;
  };
  MatchingOptimum out;
  for (std::size_t c = 0; c < structure.clusters.size(); ++c) {
    const MatchingCluster& cluster = structure.clusters[c];
    bool on = false;
    if (cluster.group != kNoGroup) {
      const MatchingGroup& group = structure.groups[cluster.group];
      on = (group.is_row ? row_on : column_on)[group.number];
    } else {
      on = is_paired(structure.cells[cluster.cell]);
    }
    const ClusterState& state = weighted.states[c][on ? 1 : 0];
    out.score += state.log_weight;
    for (std::size_t v = 0; v < cluster.variables.size(); ++v) {
      out.values.emplace_back(cluster.variables[v], state.best[v]);
    }
  }
  return out;
}

MethodResult run_matching(const MethodContext& context) {
  std::vector<MatchingStructure> structures;
  std::vector<ComponentId> matchings, others;
  std::string why;
  for (ComponentId c : context.components) {
    MatchingStructure structure = find_matching(context.network, c);
    if (!structure.found()) {
      // Variables that nothing ties to others are in every network, and are no reason to refuse.
      if (why.empty() || context.network.component_variables(c).size() > 1) why = structure.problem;
      others.push_back(c);
      continue;
    }
    matchings.push_back(c);
    structures.push_back(std::move(structure));
  }
  if (matchings.empty() && !others.empty()) {
    MethodResult refused;
    refused.marginals.resize(context.network.queries().size());
    refused.termination = Termination::kRefused;
    refused.message = fmt::format("the network is no one-to-one matching: {}; 'exact' or 'mcsat' may answer", why);
    return refused;
  }
  MethodResult result = run_exact({context.network, others, context.options, context.stop, context.atom_bias});
  if (result.termination != Termination::kCompleted) return result;
  MethodResult matched = run_matching({context.network, matchings, context.options, context.stop, context.atom_bias},
                                      std::move(structures));
  for (ComponentId c : matchings) {
    for (std::uint32_t q : context.network.component_queries(c)) result.marginals[q] = matched.marginals[q];
  }
  if (!matched.log_partition) result.log_partition.reset();
  if (result.log_partition) *result.log_partition += *matched.log_partition;
  result.termination = matched.termination;
  result.message = std::move(matched.message);
  result.conflict = std::move(matched.conflict);
  result.samples = matched.samples;
  return result;
}

}  // namespace sherlog
