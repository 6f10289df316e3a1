// What is on the table? Several annotators saw shape, colour and signs; the shipped fusion model joins their
// hints.
//
// The program prints the three most probable classes of each thing in a breakfast scene. Then it asks the question
// the other way round: if that box is a box of cereals, which sign should a closer look find?
//
// Usage: information_fusion [FOLDER WITH THE MODELS]
#include <algorithm>
#include <cstdio>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "sherlog.h"

#ifndef SHERLOG_MODELS_DIR
#define SHERLOG_MODELS_DIR "models"
#endif

namespace {

struct Ranked {
  std::string atom;
  double probability = 0.0;
};

// From a model, a database and a question to answers; nothing, after a message, where something is wrong.
// The key of a group is the atom up to its last argument: "object(c1" for object(c1,Milk).
std::optional<std::map<std::string, std::vector<Ranked>>> ask(const sherlog::Model& model, const std::string& database,
                                                              const std::string& question) {
  using namespace sherlog;
  Diagnostics diagnostics;
  const auto evidence = parse_evidence_files(model, {database}, diagnostics);
  const auto query = evidence ? parse_query(model, evidence->front(), {question}, diagnostics) : std::nullopt;
  if (!query) return std::fputs(diagnostics.render().c_str(), stderr), std::nullopt;
  Monitor monitor;
  const GroundingResult grounded = ground(model, evidence->front(), *query, {}, monitor);
  if (!grounded.network) return std::fprintf(stderr, "%s\n", grounded.message.c_str()), std::nullopt;
  const InferenceResult result = infer(*grounded.network, {}, monitor);
  if (result.termination != Termination::kCompleted)
    return std::fprintf(stderr, "%s\n", result.message.c_str()), std::nullopt;

  std::map<std::string, std::vector<Ranked>> groups;
  for (std::size_t i = 0; i < result.marginals.size(); ++i) {
    const std::string atom = grounded.network->atom_text(grounded.network->queries()[i].literal.atom());
    groups[atom.substr(0, atom.find(','))].push_back({atom, result.marginals[i].probability});
  }
  for (auto& group : groups) {
    std::stable_sort(group.second.begin(), group.second.end(),
                     [](const Ranked& a, const Ranked& b) { return a.probability > b.probability; });
  }
  return groups;
}

void print_best(const std::vector<Ranked>& ranked, std::size_t count) {
  for (std::size_t i = 0; i < std::min(count, ranked.size()); ++i)
    std::printf("  %-32s %.3f\n", ranked[i].atom.c_str(), ranked[i].probability);
}

}  // namespace

int main(int argc, char** argv) {
  const std::string folder = std::string(argc > 1 ? argv[1] : SHERLOG_MODELS_DIR) + "/information_fusion/";
  sherlog::Diagnostics diagnostics;
  const auto model = sherlog::parse_model_file(folder + "fusion.mln", diagnostics);
  if (!model) return std::fputs(diagnostics.render().c_str(), stderr), 2;

  // All things of the scene are classified together: the sign of Kellogg's on one box helps the white box to be milk.
  const auto classes = ask(*model, folder + "breakfast_scene.db", "object");
  if (!classes) return 2;
  std::printf("what is on the table\n");
  for (const auto& thing : *classes) print_best(thing.second, 3);

  // The same model answers in the other direction, since it is a joint distribution and not a classifier.
  const auto logos = ask(*model, folder + "expected_logo.db", "goggles_Logo(c1, ?logo)");
  if (!logos) return 2;
  std::printf("\nwhich sign to look for on a box of cereals\n");
  for (const auto& thing : *logos) print_best(thing.second, 3);
  return 0;
}
