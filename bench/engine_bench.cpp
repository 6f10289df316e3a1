// The engine on the two kinds of work that it was built for, at growing sizes: friends and smokers (sparse, two-sided pair formulas,
// communities) and object identity (Table 1's shape: blocks, one-to-one hard formulas, long existential quantifiers).
#include <benchmark/benchmark.h>
#include <fmt/format.h>

#include <random>
#include <string>

#include "grounding/ground.h"
#include "inference/inference.h"
#include "mln/evidence.h"
#include "mln/model.h"
#include "mln/query.h"

namespace sherlog {
namespace {

const char* const kSmokersModel = R"(
Friends(person, person)
Smokes(person)
Cancer(person)
1.5 Smokes(x) => Cancer(x)
1.1 Friends(x, y) ^ Smokes(x) => Smokes(y)
-1.0 Smokes(x)
-1.0 Cancer(x)
)";

const char* const kIdentityModel = R"(
explanations = {move, stay, newview, not}
similar(oldCluster, newCluster)
proximity(oldCluster, newCluster)
outOfView(oldCluster)
is(oldCluster, newCluster, explanations!)
appear(newCluster)
disappear(oldCluster)
is(a, c, e1) ^ is(b, c, e2) ^ !(e1 = not) ^ !(e2 = not) => a = b.
is(c, a, e1) ^ is(c, b, e2) ^ !(e1 = not) ^ !(e2 = not) => a = b.
3.0 is(o, n, stay) <=> similar(o, n) ^ proximity(o, n)
2.0 is(o, n, move) <=> similar(o, n) ^ !proximity(o, n)
1.5 is(o, n, newview) <=> !similar(o, n) ^ proximity(o, n)
2.5 outOfView(o) => !(EXIST n (is(o, n, stay) v is(o, n, newview)))
4.0 appear(n) <=> !(EXIST o (is(o, n, stay) v is(o, n, move) v is(o, n, newview)))
4.0 disappear(o) <=> !(EXIST n (is(o, n, stay) v is(o, n, move) v is(o, n, newview))) ^ !outOfView(o)
)";

std::string smokers_evidence(int people) {
  std::mt19937_64 random(7);
  std::string text;
  const auto friends = [&](int a, int b) { text += fmt::format("Friends(P{0},P{1})\nFriends(P{1},P{0})\n", a, b); };
  for (int i = 0; i < people; ++i) {
    for (int k = 0; k < 3; ++k) {
      const int community = i / 25 * 25;
      const int j = random() % 5 == 0 ? static_cast<int>(random() % static_cast<unsigned>(people))
                                      : std::min(people - 1, community + static_cast<int>(random() % 25));
      if (j != i) friends(i, j);
    }
    if (random() % 5 == 0) text += fmt::format("{}Smokes(P{})\n", random() % 2 == 0 ? "" : "!", i);
  }
  return text;
}

std::string identity_evidence(int clusters) {
  std::mt19937_64 random(8);
  std::string text;
  for (int o = 1; o <= clusters; ++o) {
    for (int n = 1; n <= clusters; ++n) {
      const unsigned same = o == n ? 85 : 10;
      if (random() % 100 < same) text += fmt::format("similar(O{},N{})\n", o, n);
      if (random() % 100 < (o == n ? 60u : 10u)) text += fmt::format("proximity(O{},N{})\n", o, n);
    }
    if (random() % 5 == 0) text += fmt::format("outOfView(O{})\n", o);
  }
  text += "oldCluster = {";
  for (int o = 1; o <= clusters; ++o) text += fmt::format("{}O{}", o > 1 ? "," : "", o);
  text += "}\nnewCluster = {";
  for (int n = 1; n <= clusters; ++n) text += fmt::format("{}N{}", n > 1 ? "," : "", n);
  return text + "}\n";
}

struct Problem {
  Diagnostics diagnostics;
  std::optional<Model> model;
  std::optional<std::vector<Evidence>> evidence;
  std::optional<Query> query;

  Problem(const char* model_text, const std::string& evidence_text, const char* query_text) {
    model = parse_model(model_text, "model", diagnostics);
    if (model) evidence = parse_evidence(*model, evidence_text, "evidence", diagnostics);
    if (evidence) query = parse_query(*model, evidence->front(), {query_text}, diagnostics);
  }
  GroundingResult ground() const {
    Monitor monitor;
    return sherlog::ground(*model, evidence->front(), *query, {}, monitor);
  }
};

Problem smokers(int people) { return {kSmokersModel, smokers_evidence(people), "Smokes,Cancer"}; }
Problem identity(int clusters) { return {kIdentityModel, identity_evidence(clusters), "is,appear,disappear"}; }

void run(benchmark::State& state, const Problem& problem, const char* method, std::uint32_t samples) {
  if (!problem.query) {
    state.SkipWithError("the problem does not parse");
    return;
  }
  const GroundingResult grounding = problem.ground();
  Monitor monitor;
  InferenceOptions options;
  options.method = method;
  options.samples = samples;
  for (auto _ : state) {
    const InferenceResult result = infer(*grounding.network, options, monitor);
    if (result.termination != Termination::kCompleted) state.SkipWithError(result.message.c_str());
    benchmark::DoNotOptimize(result.marginals.data());
  }
  state.counters["variables"] = static_cast<double>(grounding.network->variable_count());
  state.counters["features"] = static_cast<double>(grounding.network->features().size());
}

void ParseSmokers(benchmark::State& state) {
  const std::string text = smokers_evidence(static_cast<int>(state.range(0)));
  Diagnostics diagnostics;
  const auto model = parse_model(kSmokersModel, "model", diagnostics);
  for (auto _ : state) {
    Diagnostics own;
    benchmark::DoNotOptimize(parse_evidence(*model, text, "evidence", own));
  }
  state.SetBytesProcessed(static_cast<std::int64_t>(text.size()) * state.iterations());
}

void GroundSmokers(benchmark::State& state) {
  const Problem problem = smokers(static_cast<int>(state.range(0)));
  for (auto _ : state) benchmark::DoNotOptimize(problem.ground().network);
}

void GroundIdentity(benchmark::State& state) {
  const Problem problem = identity(static_cast<int>(state.range(0)));
  for (auto _ : state) benchmark::DoNotOptimize(problem.ground().network);
}

void SmokersMap(benchmark::State& state) { run(state, smokers(static_cast<int>(state.range(0))), "map", 1); }
void SmokersMcSat(benchmark::State& state) { run(state, smokers(static_cast<int>(state.range(0))), "mcsat", 1000); }
void SmokersGibbs(benchmark::State& state) { run(state, smokers(static_cast<int>(state.range(0))), "gibbs", 1000); }
void IdentityMap(benchmark::State& state) { run(state, identity(static_cast<int>(state.range(0))), "map", 1); }
void IdentityMcSat(benchmark::State& state) { run(state, identity(static_cast<int>(state.range(0))), "mcsat", 1000); }
void IdentityExact(benchmark::State& state) { run(state, identity(static_cast<int>(state.range(0))), "exact", 1); }

BENCHMARK(ParseSmokers)->Arg(1000)->Arg(10000)->Unit(benchmark::kMillisecond);
BENCHMARK(GroundSmokers)->Arg(1000)->Arg(10000)->Unit(benchmark::kMillisecond);
BENCHMARK(GroundIdentity)->Arg(10)->Arg(20)->Unit(benchmark::kMillisecond);
BENCHMARK(SmokersMap)->Arg(100)->Arg(1000)->Arg(10000)->Unit(benchmark::kMillisecond);
BENCHMARK(SmokersMcSat)->Arg(100)->Arg(1000)->Unit(benchmark::kMillisecond);
BENCHMARK(SmokersGibbs)->Arg(100)->Arg(1000)->Unit(benchmark::kMillisecond);
BENCHMARK(IdentityMap)->Arg(6)->Arg(10)->Arg(20)->Unit(benchmark::kMillisecond);
BENCHMARK(IdentityMcSat)->Arg(6)->Arg(10)->Arg(20)->Unit(benchmark::kMillisecond);
BENCHMARK(IdentityExact)->Arg(6)->Arg(8)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace sherlog

BENCHMARK_MAIN();
