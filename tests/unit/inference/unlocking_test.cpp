// Worlds between which single changes do not lead, in components too wide to be drawn as a whole: their shares are known in
// closed form.
#include "inference/unlocking.h"

#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <string>

#include "grounding/ground.h"
#include "inference/inference.h"
#include "mln/evidence.h"
#include "mln/model.h"
#include "mln/query.h"

namespace sherlog {
namespace {

constexpr int kUsers = 40;

// The sum over all S of exp(0.004 |S|^2 - 0.001 p |S|): what 40 atoms that like to be true together make of one atom p.
double sum_over_users(int p) {
  double sum = 0.0, ways = 1.0;
  for (int k = 0; k <= kUsers; ++k) {
    sum += ways * std::exp(0.004 * k * k - 0.001 * p * k);
    ways *= static_cast<double>(kUsers - k) / (k + 1);
  }
  return sum;
}

InferenceResult mcsat(const std::string& model_text, const std::string& evidence_text,
                      const std::vector<std::string>& query_texts, std::map<std::string, Marginal>& marginals) {
  Diagnostics diagnostics;
  const auto model = parse_model(model_text, "model.mln", diagnostics);
  const auto databases = parse_evidence(*model, evidence_text, "evidence.db", diagnostics);
  const auto query = parse_query(*model, databases->front(), query_texts, diagnostics);
  Monitor monitor;
  const GroundingResult grounded = ground(*model, databases->front(), *query, {}, monitor);
  InferenceOptions options;
  options.method = "mcsat";
  options.samples = 4000;
  InferenceResult result = infer(*grounded.network, options, monitor);
  for (std::size_t q = 0; q < result.marginals.size(); ++q) {
    marginals[grounded.network->atom_text(grounded.network->queries()[q].literal.atom())] = result.marginals[q];
  }
  return result;
}

std::string domain(const char* name, const char* prefix, int size) {
  std::string text = std::string(name) + " = {";
  for (int i = 0; i < size; ++i) text += (i > 0 ? ", " : "") + (prefix + std::to_string(i));
  return text + "}\n";
}

void expect_share(const std::map<std::string, Marginal>& marginals, const std::string& atom, double share) {
  const Marginal& found = marginals.at(atom);
  EXPECT_NEAR(found.probability, share, 4 * found.mcse.value() + 0.002) << atom;
}

const std::string kCoupling = "0.004 S(x) ^ S(y)\n";

// Either no Q is true and P is free, or all P are false: 2^8 worlds to 3^8 - 1.
TEST(Unlocking, GivesTwoModesTheirShares) {
  std::map<std::string, Marginal> marginals;
  const InferenceResult result =
      mcsat("P(t)\nQ(d?,t)\nS(u)\n!(EXIST k (Q(k,x)) ^ P(y)).\n" + kCoupling + "-0.001 P(T0) ^ S(y)\n",
            domain("t", "T", 8) + domain("d", "D", 2) + domain("u", "U", kUsers), {"P", "Q", "S"}, marginals);
  const double free = sum_over_users(0), tied = sum_over_users(1), worlds = std::pow(3.0, 8) - 1;
  expect_share(marginals, "P(T0)", 128 * tied / (128 * (tied + free) + worlds * free));
  EXPECT_TRUE(result.warnings.empty());
}

// A column of P has to be true as a whole before it can be chosen.
TEST(Unlocking, GivesAChoiceItsShares) {
  std::map<std::string, Marginal> marginals;
  mcsat(
      "P(t,d)\nb(d!)\nS(u)\nEXIST a (P(x,a) ^ b(a)).\nP(T0,D0) => P(x,D0).\n" + kCoupling + "-0.001 P(T0,D0) ^ S(y)\n",
      domain("t", "T", 8) + domain("d", "D", 5) + domain("u", "U", kUsers), {"P", "b", "S"}, marginals);
  const double free = sum_over_users(0), tied = sum_over_users(1);
  expect_share(marginals, "b(D0)", 256 * tied / (256 * tied + 4 * (tied + 128 * free)));
  expect_share(marginals, "P(T0,D0)", 260 * tied / (256 * tied + 4 * (tied + 128 * free)));
}

// What is tied is too wide: the result says what it rests on.
TEST(Unlocking, SaysWhereOnlyASearchLeadsOn) {
  std::map<std::string, Marginal> marginals;
  const InferenceResult result = mcsat(
      "P(t,d)\nlikes(t!,d!)\nQ(t,d,t)\nEXIST a (P(x,a) ^ EXIST k (likes(k,a))).\nP(T0,D0) => P(x,D0).\n"
      "1.8 (likes(x,y) <=> Q(x,y,x)) v EXIST b (P(b,y) v Q(b,y,b))\n",
      domain("t", "T", 5) + domain("d", "D", 5), {"P", "likes", "Q"}, marginals);
  ASSERT_EQ(result.warnings.size(), 1u);
  EXPECT_NE(result.warnings[0].find("compare with 'exact'"), std::string::npos);
}

}  // namespace
}  // namespace sherlog
