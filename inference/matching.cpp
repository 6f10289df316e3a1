#include "inference/matching.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "inference/assignment.h"
#include "inference/conflict.h"
#include "inference/exact.h"
#include "inference/matching_sampler.h"
#include "inference/matching_sum.h"
#include "inference/matching_weights.h"

namespace sherlog {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kMostTableLog2 = 24.0;  // entries of the sum's table: 128 MB
constexpr std::uint64_t kConflictDecisions = 100000;

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

// From the probabilities of pairs to those of the queries.
class QueryAnswers {
 public:
  // `paired`: (rows + 1) x (columns + 1), the sums of rows and columns at their ends.
  QueryAnswers(const MatchingStructure& structure, const WeightedMatching& weighted, std::vector<Marginal> paired)
      : structure_(structure), weighted_(weighted), paired_(std::move(paired)) {
    for (std::size_t c = 0; c < structure.cells.size(); ++c) {
      const MatchingCell& cell = structure.cells[c];
      const double whole = weighted.log_weights[std::size_t{cell.row} * structure.columns + cell.column];
      share_.emplace_back();
      for (const double weight : weighted.value_weight[c]) {
        share_.back().push_back(whole == -kInfinity ? 0.0 : std::exp(weight - whole));
      }
    }
  }

  void answer(std::size_t number, std::vector<Marginal>& marginals) const {
    const MatchingCluster& cluster = structure_.clusters[number];
    for (std::size_t q = 0; q < cluster.queries.size(); ++q) {
      marginals[cluster.queries[q]] = cluster.group != kNoGroup ? of_group(number, q) : of_cell(number, q);
    }
  }

 private:
  const Marginal& at(std::size_t row, std::size_t column) const {
    return paired_[row * (std::size_t{structure_.columns} + 1) + column];
  }
  double answer_in(std::size_t cluster, std::size_t state, std::size_t query) const {
    return weighted_.states[cluster][state].probability[query];
  }

  // A mixture of the answers with the pair on, in each of its values, and off.
  Marginal of_cell(std::size_t number, std::size_t query) const {
    const std::uint32_t c = structure_.clusters[number].cell;
    const double off = answer_in(number, 0, query);
    double on = 0;
    for (std::size_t v = 0; v < share_[c].size(); ++v) on += share_[c][v] * answer_in(number, v + 1, query);
    Marginal m = at(structure_.cells[c].row, structure_.cells[c].column);
    if (m.mcse) *m.mcse *= std::abs(on - off);
    m.probability = std::clamp(m.probability * on + (1 - m.probability) * off, 0.0, 1.0);
    return m;
  }

  // The same for a row or column: each of its cells brings it into states of its own.
  Marginal of_group(std::size_t number, std::size_t query) const {
    const MatchingGroup& group = structure_.groups[structure_.clusters[number].group];
    const Marginal& whole = group.is_row ? at(group.number, structure_.columns) : at(structure_.rows, group.number);
    const double off = answer_in(number, 0, query);
    double change = 0, on = 0;
    std::vector<double> change_by(group.cells.size(), 0.0);
    for (std::size_t i = 0; i < group.cells.size(); ++i) {
      const MatchingCell& cell = structure_.cells[group.cells[i]];
      const double p = at(cell.row, cell.column).probability;
      std::size_t v = 0;
      for (std::size_t value = 0; value < cell.on.size(); ++value) {
        if (!cell.on[value]) continue;
        const std::uint32_t state = (group.is_row ? cell.row_state : cell.column_state)[value];
        change_by[i] += share_[group.cells[i]][v++] * (answer_in(number, state, query) - off);
      }
      change += p * change_by[i];
      on += p;
    }
    Marginal m = whole;
    m.probability = std::clamp(off + change, 0.0, 1.0);
    if (m.mcse) m.mcse = error_of(group, whole, on > 0 ? change / on : 0.0, change_by);
    return m;
  }

  // The error of the row as a whole where all its cells say the same; what they differ by comes on top.
  double error_of(const MatchingGroup& group, const Marginal& whole, double mean,
                  const std::vector<double>& change_by) const {
    double error = *whole.mcse * std::abs(mean);
    for (std::size_t i = 0; i < group.cells.size(); ++i) {
      const MatchingCell& cell = structure_.cells[group.cells[i]];
      error += at(cell.row, cell.column).mcse.value_or(0.0) * std::abs(change_by[i] - mean);
    }
    return error;
  }

  const MatchingStructure& structure_;
  const WeightedMatching& weighted_;
  std::vector<Marginal> paired_;
  std::vector<std::vector<double>> share_;  // by cell and on-value: its share where the pair is on
};

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
  const WeightedMatching weighted = weigh_matching(context.network, structure, context.atom_bias, false);
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
    if (context.stop.reached() &&
        sampled.samples + std::uint64_t{25} * context.options.chains < context.options.samples) {
      out.termination = context.stop.reason();
      out.message = "fewer draws than asked for";
    }
    paired = std::move(sampled.paired);
  }
  const QueryAnswers answers(structure, weighted, std::move(paired));
  for (std::size_t c = 0; c < structure.clusters.size(); ++c) answers.answer(c, marginals);
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
  const WeightedMatching weighted = weigh_matching(network, structure, atom_bias, true);
  if (weighted.termination != Termination::kCompleted) return std::nullopt;
  const Assignment best = assignment_of(weighted, structure);
  if (!all_forced(best.gain, weighted.forced)) return std::nullopt;
  const bool turned = structure.rows > structure.columns;
  // The states of all cells, rows and columns in the best matching.
  std::vector<std::uint32_t> cell_state(structure.cells.size(), 0);
  std::vector<std::uint32_t> row_state(structure.rows, 0), column_state(structure.columns, 0);
  for (std::size_t i = 0; i < structure.cells.size(); ++i) {
    const MatchingCell& cell = structure.cells[i];
    const std::size_t r = turned ? cell.column : cell.row, c = turned ? cell.row : cell.column;
    if (best.column_of[r] != c) continue;
    const std::vector<double>& weights = weighted.value_weight[i];
    const auto chosen = static_cast<std::uint32_t>(std::ranges::max_element(weights) - weights.begin());
    cell_state[i] = chosen + 1;
    std::size_t value = 0;
    for (std::uint32_t on = 0; !cell.on[value] || on++ != chosen;) ++value;
    row_state[cell.row] = cell.row_state[value];
    column_state[cell.column] = cell.column_state[value];
  }
  MatchingOptimum out;
  for (std::size_t c = 0; c < structure.clusters.size(); ++c) {
    const MatchingCluster& cluster = structure.clusters[c];
    std::uint32_t number = 0;
    if (cluster.group != kNoGroup) {
      const MatchingGroup& group = structure.groups[cluster.group];
      number = (group.is_row ? row_state : column_state)[group.number];
    } else {
      number = cell_state[cluster.cell];
    }
    const ClusterState& state = weighted.states[c][number];
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
