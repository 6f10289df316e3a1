#include "inference/query_entropy.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

namespace sherlog {
namespace {

double entropy_term(double p) { return p > 0.0 ? -p * std::log(p) : 0.0; }

// The probability of each value, from the marginals of its atoms that stand at queries first, first + 1, ...
double variable_entropy(const GroundNetwork& network, VariableId v, const std::vector<Marginal>& marginals,
                        std::size_t first) {
  double entropy = 0.0, none = 1.0;
  for (std::uint32_t i = 0; i < network.candidate_count(v); ++i) {
    const double p = marginals[first + i].probability;
    entropy += entropy_term(p);
    none -= p;
  }
  return network.has_none(v) ? entropy + entropy_term(none) : entropy;
}

// log Z with every weight times `scale`, or NaN.
double log_partition(const GroundNetwork& network, double scale, const InferenceOptions& options, Monitor& monitor) {
  NetworkBuilder builder(network);
  for (const Feature& feature : builder.take_features()) {
    builder.add_feature(feature.literal, feature.weight * scale, feature.weight_id);
  }
  const InferenceResult result = infer(builder.build(), options, monitor);
  const bool good = result.termination == Termination::kCompleted && result.log_partition;
  return good ? *result.log_partition : std::numeric_limits<double>::quiet_NaN();
}

std::optional<double> joint_entropy(const GroundNetwork& network, const InferenceOptions& options, Monitor& monitor) {
  const auto difference = [&](double step) {
    return (log_partition(network, 1 + step, options, monitor) - log_partition(network, 1 - step, options, monitor)) /
           (2 * step);
  };
  constexpr double kStep = 4e-4;
  const double slope = (4 * difference(kStep / 2) - difference(kStep)) / 3;
  const double constant = network.constant_score() + network.free_log_count();
  const double entropy = log_partition(network, 1, options, monitor) - constant - slope;
  if (std::isnan(entropy)) return std::nullopt;
  return std::max(0.0, entropy);
}

}  // namespace

QueryEntropy query_entropy(const GroundNetwork& network, const InferenceOptions& options, Monitor& monitor) {
  QueryEntropy entropy;
  std::vector<VariableId> queried;
  for (const QueryTarget& target : network.queries()) {
    if (!target.is_formula) queried.push_back(network.variable_of(target.literal.atom()));
  }
  std::sort(queried.begin(), queried.end());
  queried.erase(std::unique(queried.begin(), queried.end()), queried.end());

  NetworkBuilder builder(network);
  std::vector<std::size_t> first_of_variable;
  std::size_t next = network.queries().size();
  for (const VariableId v : queried) {
    first_of_variable.push_back(next);
    for (std::uint32_t i = 0; i < network.candidate_count(v); ++i, ++next) {
      builder.add_query({Literal::atom(AtomId(network.first_atom(v).value + i)), false, ""});
    }
  }
  entropy.result = infer(builder.build(), options, monitor);
  entropy.termination = entropy.result.termination;
  entropy.message = entropy.result.message;
  const auto& marginals = entropy.result.marginals;
  if (entropy.termination != Termination::kCompleted) return entropy;
  if (marginals.size() < next) {
    entropy.termination = Termination::kRefused;
    entropy.message = "this method finds no marginal probabilities: use exact, mcsat or gibbs";
    return entropy;
  }
  for (std::size_t i = 0; i < queried.size(); ++i) {
    entropy.marginal += variable_entropy(network, queried[i], marginals, first_of_variable[i]);
  }
  if (queried.size() == 1) {
    entropy.joint = entropy.marginal;
  } else if (queried.size() == network.variable_count() && entropy.result.log_partition) {
    entropy.joint = joint_entropy(network, options, monitor);
  }
  return entropy;
}

}  // namespace sherlog
