// The partition sum and beliefs of one component for many weight vectors: compiled once, summed often.
//
// Idea      Learning changes weights and leaves the structure alone. The component is compiled without its features'
//           weights (FactorGraphOptions::keep_features): its tables hold what hard constraints say, and every feature
//           knows at which table entries it is true. A caller turns weights into one number for each entry (the sum of
//           weight over the features that are true there), gets log Z and the probability of each entry back, and an
//           expected count is the sum of a feature's entries' probabilities: the gradient of log Z.
//           The sum is made in the cheapest way there is: over a list of all possible worlds where they are few,
//           by elimination (elimination.h) where that is narrow enough, else by bounded search (bounded_sum.h), which can
//           do a component of few variables for some weights and not for others, so that every sum may be refused.
//           Where elimination takes long, search is tried first, for no longer than that (five variables of 21 values:
//           10 ms instead of 100, whatever the weights), and the less often the more it fails.
// Layout    Entries of all tables stand one after the other, 0 .. entry_count() - 1.
// Errors    compile_component_sum says kNoPossibleWorld (with constraints that take part), kTooWide or kMemoryLimit.
// Cost      sum: O(worlds x tables) for few worlds, without an allocation; else that of sum_product or bounded_sum.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "grounding/network.h"
#include "inference/elimination.h"
#include "inference/inference.h"
#include "mln/monitor.h"

namespace sherlog {

struct CompiledComponent;

struct ComponentSumOptions {
  // Of bounded search; elimination and lists of worlds are exact.
  double relative_gap = 1e-10;
  std::uint64_t max_steps = 1'500'000'000;  // a sum, two or three seconds
  // Components with more variables than this (auxiliary ones included) are not tried. 0: no bounded search.
  std::size_t max_searched_variables = 64;
};

class ComponentSum {
 public:
  enum class Way { kWorlds, kElimination, kSearch };

  // A feature that is true in some worlds and false in others.
  struct Feature {
    std::uint32_t feature = 0;  // index into network.features()
    std::uint32_t entry_begin = 0, entry_end = 0;
    bool negated = false;
  };

  Way way() const { return way_; }
  std::size_t entry_count() const { return static_.size(); }
  std::span<const Feature> features() const { return features_; }
  // Where the feature's literal is true, or where it is false (negated): entries of one table, so exactly one or none of them
  // holds in a world.
  std::span<const std::uint32_t> entries(const Feature& f) const {
    return {feature_entries_.data() + f.entry_begin, f.entry_end - f.entry_begin};
  }
  // Indices into network.features(): true in every possible world of the component. What is in neither list is false in
  // every one.
  std::span<const std::uint32_t> true_features() const { return true_features_; }

  // log_partition: log of the sum over the component's worlds that meet its constraints of
  // exp(sum of log_potentials at the entries that hold), plus the bias given at compilation. Features add nothing of
  // their own: those in true_features() are left to the caller.
  // beliefs: probability of each entry, as many as entry_count(); empty: not wanted.
  // Returns kCompleted, kTimeLimit, kInterrupted, kNoPossibleWorld where log_potentials of -infinity leave no world, or
  // (bounded search) kTooWide where mass is spread over too many worlds at these weights.
  // Scratch is kept in the object: different objects may be summed at the same time, one object may not. Bounded search
  // starts where the last sum ended, so the last digits, within the gap, depend on the sums before.
  Termination sum(std::span<const double> log_potentials, double& log_partition, std::span<double> beliefs,
                  const StopCondition& stop) const;

 private:
  friend class ComponentSumCompiler;
  Termination sum_worlds(std::span<const double> log_potentials, double& log_partition,
                         std::span<double> beliefs) const;
  Termination sum_by_elimination(std::span<const double> log_potentials, double& log_partition,
                                 std::span<double> beliefs, const StopCondition& stop) const;
  Termination sum_by_search(std::span<const double> log_potentials, double& log_partition, std::span<double> beliefs,
                            std::uint64_t max_steps, const StopCondition& stop) const;
  // Elimination, or search where it is worth a try and succeeds.
  Termination sum_by_either(std::span<const double> log_potentials, double& log_partition, std::span<double> beliefs,
                            const StopCondition& stop) const;
  void fill_tables(std::span<const double> log_potentials) const;

  std::vector<double> static_;  // by entry: what does not change
  std::vector<Feature> features_;
  std::vector<std::uint32_t> feature_entries_, true_features_;
  double constant_ = 0.0;
  std::size_t table_count_ = 0;

  Way way_ = Way::kWorlds;

  // kWorlds
  std::vector<std::uint32_t> world_entries_;  // world after world: one entry of each table
  std::vector<double> world_static_;          // by world
  mutable std::vector<double> world_score_;

  // Otherwise
  mutable LogTables tables_;  // static_ plus log_potentials
  BucketTree tree_;           // kElimination
  // kSearch, or kElimination with trial_steps_
  std::uint64_t trial_steps_ = 0;            // what elimination costs; 0: search is not tried
  mutable std::uint32_t failed_trials_ = 0;  // in a row
  mutable std::uint32_t sums_to_trial_ = 0;
  ComponentSumOptions options_;
  std::vector<std::uint32_t> cardinalities_;
  std::vector<std::vector<std::uint32_t>> scopes_;
  mutable double threshold_ = 0.0;  // of the last search
};

// Either a sum or the reason why there is none.
struct CompiledComponent {
  std::optional<ComponentSum> sum;
  Termination termination = Termination::kCompleted;  // or kNoPossibleWorld, kTooWide, kMemoryLimit, or as stopped
  std::string message;                                // then: a sentence
  std::vector<std::uint32_t> conflict;                // kNoPossibleWorld: constraints that take part, not made small
};

// `options`: max_table_log2 and max_memory. `atom_bias`: by atom of the network, or empty.
CompiledComponent compile_component_sum(const GroundNetwork& network, ComponentId component,
                                        const InferenceOptions& options, const StopCondition& stop,
                                        std::span<const double> atom_bias = {},
                                        const ComponentSumOptions& sum_options = {});

}  // namespace sherlog
