// Which object seen now is which object seen before? The shipped model of object identity on a kitchen scene.
//
// Two equal blue plates and a mug; one of the plates was moved between two looks. The evidence is graded: how
// alike does each pair look, and how close are the places. The program prints the belief about each pair and then
// the one most probable explanation of the whole scene.
//
// Usage: identity_resolution [FOLDER WITH THE MODELS]
#include <cstdio>
#include <string>

#include "sherlog.h"

#ifndef SHERLOG_MODELS_DIR
#define SHERLOG_MODELS_DIR "models"
#endif

namespace {

// Messages about the input go to whoever runs the program; the library only collects them.
int fail(const sherlog::Diagnostics& diagnostics) {
  std::fputs(diagnostics.render().c_str(), stderr);
  return 2;
}

// A pair that is "not" the same object says little: only what may have happened is shown.
bool worth_showing(const std::string& atom) { return atom.find(",not)") == std::string::npos; }

}  // namespace

int main(int argc, char** argv) {
  using namespace sherlog;
  const std::string folder = std::string(argc > 1 ? argv[1] : SHERLOG_MODELS_DIR) + "/identity_resolution/";

  // Model, evidence and query are read once each; the evidence and the query belong to the model.
  Diagnostics diagnostics;
  const auto model = parse_model_file(folder + "table1.mln", diagnostics);
  if (!model) return fail(diagnostics);
  const auto evidence = parse_evidence_files(*model, {folder + "kitchen_plates.db"}, diagnostics);
  if (!evidence) return fail(diagnostics);
  const auto query = parse_query(*model, evidence->front(), {"is, appear, disappear"}, diagnostics);
  if (!query) return fail(diagnostics);

  // One ground network serves both questions below.
  Monitor monitor;
  const GroundingResult grounded = ground(*model, evidence->front(), *query, {}, monitor);
  if (!grounded.network) return std::fprintf(stderr, "%s\n", grounded.message.c_str()), 3;
  const GroundNetwork& network = *grounded.network;

  // The belief: a probability for each atom.
  InferenceOptions options;
  options.method = "exact";
  const InferenceResult belief = infer(network, options, monitor);
  if (belief.termination != Termination::kCompleted) return std::fprintf(stderr, "%s\n", belief.message.c_str()), 4;
  std::printf("belief (only what is above 0.01)\n");
  for (std::size_t i = 0; i < belief.marginals.size(); ++i) {
    const std::string atom = network.atom_text(network.queries()[i].literal.atom());
    const double probability = belief.marginals[i].probability;
    if (worth_showing(atom) && probability > 0.01) std::printf("  %-20s %.3f\n", atom.c_str(), probability);
  }

  // One consistent story: the most probable world.
  options.method = "map";
  const InferenceResult best = infer(network, options, monitor);
  if (!best.map) return std::fprintf(stderr, "%s\n", best.message.c_str()), 4;
  std::printf("\nmost probable explanation%s\n", best.map->optimal ? " (proved)" : "");
  for (const QueryTarget& target : network.queries()) {
    const AtomId atom = target.literal.atom();
    const bool is_true = best.map->values[network.variable_of(atom).index()] == network.value_of(atom);
    if (is_true && worth_showing(network.atom_text(atom))) std::printf("  %s\n", network.atom_text(atom).c_str());
  }
  return 0;
}
