// Which annotator to run next: the expected drop of entropy of what is asked, for each second that it takes.
//
// Idea      An annotator reports the atoms of one or more predicates about one thing (a cluster), so each annotator and each
//           thing about which it has said nothing yet is a candidate. Its atoms are opened, everything else stays as the
//           evidence has it, and the mutual information between them and the queried blocks is what running it
//           is expected to tell (information.h). A model that is to give advice must therefore say how probable an annotator's
//           answers are; one that was learned for classification alone (dpll, cll) does not.
//           Other annotators that have not run are closed like all evidence predicates: "nothing was found". To have them unknown
//           instead, open their predicates in the grounding options.
// Source    Lindley 1956 (see information.h); the cost in seconds as in the perception system's table of run times.
// Input     one database; a query for atoms; annotators with positive costs
// Output    candidates by drop per second, best first; those that could not be computed at the end, with a message
// Errors    what grounding and inference on the scene say (no possible world, limits) ends everything. kRefused: nothing to
//           ask, an annotator whose predicate is queried, predicates of one annotator that are about different things.
// Cost      one grounding and one run of inference for each candidate
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "grounding/ground.h"
#include "inference/information.h"
#include "inference/query_entropy.h"
#include "mln/evidence.h"
#include "mln/model.h"
#include "mln/query.h"

namespace sherlog {

struct AnnotatorCost {
  std::string name;
  double seconds = 1.0;  // run time, above 0
  std::vector<PredicateId> predicates;
};

struct AdviceOptions {
  GroundingOptions grounding;
  InformationOptions information;
};

struct Advice {
  std::size_t annotator = 0;         // in the given order
  std::vector<std::string> cluster;  // what it would look at; empty: the scene as a whole
  Termination termination = Termination::kCompleted;
  std::string message;                 // where not completed: why there are no figures
  double expected_entropy_drop = 0.0;  // nats
  std::optional<double> mcse;          // where outcomes were drawn
  double drop_per_second = 0.0;
};

struct AdviceResult {
  Termination termination = Termination::kCompleted;  // the worst of what happened; advice holds what was found
  std::string message;
  GroundingResult grounding;         // of the scene as it is
  QueryEntropy entropy;              // of the scene as it is
  std::vector<Advice> advice;        // ranked
  std::vector<std::string> methods;  // of inference, those that were used
};

AdviceResult advise(const Model& model, const Evidence& evidence, const Query& query,
                    const std::vector<AnnotatorCost>& annotators, const AdviceOptions& options, Monitor& monitor);

}  // namespace sherlog
