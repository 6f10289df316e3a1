#include "perception_bridge/association_question.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>

#include "perception_bridge/view.h"

namespace sherlog {
namespace {

constexpr std::array<const char*, 4> kAnswers = {"is", "appear", "disappear", "hidden"};
constexpr std::array<const char*, 3> kSame = {"stay", "move", "newview"};

// Position by constant; `count` for constants that are none of the clusters.
std::vector<std::size_t> positions(const Model& model, const Evidence& evidence, DomainId domain,
                                   const std::string& prefix, std::size_t count) {
  std::vector<std::size_t> by_constant(evidence.domain_size(model, domain), count);
  for (std::size_t i = 0; i < count; ++i) {
    if (const auto c = evidence.find_constant(model, domain, fmt::format("{}{}", prefix, i))) by_constant[*c] = i;
  }
  return by_constant;
}

IdentityBelief belief_of(const StandingQuestion& question, const StandingQuestion::Answer& answer,
                         const EvidenceMapping& mapping, std::size_t olds, std::size_t news) {
  IdentityBelief belief(olds, news);
  const Model& model = question.model();
  const PredicateId is = *model.find_predicate("is");
  const auto& domains = model.predicate(is).domains;
  const auto old_position = positions(model, *answer.evidence, domains[0], mapping.old_clusters.prefix, olds);
  const auto new_position = positions(model, *answer.evidence, domains[1], mapping.new_clusters.prefix, news);
  for (const StandingQuestion::Atom& atom : answer.atoms) {
    if (atom.predicate != is) continue;
    const std::size_t o = old_position[atom.arguments[0]], n = new_position[atom.arguments[1]];
    if (o >= olds || n >= news) continue;
    for (std::size_t k = 0; k < kSame.size(); ++k) {
      if (model.domain(domains[2]).find(kSame[k]) == atom.arguments[2]) belief.pair(o, n)[k] = atom.probability;
    }
  }
  return belief;
}

}  // namespace

AssociationQuestion::AssociationQuestion(StandingQuestion question, EvidenceMapping mapping)
    : question_(std::make_unique<StandingQuestion>(std::move(question))), mapping_(std::move(mapping)) {}

std::optional<AssociationQuestion> AssociationQuestion::make(Model model, EvidenceMapping mapping,
                                                             InferenceOptions inference, std::string& problem) {
  std::vector<std::string> needed(kAnswers.begin(), kAnswers.end());
  std::vector<std::string> given;
  for (const PairRule& rule : mapping.pairs) given.push_back(rule.predicate);
  if (!mapping.out_of_view.empty()) given.push_back(mapping.out_of_view);
  needed.insert(needed.end(), given.begin(), given.end());
  for (const std::string& name : needed) {
    if (model.find_predicate(name)) continue;
    problem = fmt::format("the model does not declare '{}'", name);
    return std::nullopt;
  }
  if (mapping.pairs.empty()) {
    problem = fmt::format("the mapping '{}' has no rule for pairs of clusters", mapping.name);
    return std::nullopt;
  }
  const auto& domains = model.predicate(*model.find_predicate("is")).domains;
  const bool good = domains.size() == 3 && std::all_of(kSame.begin(), kSame.end(), [&](const char* word) {
                      return model.domain(domains[2]).find(word).has_value();
                    });
  if (!good) {
    problem =
        "'is' must have three arguments: old cluster, new cluster, and an explanation that is stay, move or newview";
    return std::nullopt;
  }
  std::vector<std::string> open;
  for (const Predicate& predicate : model.predicates()) {
    if (std::find(given.begin(), given.end(), predicate.name) == given.end()) open.push_back(predicate.name);
  }
  StandingQuestion question(std::move(model), {kAnswers.begin(), kAnswers.end()}, std::move(open),
                            std::move(inference));
  return AssociationQuestion(std::move(question), std::move(mapping));
}

AssociationQuestion::Answer AssociationQuestion::ask(std::span<const Cluster> olds, const Scene& now,
                                                     Monitor& monitor) const {
  return ask(evidence_text(observe_change(mapping_, olds, now)), olds.size(), now.clusters.size(), monitor);
}

AssociationQuestion::Answer AssociationQuestion::ask(const std::string& evidence, std::size_t olds, std::size_t news,
                                                     Monitor& monitor) const {
  const StandingQuestion::Answer answer = question_->ask(evidence, monitor);
  Answer out{answer.termination, answer.message, answer.method, evidence, {}};
  if (answer.termination == Termination::kCompleted) out.belief = belief_of(*question_, answer, mapping_, olds, news);
  return out;
}

std::vector<bool> out_of_view_of(std::span<const Cluster> olds, const Scene& now) {
  const SceneView view = view_of(now);
  std::vector<bool> out;
  for (const Cluster& old : olds) out.push_back(!sees_thing(view, old));
  return out;
}

}  // namespace sherlog
