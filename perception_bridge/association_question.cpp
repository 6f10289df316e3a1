#include "perception_bridge/association_question.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>

#include "perception_bridge/view.h"

namespace sherlog {
namespace {

constexpr std::array<const char*, 4> kAnswers = {"is", "appear", "disappear", "hidden"};
constexpr std::array<const char*, 3> kSame = {"stay", "move", "newview"};

// Position by constant; `count` for constants that are none of the clusters.
std::vector<std::size_t> positions(const Model& model, const Evidence& evidence, DomainId domain,
                                   const std::string& prefix, std::size_t first, std::size_t count) {
  std::vector<std::size_t> by_constant(evidence.domain_size(model, domain), count);
  for (std::size_t i = 0; i < count; ++i) {
    if (const auto c = evidence.find_constant(model, domain, fmt::format("{}{}", prefix, first + i)))
      by_constant[*c] = i;
  }
  return by_constant;
}

std::string lower(std::string_view word) {
  std::string text(word);
  std::ranges::transform(text, text.begin(), [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return text;
}

}  // namespace

std::optional<std::array<ConstantIndex, 3>> explanation_constants(const Model& model, std::string& problem) {
  const auto is = model.find_predicate("is");
  if (!is || model.predicate(*is).domains.size() != 3) {
    problem = "'is' must have three arguments: old cluster, new cluster, explanation";
    return std::nullopt;
  }
  std::array<std::optional<ConstantIndex>, 3> found;
  const Domain& words = model.domain(model.predicate(*is).domains[2]);
  for (ConstantIndex c = 0; c < words.constants.size(); ++c) {
    const std::string word = lower(words.constants[c]);
    const auto kind = std::ranges::find(kSame, word);
    if (kind != kSame.end()) {
      found[static_cast<std::size_t>(kind - kSame.begin())] = c;
    } else if (word != "not") {
      problem = fmt::format("the explanation '{}' of 'is' is none of stay, move, newview, not", words.constants[c]);
      return std::nullopt;
    }
  }
  for (std::size_t k = 0; k < kSame.size(); ++k) {
    if (found[k]) continue;
    problem = fmt::format("the explanations of 'is' lack '{}'", kSame[k]);
    return std::nullopt;
  }
  return std::array<ConstantIndex, 3>{*found[0], *found[1], *found[2]};
}

std::string method_for(const InferenceOptions& inference, std::size_t olds, std::size_t news) {
  return inference.method == "matching" && olds * news <= 1 ? "exact" : inference.method;
}

IdentityBelief belief_of(const StandingQuestion& question, const StandingQuestion::Answer& answer,
                         const std::array<std::string, 2>& prefixes, std::size_t first, std::size_t olds,
                         std::size_t news) {
  IdentityBelief belief(olds, news);
  const Model& model = question.model();
  std::string problem;
  const auto kinds = explanation_constants(model, problem);
  if (!kinds) return belief;
  const PredicateId is = *model.find_predicate("is");
  const auto& domains = model.predicate(is).domains;
  const auto old_position = positions(model, *answer.evidence, domains[0], prefixes[0], first, olds);
  const auto new_position = positions(model, *answer.evidence, domains[1], prefixes[1], first, news);
  for (const StandingQuestion::Atom& atom : answer.atoms) {
    const std::string& name = model.predicate(atom.predicate).name;
    if (atom.predicate == is) {
      const std::size_t o = old_position[atom.arguments[0]], n = new_position[atom.arguments[1]];
      const auto kind = std::ranges::find(*kinds, atom.arguments[2]);
      if (o < olds && n < news && kind != kinds->end())
        belief.pair(o, n)[static_cast<std::size_t>(kind - kinds->begin())] = atom.probability;
    } else if (atom.arguments.size() == 1) {
      const bool of_new = name == "appear";
      const std::size_t i = (of_new ? new_position : old_position)[atom.arguments[0]];
      if (i >= (of_new ? news : olds)) continue;
      if (of_new) belief.set_appeared(i, atom.probability);
      if (name == "disappear") belief.set_disappeared(i, atom.probability);
      if (name == "hidden") belief.set_hidden(i, atom.probability);
    }
  }
  return belief;
}

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
  if (!explanation_constants(model, problem)) return std::nullopt;
  const auto& domains = model.predicate(*model.find_predicate("is")).domains;
  for (const auto& [name, domain] :
       {std::pair{"appear", domains[1]}, {"disappear", domains[0]}, {"hidden", domains[0]}}) {
    if (model.predicate(*model.find_predicate(name)).domains == std::vector<DomainId>{domain}) continue;
    problem =
        fmt::format("'{}' must have one argument, of the domain '{}' as in 'is'", name, model.domain(domain).name);
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
  const StandingQuestion::Answer answer =
      question_->ask(evidence, monitor, method_for(question_->options(), olds, news));
  Answer out{answer.termination, answer.message, answer.method, evidence, answer.contradiction, {}, answer.is_world};
  if (answer.termination == Termination::kCompleted) {
    const std::array<std::string, 2> prefixes = {mapping_.old_clusters.prefix, mapping_.new_clusters.prefix};
    out.belief = belief_of(*question_, answer, prefixes, 0, olds, news);
  }
  return out;
}

std::vector<bool> out_of_view_of(std::span<const Cluster> olds, const Scene& now) {
  const SceneView view = view_of(now);
  std::vector<bool> out;
  for (const Cluster& old : olds) out.push_back(!sees_thing(view, old));
  return out;
}

}  // namespace sherlog
