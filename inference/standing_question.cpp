#include "inference/standing_question.h"

#include <algorithm>

#include "grounding/ground.h"
#include "mln/query.h"

namespace sherlog {
namespace {

std::string first_error(const Diagnostics& diagnostics) {
  for (const Diagnostic& d : diagnostics.all()) {
    if (d.severity == Severity::kError) return d.text;
  }
  return "bad input";
}

}  // namespace

StandingQuestion::StandingQuestion(Model model, std::vector<std::string> queries, const std::vector<std::string>& open,
                                   InferenceOptions options)
    : model_(std::move(model)), queries_(std::move(queries)), options_(std::move(options)) {
  for (const std::string& name : open) {
    if (const auto predicate = model_.find_predicate(name)) open_.push_back(*predicate);
  }
}

StandingQuestion::Answer StandingQuestion::ask(std::string_view text, Monitor& monitor, std::string_view method) const {
  Answer answer;
  const auto stop = [&](Termination termination, std::string message) {
    answer.termination = termination;
    answer.message = std::move(message);
    return std::move(answer);
  };
  Diagnostics diagnostics;
  auto databases = parse_evidence(model_, text, "evidence", diagnostics);
  if (!databases || databases->size() != 1) return stop(Termination::kRefused, first_error(diagnostics));
  answer.evidence = std::move(databases->front());
  const auto query = parse_query(model_, *answer.evidence, queries_, diagnostics);
  if (!query) return stop(Termination::kRefused, first_error(diagnostics));
  GroundingOptions grounding;
  grounding.open_world = open_;
  grounding.max_memory = options_.max_memory;
  grounding.max_seconds = options_.max_seconds;
  GroundingResult ground_result = ground(model_, *answer.evidence, *query, grounding, monitor);
  answer.ground_seconds = ground_result.seconds;
  const auto contradict = [&](std::optional<Conflict> on_the_ground, std::optional<GroundNetwork> unmet,
                              std::vector<std::uint32_t> constraints) {
    answer.contradiction = std::make_shared<Contradiction>(
        Contradiction{&model_, *answer.evidence, std::move(on_the_ground), std::move(unmet), std::move(constraints)});
  };
  if (!ground_result.network) {
    std::string message = ground_result.message;
    if (message.empty() && ground_result.conflict) message = ground_result.conflict->sentence;
    if (ground_result.conflict) contradict(std::move(ground_result.conflict), std::nullopt, {});
    return stop(ground_result.termination, std::move(message));
  }
  const GroundNetwork& network = *ground_result.network;
  InferenceOptions options = options_;
  if (!method.empty()) options.method = method;
  options.max_seconds = std::max(0.0, options_.max_seconds - ground_result.seconds);
  const InferenceResult result = infer(network, options, monitor);
  answer.infer_seconds = result.seconds;
  answer.method = result.method;
  if (result.termination != Termination::kCompleted || (result.marginals.empty() && !result.map)) {
    const bool nothing_asked = network.queries().empty() && result.termination == Termination::kCompleted;
    if (result.termination == Termination::kNoPossibleWorld) contradict(std::nullopt, network, result.conflict);
    if (!nothing_asked) return stop(result.termination, result.message);
  }
  answer.is_world = result.map.has_value();
  for (std::size_t q = 0; q < network.queries().size(); ++q) {
    const Literal literal = network.queries()[q].literal;
    const AtomId atom = literal.atom();
    Atom& named = answer.atoms.emplace_back();
    named.predicate = network.predicate_of(atom);
    const auto arguments = network.arguments_of(atom);
    named.arguments.assign(arguments.begin(), arguments.end());
    named.probability = result.map
                            ? (result.map->values[network.variable_of(atom).index()] == network.value_of(atom) ? 1 : 0)
                            : result.marginals[q].probability;
  }
  return answer;
}

}  // namespace sherlog
