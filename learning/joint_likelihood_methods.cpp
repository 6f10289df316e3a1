// cll and ll: which predicates are opened together for the exact likelihood.
#include <algorithm>

#include "learning/joint_likelihood.h"
#include "learning/methods.h"

namespace sherlog {
namespace {

class PreparedJoint : public PreparedData {
 public:
  PreparedJoint(std::vector<JointParts> parts, std::unique_ptr<PreparedData> pseudo, std::size_t weight_count,
                std::uint32_t threads, const StopCondition& stop)
      : parts_(std::move(parts)),
        pseudo_(std::move(pseudo)),
        weight_count_(weight_count),
        threads_(threads),
        stop_(stop) {}

  std::unique_ptr<Objective> objective(std::span<const std::uint32_t> databases) override {
    std::vector<const JointParts*> chosen;
    for (const std::uint32_t d : databases) chosen.push_back(&parts_[d]);
    return std::make_unique<JointLikelihood>(chosen, weight_count_, threads_, stop_);
  }
  std::unique_ptr<Objective> nearby(std::span<const std::uint32_t> databases) override {
    return pseudo_ ? pseudo_->objective(databases) : nullptr;
  }

 private:
  std::vector<JointParts> parts_;         // by database
  std::unique_ptr<PreparedData> pseudo_;  // where a bounded search is easy near the optimum only
  std::size_t weight_count_;
  std::uint32_t threads_;
  StopCondition stop_;
};

PreparedOrProblem prepare(const TrainingSet& set, const std::vector<bool>& open, const LearningOptions& options,
                          const StopCondition& stop) {
  std::vector<JointPartsOrProblem> by_database(set.databases.size());
  std::vector<JointParts> all;
  TrainingProblem problem = for_each_database(
      set.databases.size(), options.threads, stop, "counting",
      [&](std::size_t d) -> TrainingProblem {
        const TrueAtoms truth(set.model, set.databases[d]);
        const Observation observation = observe_within_limits(set, set.databases[d], truth, open, options, stop);
        if (!observation.result) return {observation.termination, observation.message};
        InferenceOptions inference;
        inference.max_memory = options.max_memory;
        by_database[d] = make_joint_parts(*observation.result, inference, options.search_gap, stop);
        std::string message = by_database[d].message;
        if (by_database[d].termination == Termination::kTooWide) {
          message += options.discriminative.empty() ? "; pll needs no such sums" : "; dpll and mcsat need no such sums";
        }
        return {by_database[d].termination, std::move(message)};
      },
      [&](std::size_t d) { all.push_back(std::move(by_database[d].parts)); });
  if (problem.termination != Termination::kCompleted) return {nullptr, std::move(problem)};
  std::unique_ptr<PreparedData> pseudo;
  const bool searched = std::ranges::any_of(all, [](const JointParts& parts) {
    return std::ranges::any_of(parts.sums, [](const ComponentSum& s) { return s.way() == ComponentSum::Way::kSearch; });
  });
  if (searched) {
    PreparedOrProblem made = (options.discriminative.empty() ? prepare_pll : prepare_dpll)(set, options, true, stop);
    if (!made.data) return made;
    pseudo = std::move(made.data);
  }
  return {std::make_unique<PreparedJoint>(std::move(all), std::move(pseudo), set.weights.size(), options.threads, stop),
          {}};
}

}  // namespace

PreparedOrProblem prepare_cll(const TrainingSet& set, const LearningOptions& options, bool, const StopCondition& stop) {
  return prepare(set, opened(set.model, options.discriminative), options, stop);
}

PreparedOrProblem prepare_ll(const TrainingSet& set, const LearningOptions& options, bool, const StopCondition& stop) {
  return prepare(set, set.varying(), options, stop);
}

}  // namespace sherlog
