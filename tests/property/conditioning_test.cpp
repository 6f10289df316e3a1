// Conditioning: P(A | B) = P(A and B) / P(B), whichever way it is asked.
//
// The class given the annotations (Eq. 3 of the paper on information fusion), the joint probability of class and
// annotations (Eq. 4) and the annotation to be expected of a class are the same distribution seen from three sides. Here the
// left side is asked with B as evidence, the right side as two ground formulas with everything open, and on models small
// enough also as a sum over all worlds.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <map>
#include <random>
#include <string>
#include <vector>

#include "grounding/ground.h"
#include "inference/inference.h"
#include "mln/evidence.h"
#include "mln/model.h"
#include "mln/query.h"
#include "tests/oracles/enumeration.h"

namespace sherlog {
namespace {

int random_models() {
  const char* wanted = std::getenv("SHERLOG_RANDOM_MODELS");
  return wanted != nullptr ? std::max(1, std::atoi(wanted)) : 200;
}

// Probabilities by the text of what was asked; `by_worlds`: summed over all worlds instead.
std::map<std::string, double> ask(const Model& model, const std::string& evidence,
                                  const std::vector<std::string>& queries, bool by_worlds = false) {
  Diagnostics diagnostics;
  const auto databases = parse_evidence(model, evidence, "e.db", diagnostics);
  EXPECT_TRUE(databases) << diagnostics.render();
  const auto query = parse_query(model, databases->front(), queries, diagnostics);
  EXPECT_TRUE(query) << diagnostics.render();
  Monitor monitor;
  GroundingOptions grounding;
  grounding.open_world_all = true;
  const GroundingResult grounded = ground(model, databases->front(), *query, grounding, monitor);
  EXPECT_TRUE(grounded.network) << grounded.message;
  const GroundNetwork& network = *grounded.network;
  InferenceOptions options;
  options.method = "exact";
  const InferenceResult result = infer(network, options, monitor);
  EXPECT_EQ(result.termination, Termination::kCompleted) << result.message;
  std::map<std::string, double> found;
  oracle::Enumeration enumeration;
  if (by_worlds) enumeration = oracle::enumerate(network);
  for (std::size_t q = 0; q < network.queries().size(); ++q) {
    const QueryTarget& target = network.queries()[q];
    const std::string name = target.is_formula ? target.formula_text : network.atom_text(target.literal.atom());
    found[name] = by_worlds ? enumeration.marginals[q] : result.marginals[q].probability;
  }
  return found;
}

double ask_one(const Model& model, const std::string& evidence, const std::string& query, bool by_worlds = false) {
  const auto found = ask(model, evidence, {query}, by_worlds);
  EXPECT_EQ(found.size(), 1u) << query;
  return found.empty() ? NAN : found.begin()->second;
}

Model model_of(const std::string& text) {
  Diagnostics diagnostics;
  auto model = parse_model(text, "m.mln", diagnostics);
  EXPECT_TRUE(model) << diagnostics.render() << text;
  return std::move(*model);
}

// Two things with a class each, their annotations, and formulas between all of these.
std::string random_text(std::mt19937_64& random) {
  std::string text =
      "cluster = {C1, C2}\nkind = {Cereal, Bowl, Milk}\nform = {Box, Round}\nbrand = {Oetker}\nplace = {Breakfast}\n"
      "object(cluster, kind!)\nshape(cluster, form?)\nlogo(cluster, brand)\nscene(place)\n";
  static const char* const kFormulas[] = {"shape(c, Box) ^ object(c, Cereal)",
                                          "shape(c, Round) ^ object(c, Bowl)",
                                          "shape(c, f)",
                                          "logo(c, Oetker) ^ object(c, Cereal)",
                                          "logo(c, Oetker) => shape(c, Box)",
                                          "scene(Breakfast) ^ object(c, Milk)",
                                          "object(a, Milk) ^ object(b, Cereal) ^ a != b",
                                          "object(a, k) ^ object(b, k) ^ a != b",
                                          "(EXIST c (object(c, Bowl))) <=> scene(Breakfast)"};
  for (const char* formula : kFormulas) {
    if (random() % 4 == 0) continue;
    text += std::to_string(std::uniform_real_distribution<double>(-2, 2)(random)) + " " + formula + "\n";
  }
  if (random() % 3 == 0) text += "logo(c, Oetker) => !object(c, Bowl).\n";
  return text;
}

TEST(Conditioning, IsTheRatioOfJointProbabilitiesInBothDirections) {
  std::mt19937_64 random(77);
  const char* const kAnnotations[] = {"shape(C1,Box)", "logo(C1,Oetker)", "scene(Breakfast)", "shape(C2,Round)"};
  const char* const kClasses[] = {"object(C1,Cereal)", "object(C1,Milk)", "object(C2,Bowl)"};
  for (int number = 0; number < std::min(60, random_models()); ++number) {
    const std::string text = random_text(random);
    SCOPED_TRACE(text);
    const Model model = model_of(text);
    std::string given, lines;
    for (const char* annotation : kAnnotations) {
      if (random() % 2 == 0) continue;
      const std::string sign = random() % 4 == 0 ? "!" : "";
      given += (given.empty() ? "" : " ^ ") + sign + annotation;
      lines += sign + annotation + "\n";
    }
    if (given.empty()) given = "shape(C1,Box)", lines = given + "\n";
    const double evidence = ask_one(model, "", given, true);
    EXPECT_NEAR(ask_one(model, "", given), evidence, 1e-9);
    for (const std::string kind : kClasses) {
      const double joint = ask_one(model, "", kind + " ^ " + given, true);
      EXPECT_NEAR(ask_one(model, "", kind + " ^ " + given), joint, 1e-9) << kind;
      // Eq. 3 from Eq. 4.
      EXPECT_NEAR(ask_one(model, lines, kind), joint / evidence, 1e-9) << kind;
      // The other direction: the annotations to be expected of the class.
      const double prior = ask_one(model, "", kind, true);
      if (prior < 1e-6) continue;
      EXPECT_NEAR(ask_one(model, kind + "\n", given), joint / prior, 1e-9) << kind;
    }
  }
}

TEST(Conditioning, HoldsForTheShippedFusionModel) {
  Diagnostics diagnostics;
  const std::string folder = SHERLOG_SOURCE_DIR "/models/information_fusion/";
  const auto model = parse_model_file(folder + "fusion.mln", diagnostics);
  ASSERT_TRUE(model) << diagnostics.render();
  const std::string given = "shape(C1,Box) ^ color(C1,Yellow) ^ goggles_Logo(C1,\"Dr Oetker\") ^ scene(Breakfast)";
  const std::string lines = "shape(C1,Box)\ncolor(C1,Yellow)\ngoggles_Logo(C1,\"Dr Oetker\")\nscene(Breakfast)\n";
  const std::string domain = "cluster = {C1}\n";
  const auto classes = ask(*model, domain + lines, {"object"});
  ASSERT_EQ(classes.size(), 25u);
  std::vector<std::string> joints = {given};
  for (const auto& [atom, probability] : classes) joints.push_back(atom + " ^ " + given);
  std::map<std::string, double> joint;
  for (const std::string& formula : joints) joint[formula] = ask_one(*model, domain, formula);
  double sum = 0.0;
  std::string best, best_joint;
  double best_probability = 0.0, best_joint_probability = 0.0;
  for (const auto& [atom, probability] : classes) {
    const double both = joint.at(atom + " ^ " + given);
    EXPECT_NEAR(probability, both / joint.at(given), 1e-9) << atom;
    sum += both;
    if (probability > best_probability) best_probability = probability, best = atom;
    if (both > best_joint_probability) best_joint_probability = both, best_joint = atom;
  }
  EXPECT_NEAR(sum, joint.at(given), 1e-12);
  EXPECT_EQ(best, best_joint);  // what is most probable given the rest is so together with it
  EXPECT_EQ(best, "object(C1,Vitalis_Cereals)");
}

// Which logo is to be expected on a box of cereals at breakfast: P(logo | rest) from the joint.
TEST(Conditioning, ExpectedAnnotationOfAClassIsARatioAsWell) {
  Diagnostics diagnostics;
  const auto model = parse_model_file(SHERLOG_SOURCE_DIR "/models/information_fusion/fusion.mln", diagnostics);
  ASSERT_TRUE(model) << diagnostics.render();
  const std::string domain = "cluster = {C1}\n";
  const std::string given = "shape(C1,Box) ^ object(C1,Vitalis_Cereals) ^ scene(Breakfast)";
  const std::string lines = "shape(C1,Box)\nobject(C1,Vitalis_Cereals)\nscene(Breakfast)\n";
  const auto logos = ask(*model, domain + lines, {"goggles_Logo(C1,?l)"});
  ASSERT_FALSE(logos.empty());
  const double evidence = ask_one(*model, domain, given);
  std::string best;
  double best_probability = 0.0;
  for (const auto& [atom, probability] : logos) {
    EXPECT_NEAR(probability, ask_one(*model, domain, atom + " ^ " + given) / evidence, 1e-9) << atom;
    if (probability > best_probability) best_probability = probability, best = atom;
  }
  EXPECT_EQ(best, "goggles_Logo(C1,\"Dr Oetker\")");
}

}  // namespace
}  // namespace sherlog
