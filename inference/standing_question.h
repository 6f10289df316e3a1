// One model and one query, asked of many databases: parsed once, then evidence in, named probabilities out.
//
// Idea      A robot's main loop asks the same question of each new scene. This is the whole engine behind one call, for layers
//           that know models and results but nothing of ground networks.
// Errors    those of the model and the query when it is made; later each answer has a termination and a sentence.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "grounding/ground.h"
#include "inference/inference.h"
#include "mln/diagnostics.h"
#include "mln/evidence.h"
#include "mln/model.h"

namespace sherlog {

// What contradicts each other where no world is possible: found on the ground, or else constraints of the network, which are few.
struct Contradiction {
  const Model* model = nullptr;  // the question's
  Evidence evidence;
  std::optional<Conflict> grounding;
  std::optional<GroundNetwork> network;
  std::vector<std::uint32_t> constraints;
};

class StandingQuestion {
 public:
  struct Atom {
    PredicateId predicate;
    std::vector<ConstantIndex> arguments;
    double probability = 0.0;  // of the most probable world's atoms 1 or 0, where the method finds that
  };
  struct Answer {
    Termination termination = Termination::kCompleted;
    std::string message;                                 // a sentence where not completed
    std::string method;                                  // the one that ran
    std::optional<Evidence> evidence;                    // whose constants the arguments are
    std::vector<Atom> atoms;                             // the queried ones that the evidence does not decide
    std::shared_ptr<const Contradiction> contradiction;  // where kNoPossibleWorld
    bool is_world = false;  // the atoms are those of the most probable world: 1 and 0 are no probabilities
    double ground_seconds = 0.0, infer_seconds = 0.0;
  };

  // `queries`: predicates, in whose atoms the answers are. `open`: further predicates that are open.
  StandingQuestion(Model model, std::vector<std::string> queries, const std::vector<std::string>& open,
                   InferenceOptions options);

  const Model& model() const { return model_; }
  const InferenceOptions& options() const { return options_; }
  // Can be called from several threads at a time. `evidence`: the text of one database. `method`: "": that of the options.
  Answer ask(std::string_view evidence, Monitor& monitor, std::string_view method = "") const;

 private:
  Model model_;
  std::vector<std::string> queries_;
  std::vector<PredicateId> open_;
  InferenceOptions options_;
};

}  // namespace sherlog
