// Model + Evidence + Query to GroundNetwork, by joins over the evidence.
#pragma once

#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "grounding/network.h"
#include "mln/evidence.h"
#include "mln/model.h"
#include "mln/monitor.h"
#include "mln/query.h"

namespace sherlog {

enum class SoftEvidence : std::uint8_t {
  kVirtual,  // an atom's true worlds are weighted p and its false worlds 1 - p
  kJeffrey,  // the posterior marginal of the atom equals p
};

struct GroundingOptions {
  std::vector<PredicateId> open_world;  // open besides the queried predicates
  bool open_world_all = false;          // all but those declared *P
  SoftEvidence soft_evidence = SoftEvidence::kVirtual;
  std::size_t max_memory = std::numeric_limits<std::size_t>::max();  // bytes, for the network and what makes it
  double max_seconds = std::numeric_limits<double>::infinity();
  double dense_atoms =
      1 << 20;  // a predicate with at most so many ground atoms has a cell for each, others a hash table
  bool keep_zero_weights = false;  // learning counts them; inference has no use for them
};

// How much work one formula was.
struct FormulaGrounding {
  FormulaId formula;
  double groundings = 0;       // product of its domains (per template instance summed)
  std::uint64_t joined = 0;    // visited: those that the evidence does not decide at a glance
  std::uint64_t features = 0;  // ground features or constraints made of it, after merging
  double seconds = 0;
};

// Why no world is possible: ground formulas and evidence that contradict each other; dropping any one resolves it (as far
// as could be checked in the time given).
struct Conflict {
  struct Item {
    std::string text;  // ground formula or evidence atom
    Place place;       // into `files`
    bool is_formula = false;
  };
  std::vector<Item> items;
  std::string sentence;                                            // e.g. "the evidence contradicts a hard formula"
  std::shared_ptr<const Sources> model_sources, evidence_sources;  // for items that are formulas / evidence
};

struct GroundingResult {
  Termination termination = Termination::kCompleted;
  std::string message;                   // one sentence where not completed: names the formula and the count
  std::optional<GroundNetwork> network;  // where completed
  std::optional<Conflict> conflict;      // where kNoPossibleWorld
  std::vector<FormulaGrounding> formulas;
  double seconds = 0;
};

GroundingResult ground(const Model& model, const Evidence& evidence, const Query& query,
                       const GroundingOptions& options, Monitor& monitor);

}  // namespace sherlog
