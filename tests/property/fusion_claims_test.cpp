// What the paper on information fusion says of its model, held against weights that were learned from scenes: context and
// company matter, and a good hint outweighs a wrong one.
#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <string>
#include <vector>

#include "learning/learn.h"
#include "learning/learned_model.h"
#include "mln/evidence.h"
#include "mln/model.h"
#include "perception_bridge/kitchen_generator.h"
#include "tests/support/marginals.h"

namespace sherlog {
namespace {

// The published formulas, learned from 300 synthetic scenes; once for all tests.
class LearnedFusion : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    Diagnostics diagnostics;
    const auto model =
        parse_model_file(SHERLOG_SOURCE_DIR "/models/information_fusion/experiment/paper.mln", diagnostics);
    ASSERT_TRUE(model) << diagnostics.render();
    KitchenTextOptions spelling;
    const auto databases =
        parse_evidence(*model, kitchen_text(default_kitchen(), 7, 300, spelling), "scenes.db", diagnostics);
    ASSERT_TRUE(databases) << diagnostics.render();
    LearningOptions options;
    options.method = "dpll";
    options.discriminative = {*model->find_predicate("object")};
    options.prior.stdev = 1.0;
    Monitor monitor;
    const LearningResult result = learn(*model, *databases, options, monitor);
    ASSERT_EQ(result.termination, Termination::kCompleted) << result.message;
    const WeightTable table(*result.model);
    std::vector<double> values;
    for (std::size_t w = 0; w < table.size(); ++w) {
      values.push_back(result.weights[w].weight);
      weights[weight_text(*result.model, table, w)] = values.back();
    }
    text = learned_model_text(*result.model, table, values, "");
  }
  static void TearDownTestSuite() { weights.clear(), text.clear(); }

  // Both orders of a pair, as they act on a scene.
  static double pair(const std::string& a, const std::string& b) {
    const auto one = weights.find("object(c1, " + a + ") ^ object(c2, " + b + ") ^ c1 != c2");
    const auto two = weights.find("object(c1, " + b + ") ^ object(c2, " + a + ") ^ c1 != c2");
    EXPECT_TRUE(one != weights.end() && two != weights.end()) << a << " " << b;
    return one == weights.end() || two == weights.end() ? 0.0 : one->second + two->second;
  }

  // Probabilities of the classes of cluster c1.
  static std::map<std::string, double> classes(const std::string& evidence) {
    return exact_marginals(text, evidence, {"object(c1,?o)"});
  }
  static std::string best(const std::map<std::string, double>& found) {
    std::string name;
    double probability = -1.0;
    for (const auto& [atom, p] : found) {
      if (p > probability) probability = p, name = atom;
    }
    return name;
  }

  static std::map<std::string, double> weights;
  static std::string text;
};

std::map<std::string, double> LearnedFusion::weights;
std::string LearnedFusion::text;

TEST_F(LearnedFusion, MilkGoesWithCerealsAndKetchupDoesNot) {
  const double difference = pair("Milk", "Corn_flakes") - pair("Corn_flakes", "Ketchup");
  EXPECT_GT(difference, 0.5);
  // Both pairs are formed as soon as cereals are there: the odds move by just that.
  const auto log_odds = [](const std::string& evidence) {
    const auto found = classes(evidence);
    return std::log(found.at("object(c1,Milk)") / found.at("object(c1,Ketchup)"));
  };
  const std::string seen = "scene(Breakfast)\ncolor(c1,White)\n";
  EXPECT_NEAR(log_odds(seen + "object(c2,Corn_flakes)\n") - log_odds(seen), difference, 1e-6);
}

TEST_F(LearnedFusion, ContextChangesWhatAThingIs) {
  const std::string seen = "shape(c1,Flat)\ncolor(c1,Black)\nscene(";
  const auto cooking = classes(seen + "Cooking)\n"), drawer = classes(seen + "Drawer)\n");
  EXPECT_GT(cooking.at("object(c1,Spatula)"), drawer.at("object(c1,Spatula)"));
  EXPECT_LT(cooking.at("object(c1,Fork)"), drawer.at("object(c1,Fork)"));
}

TEST_F(LearnedFusion, KnownLogoOutweighsAWrongShape) {
  const std::string seen = "color(c1,Yellow)\nscene(Breakfast)\ngoggles_Logo(c1,\"Kellogg's\")\nshape(c1,";
  EXPECT_EQ(best(classes(seen + "Box)\n")), "object(c1,Corn_flakes)");
  EXPECT_EQ(best(classes(seen + "Round)\n")), "object(c1,Corn_flakes)");
  // Without the logo the shape does make a difference.
  const std::string blind = "color(c1,Yellow)\nscene(Breakfast)\nshape(c1,";
  EXPECT_NE(best(classes(blind + "Box)\n")), best(classes(blind + "Round)\n")));
}

}  // namespace
}  // namespace sherlog
