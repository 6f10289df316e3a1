// pll, dpll and bpll: which predicates are opened together, and which of their variables are taken jointly.
//
// Idea      Each predicate is opened on its own, all others being evidence: the ground network then has just the
//           groundings that can change with that predicate's atoms, and joins over the evidence find them.
#include <fmt/format.h>

#include <algorithm>
#include <map>

#include "learning/conditional_counts.h"
#include "learning/methods.h"
#include "learning/pseudo_likelihood.h"

namespace sherlog {
namespace {

// Predicates that are opened together; `joint`: their variables of equal unmarked arguments are one.
struct OpenGroup {
  std::vector<PredicateId> predicates;
  bool joint = false;
};

// Variables of the network by their unmarked arguments; only groups of two and more.
std::vector<std::vector<std::uint32_t>> joint_blocks(const Model& model, const GroundNetwork& network) {
  std::map<std::vector<ConstantIndex>, std::vector<std::uint32_t>> by_key;
  for (std::uint32_t v = 0; v < network.variable_count(); ++v) {
    const AtomId atom = network.first_atom(VariableId(v));
    const Predicate& predicate = model.predicate(network.predicate_of(atom));
    const auto arguments = network.arguments_of(atom);
    std::vector<ConstantIndex> key;
    for (std::size_t i = 0; i < arguments.size(); ++i) {
      if (!predicate.marked[i]) key.push_back(arguments[i]);
    }
    by_key[key].push_back(v);
  }
  std::vector<std::vector<std::uint32_t>> blocks;
  for (auto& [key, variables] : by_key) {
    if (variables.size() > 1) blocks.push_back(std::move(variables));
  }
  return blocks;
}

TrainingProblem count(const TrainingSet& set, const Evidence& evidence, const std::vector<OpenGroup>& groups,
                      const LearningOptions& options, const StopCondition& stop, ConditionalCounts& counts) {
  const TrueAtoms truth(set.model, evidence);
  for (const OpenGroup& group : groups) {
    const Observation observation =
        observe_within_limits(set, evidence, truth, opened(set.model, group.predicates), options, stop);
    if (!observation.result) return {observation.termination, observation.message};
    const GroundNetwork& network = observation.result->network;
    const auto blocks = group.joint ? joint_blocks(set.model, network) : std::vector<std::vector<std::uint32_t>>{};
    if (!add_conditional_counts(*observation.result, set.weights.size(), blocks, counts)) {
      return {Termination::kRefused, "--block: a block has more than 65536 joint values; take fewer predicates"};
    }
    counts.add_free(0.0, network.free_log_count());
  }
  return {};
}

class PreparedCounts : public PreparedData {
 public:
  // One entry for each database, or one for all of them.
  PreparedCounts(std::vector<ConditionalCounts> counts, std::size_t weight_count)
      : counts_(std::move(counts)), weight_count_(weight_count) {}

  std::unique_ptr<Objective> objective(std::span<const std::uint32_t> databases) override {
    if (counts_.size() == 1) return std::make_unique<PseudoLikelihood>(counts_[0], weight_count_);
    ConditionalCounts chosen;
    for (const std::uint32_t d : databases) chosen.merge(counts_[d]);
    return std::make_unique<PseudoLikelihood>(chosen, weight_count_);
  }

 private:
  std::vector<ConditionalCounts> counts_;
  std::size_t weight_count_;
};

PreparedOrProblem prepare(const TrainingSet& set, const std::vector<OpenGroup>& groups, const LearningOptions& options,
                          bool separate, const StopCondition& stop) {
  std::vector<ConditionalCounts> by_database(set.databases.size());
  std::vector<ConditionalCounts> kept(separate ? 0 : 1);
  std::size_t bytes = 0;
  TrainingProblem problem = for_each_database(
      set.databases.size(), options.threads, stop, "counting",
      [&](std::size_t d) { return count(set, set.databases[d], groups, options, stop, by_database[d]); },
      [&](std::size_t d) {
        if (separate) {
          bytes += by_database[d].memory_bytes();
          kept.push_back(std::move(by_database[d]));
          return;
        }
        kept[0].merge(by_database[d]);
        by_database[d] = ConditionalCounts();
        bytes = kept[0].memory_bytes();
      });
  if (problem.termination == Termination::kCompleted && bytes > options.max_memory) {
    problem = {Termination::kMemoryLimit, "the memory limit was reached while counting"};
  }
  if (problem.termination != Termination::kCompleted) return {nullptr, std::move(problem)};
  return {std::make_unique<PreparedCounts>(std::move(kept), set.weights.size()), {}};
}

std::vector<OpenGroup> one_by_one(const std::vector<bool>& predicates) {
  std::vector<OpenGroup> groups;
  for (std::size_t p = 0; p < predicates.size(); ++p) {
    if (predicates[p]) groups.push_back({{PredicateId(p)}, false});
  }
  return groups;
}

// The domains of a predicate's unmarked arguments: those of a block's predicates must agree.
std::vector<DomainId> unmarked_domains(const Predicate& predicate) {
  std::vector<DomainId> domains;
  for (std::size_t i = 0; i < predicate.arity(); ++i) {
    if (!predicate.marked[i]) domains.push_back(predicate.domains[i]);
  }
  return domains;
}

std::string block_problem(const Model& model, const std::vector<PredicateId>& block) {
  for (const PredicateId p : block) {
    if (unmarked_domains(model.predicate(p)) == unmarked_domains(model.predicate(block[0]))) continue;
    return fmt::format("--block: '{}' and '{}' cannot be taken jointly: their arguments have other domains",
                       model.predicate(block[0]).name, model.predicate(p).name);
  }
  return "";
}

// What varies without a formula's notice is of no consequence.
std::vector<bool> varying_in_formulas(const TrainingSet& set) {
  std::vector<bool> result = set.varying();
  for (std::size_t p = 0; p < result.size(); ++p) result[p] = result[p] && set.mentioned[p];
  return result;
}

}  // namespace

PreparedOrProblem prepare_pll(const TrainingSet& set, const LearningOptions& options, bool separate,
                              const StopCondition& stop) {
  return prepare(set, one_by_one(varying_in_formulas(set)), options, separate, stop);
}

PreparedOrProblem prepare_dpll(const TrainingSet& set, const LearningOptions& options, bool separate,
                               const StopCondition& stop) {
  std::vector<bool> chosen(set.mentioned.size(), false);
  for (const PredicateId p : options.discriminative) chosen[p.index()] = set.mentioned[p.index()];
  return prepare(set, one_by_one(chosen), options, separate, stop);
}

PreparedOrProblem prepare_bpll(const TrainingSet& set, const LearningOptions& options, bool separate,
                               const StopCondition& stop) {
  std::vector<bool> alone = varying_in_formulas(set), named(set.mentioned.size(), false);
  std::vector<OpenGroup> groups;
  for (const auto& block : options.blocks) {
    const std::string problem = block_problem(set.model, block);
    if (!problem.empty()) return {nullptr, {Termination::kRefused, problem}};
    OpenGroup group;
    for (const PredicateId p : block) {
      if (!set.mentioned[p.index()]) continue;
      if (named[p.index()]) {
        return {nullptr,
                {Termination::kRefused, fmt::format("--block: '{}' stands twice", set.model.predicate(p).name)}};
      }
      named[p.index()] = true;
      alone[p.index()] = false;
      group.predicates.push_back(p);
    }
    group.joint = group.predicates.size() > 1;
    if (!group.predicates.empty()) groups.push_back(std::move(group));
  }
  for (OpenGroup& single : one_by_one(alone)) groups.push_back(std::move(single));
  return prepare(set, groups, options, separate, stop);
}

}  // namespace sherlog
