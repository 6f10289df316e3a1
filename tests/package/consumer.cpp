// A program of another project: reads a model of one coin from a string and checks its answer.
#include <cmath>
#include <cstdio>

#include "inference/inference.h"
#include "sherlog.h"

int main() {
  sherlog::Diagnostics diagnostics;
  const auto model = sherlog::parse_model("Heads(coin)\nlog(3) Heads(x)\n", "coin.mln", diagnostics);
  if (!model) return std::fputs(diagnostics.render().c_str(), stderr), 1;
  const auto databases = sherlog::parse_evidence(*model, "coin = {Penny}\n", "coin.db", diagnostics);
  if (!databases) return std::fputs(diagnostics.render().c_str(), stderr), 1;
  const auto query = sherlog::parse_query(*model, databases->front(), {"Heads"}, diagnostics);
  if (!query) return std::fputs(diagnostics.render().c_str(), stderr), 1;
  sherlog::Monitor monitor;
  const auto grounded = sherlog::ground(*model, databases->front(), *query, {}, monitor);
  if (!grounded.network) return std::fputs(grounded.message.c_str(), stderr), 1;
  const auto result = sherlog::infer(*grounded.network, {}, monitor);
  const double expected = 3.0 / 4.0;  // odds of e^log(3) = 3 to 1
  if (result.marginals.size() != 1 || std::abs(result.marginals[0].probability - expected) > 1e-9) {
    return std::fputs("consumer: a wrong answer\n", stderr), 1;
  }
  std::puts("consumer: P(Heads(Penny)) = 0.75");
  return 0;
}
