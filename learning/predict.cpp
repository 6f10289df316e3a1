#include "learning/predict.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace sherlog {
namespace {

// The target's atoms as blocks (unmarked arguments) times values (marked ones).
class TargetShape {
 public:
  TargetShape(const Model& model, const Evidence& evidence, PredicateId id)
      : model_(model), evidence_(evidence), id_(id), predicate_(model.predicate(id)) {
    for (std::size_t i = 0; i < predicate_.arity(); ++i) {
      const auto size = static_cast<std::uint32_t>(evidence.domain_size(model, predicate_.domains[i]));
      const bool marked = predicate_.block != BlockKind::kNone && predicate_.marked[i];
      (marked ? marked_ : unmarked_).push_back(i);
      (marked ? marked_sizes_ : unmarked_sizes_).push_back(size);
    }
    for (const std::uint32_t size : marked_sizes_) values_ *= size;
    for (const std::uint32_t size : unmarked_sizes_) blocks_ *= size;
  }

  double block_count() const { return blocks_; }
  std::uint32_t value_count() const { return static_cast<std::uint32_t>(values_); }

  // Arguments of value `value` of block `block`, both read as mixed-radix numbers.
  void arguments(std::uint64_t block, std::uint64_t value, std::vector<ConstantIndex>& out) const {
    out.resize(predicate_.arity());
    spread(block, unmarked_, unmarked_sizes_, out);
    spread(value, marked_, marked_sizes_, out);
  }
  std::string block_name(std::uint64_t block) const {
    std::vector<ConstantIndex> all;
    arguments(block, 0, all);
    std::string name;
    for (const std::size_t i : unmarked_) {
      name += (name.empty() ? "" : ",") + evidence_.constant_name(model_, predicate_.domains[i], all[i]);
    }
    return name;
  }

 private:
  static void spread(std::uint64_t number, const std::vector<std::size_t>& positions,
                     const std::vector<std::uint32_t>& sizes, std::vector<ConstantIndex>& out) {
    for (std::size_t p = positions.size(); p-- > 0;) {
      out[positions[p]] = static_cast<ConstantIndex>(number % sizes[p]);
      number /= sizes[p];
    }
  }

  const Model& model_;
  const Evidence& evidence_;
  PredicateId id_;
  const Predicate& predicate_;
  std::vector<std::size_t> marked_, unmarked_;
  std::vector<std::uint32_t> marked_sizes_, unmarked_sizes_;
  double values_ = 1.0, blocks_ = 1.0;
};

Query all_atoms(const Model& model, PredicateId target) {
  QueryItem item;
  item.predicate = target;
  for (std::uint32_t i = 0; i < model.predicate(target).arity(); ++i) item.pattern.push_back(Term::variable(i));
  item.pattern_variables = static_cast<std::uint32_t>(item.pattern.size());
  item.text = model.predicate(target).name;
  return Query{{item}};
}

}  // namespace

std::vector<std::string> target_labels(const Model& model, PredicateId target) {
  const Predicate& predicate = model.predicate(target);
  if (predicate.block == BlockKind::kNone) return {"false", "true"};
  std::vector<std::string> labels{""};
  for (std::size_t i = 0; i < predicate.arity(); ++i) {
    if (!predicate.marked[i]) continue;
    std::vector<std::string> longer;
    for (const std::string& label : labels) {
      for (const std::string& constant : model.domain(predicate.domains[i]).constants) {
        longer.push_back(label.empty() ? constant : fmt::format("{},{}", label, constant));
      }
    }
    labels = std::move(longer);
  }
  if (predicate.block == BlockKind::kAtMostOne) labels.push_back("none");
  return labels;
}

TaskOrProblem make_prediction_task(const TrainingSet& set, std::uint32_t database, PredicateId target,
                                   const GroundingOptions& limits, Monitor& monitor) {
  const Model& model = set.model;
  const Evidence& evidence = set.databases[database];
  const TrueAtoms truth(model, evidence);
  Observation observation = observe(model, evidence, truth, opened(model, {&target, 1}), all_atoms(model, target),
                                    set.weights, limits, monitor);
  if (!observation.result) return {std::nullopt, {observation.termination, observation.message}};

  PredictionTask task;
  task.database = database;
  task.boolean = model.predicate(target).block == BlockKind::kNone;
  task.has_none = model.predicate(target).block == BlockKind::kAtMostOne;
  task.observed = std::move(*observation.result);
  const GroundNetwork& network = task.observed.network;
  TupleTable query_atoms(model.predicate(target).arity());  // query numbers are in order of insertion
  for (const QueryTarget& query : network.queries()) query_atoms.insert(network.arguments_of(query.literal.atom()));

  const TargetShape shape(model, evidence, target);
  const BlockKind kind = model.predicate(target).block;
  const std::uint32_t values = kind == BlockKind::kNone ? 1 : shape.value_count();
  std::vector<ConstantIndex> arguments;
  for (std::uint64_t b = 0; static_cast<double>(b) < shape.block_count(); ++b) {
    PredictionTask::Example example;
    example.name = shape.block_name(b);
    std::uint32_t first_true = values;
    for (std::uint32_t v = 0; v < values; ++v) {
      shape.arguments(b, v, arguments);
      if (first_true == values && truth.contains(target, arguments)) first_true = v;
      const std::uint32_t query = query_atoms.find(arguments);
      example.queries.push_back(query == TupleTable::kNone ? PredictionTask::kNone : query);
      // Not asked, so decided: by a hard formula or because there is but one value.
      example.given.push_back(truth.contains(target, arguments) ? 1.0 : 0.0);
    }
    example.truth = kind == BlockKind::kNone ? (first_true == 0 ? 1u : 0u) : first_true;
    task.examples.push_back(std::move(example));
  }
  return {std::move(task), {}};
}

TrainingProblem predict(const PredictionTask& task, std::span<const double> weights, const InferenceOptions& options,
                        Monitor& monitor, std::vector<Prediction>& predictions) {
  std::vector<double> by_id;
  for (const std::uint32_t weight : task.observed.weight_of) by_id.push_back(weights[weight]);
  const GroundNetwork network = reweighted(task.observed.network, by_id);
  const InferenceResult result = infer(network, options, monitor);
  if (result.termination != Termination::kCompleted) return {result.termination, result.message};
  for (const PredictionTask::Example& example : task.examples) {
    Prediction prediction;
    prediction.database = task.database;
    prediction.example = example.name;
    prediction.truth = example.truth;
    double total = 0.0;
    for (std::size_t v = 0; v < example.queries.size(); ++v) {
      const double p = example.queries[v] == PredictionTask::kNone ? example.given[v]
                                                                   : result.marginals[example.queries[v]].probability;
      prediction.probabilities.push_back(p);
      total += p;
    }
    if (task.boolean) {
      const double p = prediction.probabilities[0];
      prediction.probabilities = {1.0 - p, p};
    } else if (task.has_none) {
      prediction.probabilities.push_back(std::max(0.0, 1.0 - total));
    } else if (total > 0.0) {
      for (double& p : prediction.probabilities) p /= total;  // sampled marginals may miss 1 by rounding
    }
    predictions.push_back(std::move(prediction));
  }
  return {};
}

}  // namespace sherlog
