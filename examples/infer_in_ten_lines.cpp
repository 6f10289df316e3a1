// From three texts to a table of marginals: all of the library that most programs need.
//
// The model says that smoking makes cancer more likely (weight 1.5) and that friends have similar habits (weight 1.1).
// Anna smokes, and Anna and Bob are friends: how likely is it that Bob smokes, and that either of them gets cancer?
#include <cstdio>

#include "sherlog.h"

namespace {

constexpr const char* kModel = R"(
Smokes(person)
Cancer(person)
Friends(person, person)
1.5 Smokes(x) => Cancer(x)
1.1 Friends(x,y) => (Smokes(x) <=> Smokes(y))
)";
constexpr const char* kEvidence = "Smokes(Anna)\nFriends(Anna,Bob)\nFriends(Bob,Anna)\n";

// Bad input is a list of located messages, never an exception.
int fail(const sherlog::Diagnostics& diagnostics) {
  std::fputs(diagnostics.render().c_str(), stderr);
  return 2;
}

}  // namespace

int main() {
  sherlog::Diagnostics diagnostics;

  // A model once; evidence against it (one value for each database of the text); a query against both.
  const auto model = sherlog::parse_model(kModel, "smokers.mln", diagnostics);
  if (!model) return fail(diagnostics);
  const auto databases = sherlog::parse_evidence(*model, kEvidence, "smokers.db", diagnostics);
  if (!databases) return fail(diagnostics);
  const auto query = sherlog::parse_query(*model, databases->front(), {"Smokes", "Cancer"}, diagnostics);
  if (!query) return fail(diagnostics);

  // The ground network is what is left once evidence and query are known. A Monitor shows progress and carries the wish to
  // stop; this one does neither.
  sherlog::Monitor monitor;
  const auto grounded = sherlog::ground(*model, databases->front(), *query, {}, monitor);
  if (!grounded.network) return std::fprintf(stderr, "%s\n", grounded.message.c_str()), 3;

  // Method "auto": exact where the components are narrow enough, as here; else MC-SAT.
  const auto result = sherlog::infer(*grounded.network, {}, monitor);
  if (result.termination != sherlog::Termination::kCompleted)
    return std::fprintf(stderr, "%s\n", result.message.c_str()), 4;

  // Marginals come in the order of the network's queries.
  std::printf("method %s\n", result.method.c_str());
  for (std::size_t i = 0; i < result.marginals.size(); ++i) {
    const auto& asked = grounded.network->queries()[i];
    std::printf("%-16s %.4f\n", grounded.network->literal_text(asked.literal).c_str(), result.marginals[i].probability);
  }
  return 0;
}
