// The question of identity, asked of a model: which new cluster is which old one, and what has happened to it?
//
// Idea      An evidence mapping compares the clusters, the engine answers, and the marginals of is(old, new, explanation) are the
//           belief. Everything that compares two looks asks through this: the tracker, its second thoughts, the pictures.
// Model     any that declares is(old, new, explanation), appear(new), disappear(old), hidden(old), and what the mapping
//           writes
// Errors    those of the model when it is made; later each answer has a termination and a sentence
// Cost      one grounding and one inference, quadratic in the clusters
#pragma once

#include <array>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "inference/standing_question.h"
#include "perception_bridge/evidence_mapping.h"
#include "perception_bridge/identity_belief.h"
#include "perception_bridge/observe.h"

namespace sherlog {

class AssociationQuestion {
 public:
  // Nothing, and a sentence, where the model lacks what it must declare.
  static std::optional<AssociationQuestion> make(Model model, EvidenceMapping mapping, InferenceOptions inference,
                                                 std::string& problem);

  struct Answer {
    Termination termination = Termination::kCompleted;
    std::string message;  // where not completed
    std::string method;
    std::string evidence;                                // the database that was asked
    std::shared_ptr<const Contradiction> contradiction;  // where kNoPossibleWorld; while the question lives
    IdentityBelief belief;
    bool is_world = false;  // the belief is the most probable world: its 1 and 0 are no probabilities
  };
  Answer ask(std::span<const Cluster> olds, const Scene& now, Monitor& monitor) const;
  // Of a database in words of the model; `olds`, `news`: how many of the mapping's clusters (O0, O1, ...) it speaks of.
  Answer ask(const std::string& evidence, std::size_t olds, std::size_t news, Monitor& monitor) const;

  const EvidenceMapping& mapping() const { return mapping_; }

 private:
  AssociationQuestion(StandingQuestion question, EvidenceMapping mapping);

  std::unique_ptr<StandingQuestion> question_;
  EvidenceMapping mapping_;
};

// The constants of is(old, new, explanation) that are stay, move and newview, upper and lower case alike. Nothing, and a sentence,
// where `is` is of another form or has explanations besides these and `not`: nobody would know whether they mean the same object.
std::optional<std::array<ConstantIndex, 3>> explanation_constants(const Model& model, std::string& problem);
// The method for so many clusters. Where there is one pair at most no two of them exclude each other, and `matching` would see none:
// such a matching is a small table, for `exact`.
std::string method_for(const InferenceOptions& inference, std::size_t olds, std::size_t news);
// What the model's atoms say of old and new clusters, which are `old_prefix`0, ... or 1, ... by `first`.
IdentityBelief belief_of(const StandingQuestion& question, const StandingQuestion::Answer& answer,
                         const std::array<std::string, 2>& prefixes, std::size_t first, std::size_t olds,
                         std::size_t news);

// By old cluster: whether its place lies outside what the scene looks at. One without a position counts as in view.
std::vector<bool> out_of_view_of(std::span<const Cluster> olds, const Scene& now);

}  // namespace sherlog
