#include "learning/training_set.h"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <thread>

#include "inference/parallel.h"
#include "mln/shared_domains.h"

namespace sherlog {

TrainingSet::TrainingSet(const Model& given, std::span<const Evidence> given_databases)
    : model(with_shared_constants(given, given_databases, shared_domains(given))),
      mentioned(mentioned_predicates(given)),
      weights(model) {
  for (const Evidence& evidence : given_databases) databases.push_back(renumbered(evidence, given, model));
}

std::vector<bool> TrainingSet::varying() const {
  std::vector<bool> result;
  for (const Predicate& predicate : model.predicates()) result.push_back(!predicate.closed);
  return result;
}

std::vector<bool> opened(const Model& model, std::span<const PredicateId> predicates) {
  std::vector<bool> open(model.predicates().size(), false);
  for (const PredicateId p : predicates) open[p.index()] = true;
  return open;
}

Observation observe_within_limits(const TrainingSet& set, const Evidence& evidence, const TrueAtoms& truth,
                                  const std::vector<bool>& open, const LearningOptions& options,
                                  const StopCondition& stop) {
  GroundingOptions limits;
  limits.max_memory = options.max_memory;
  limits.max_seconds = std::max(0.0, stop.max_seconds() - stop.seconds());
  return observe(set.model, evidence, truth, open, {}, set.weights, limits, stop.monitor());
}

std::string target_warning(const TrainingSet& set, PredicateId target) {
  std::size_t without = 0, first = 0;
  for (std::size_t d = set.databases.size(); d-- > 0;) {
    const auto& kinds = set.databases[d].of(target).kinds;
    if (std::ranges::find(kinds, EvidenceKind::kTrue) != kinds.end()) continue;
    ++without;
    first = d + 1;
  }
  if (without == 0) return "";
  return fmt::format("{} of {} databases state no true atom of '{}' (the first is number {})", without,
                     set.databases.size(), set.model.predicate(target).name, first);
}

TrainingProblem for_each_database(std::size_t count, std::uint32_t threads, const StopCondition& stop,
                                  std::string_view stage, const std::function<TrainingProblem(std::size_t)>& work,
                                  const std::function<void(std::size_t)>& collect) {
  constexpr std::size_t kBatch = 64;
  if (threads == 0) threads = std::max(1u, std::thread::hardware_concurrency());
  for (std::size_t begin = 0; begin < count; begin += kBatch) {
    const std::size_t end = std::min(count, begin + kBatch);
    std::vector<TrainingProblem> problems(end - begin);
    std::atomic<std::size_t> next{begin};
    const auto run = [&] {
      for (std::size_t d = next++; d < end; d = next++) {
        if (stop.reached()) {
          problems[d - begin] = {stop.reason(), "it was stopped while counting"};
          return;
        }
        problems[d - begin] = work(d);
      }
    };
    run_on_threads(std::min<std::size_t>(threads, end - begin), run);
    for (std::size_t d = begin; d < end; ++d) {
      TrainingProblem& problem = problems[d - begin];
      // What ends the whole run is not this database's doing.
      const bool its_own = problem.termination == Termination::kNoPossibleWorld ||
                           problem.termination == Termination::kTooWide || problem.termination == Termination::kRefused;
      if (its_own) problem.message = which_database(d, count) + problem.message;
      if (problem.termination != Termination::kCompleted) return problem;
      collect(d);
    }
    if (stop.reached()) return {stop.reason(), "it was stopped while counting"};
    stop.monitor().progress(stage, static_cast<double>(end), static_cast<double>(count));
  }
  return {};
}

}  // namespace sherlog
