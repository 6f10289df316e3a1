#include "perception_bridge/kitchen_generator.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <string>

#include "mln/evidence.h"
#include "mln/model.h"

namespace sherlog {
namespace {

using testing::HasSubstr;
using testing::Not;

// A few thousand scenes are enough for two digits.
std::vector<KitchenScene> scenes(const KitchenConfig& config, std::uint64_t count, std::uint64_t seed = 1) {
  std::vector<KitchenScene> result;
  for (std::uint64_t number = 0; number < count; ++number) {
    result.push_back(generate_kitchen_scene(config, seed, number));
  }
  return result;
}

std::vector<KitchenObject> objects(const std::vector<KitchenScene>& all) {
  std::vector<KitchenObject> result;
  for (const KitchenScene& scene : all) result.insert(result.end(), scene.objects.begin(), scene.objects.end());
  return result;
}

template <class Predicate>
double share(const std::vector<KitchenObject>& all, const Predicate& holds) {
  return static_cast<double>(std::count_if(all.begin(), all.end(), holds)) / static_cast<double>(all.size());
}

std::uint32_t class_index(const KitchenConfig& config, const std::string& name) {
  for (std::uint32_t c = 0; c < config.classes.size(); ++c) {
    if (config.classes[c].name == name) return c;
  }
  ADD_FAILURE() << name;
  return 0;
}

// Of the scenes with a `given`, those that have an `other` too.
double together(const KitchenConfig& config, const std::string& given, const std::string& other) {
  const std::uint32_t a = class_index(config, given), b = class_index(config, other);
  double with_a = 0, with_both = 0;
  for (const KitchenScene& scene : scenes(config, 4000)) {
    const auto has = [&](std::uint32_t c) {
      return std::any_of(scene.objects.begin(), scene.objects.end(),
                         [&](const KitchenObject& object) { return object.object_class == c; });
    };
    with_a += has(a) ? 1 : 0;
    with_both += has(a) && has(b) ? 1 : 0;
  }
  return with_both / with_a;
}

TEST(KitchenGenerator, DefaultKitchenIsSound) {
  const KitchenConfig config = default_kitchen();
  EXPECT_EQ(validate(config), "");
  EXPECT_EQ(config.classes.size(), 25u);
  EXPECT_EQ(config.contexts.size(), 4u);
}

TEST(KitchenGenerator, SameSeedGivesTheSameTextAndAnotherSeedAnother) {
  const KitchenConfig config = default_kitchen();
  EXPECT_EQ(kitchen_text(config, 7, 20), kitchen_text(config, 7, 20));
  EXPECT_NE(kitchen_text(config, 7, 20), kitchen_text(config, 8, 20));
}

TEST(KitchenGenerator, FewScenesAreTheBeginningOfMany) {
  const KitchenConfig config = default_kitchen();
  const std::string few = kitchen_text(config, 3, 5), many = kitchen_text(config, 3, 50);
  EXPECT_EQ(many.substr(0, few.size() + 4), few + "---\n");
}

// Pins the bits: a change of generator or of draws shows here. (A change of the default kitchen does not.)
TEST(KitchenGenerator, DrawsTheSameBitsEverywhere) {
  KitchenConfig config;
  config.contexts = {"Here", "There"};
  config.shapes = {"Round", "Flat", "Box"};
  config.colors = {"Red", "Blue"};
  config.context_frequency = {1, 1};
  config.object_counts = {0, 1, 1, 1};
  for (const char* name : {"A", "B", "C"}) {
    KitchenClass c;
    c.name = name;
    c.frequency = {1, 2};
    c.shapes = {1, 1, 1};
    c.colors = {1, 3};
    c.big = 0.5;
    config.classes.push_back(c);
  }
  config.second_shape = 0.5;
  ASSERT_EQ(validate(config), "");
  EXPECT_EQ(kitchen_text(config, 1, 3), R"(scene(Here)
shape(c1,Round)
color(c1,Blue)
size(c1,Small)
object(c1,C)
---
scene(Here)
shape(c1,Box)
color(c1,Blue)
size(c1,Big)
object(c1,C)
shape(c2,Box)
shape(c2,Flat)
color(c2,Blue)
size(c2,Big)
object(c2,A)
---
scene(Here)
shape(c1,Flat)
shape(c1,Round)
color(c1,Blue)
size(c1,Big)
object(c1,C)
shape(c2,Round)
color(c2,Red)
size(c2,Small)
object(c2,C)
shape(c3,Box)
shape(c3,Round)
color(c3,Red)
size(c3,Small)
object(c3,B)
)");
}

TEST(KitchenGenerator, TextParsesAgainstTheShippedPredicates) {
  const std::string folder = SHERLOG_SOURCE_DIR "/models/information_fusion/";
  for (const bool all : {true, false}) {
    Diagnostics diagnostics;
    const auto model = parse_model_file(folder + (all ? "kitchen_predicates.mln" : "predicates.mln"), diagnostics);
    ASSERT_TRUE(model) << diagnostics.render();
    KitchenTextOptions options;
    options.all_annotators = all;
    const KitchenConfig config = default_kitchen();
    const std::size_t before = diagnostics.warning_count();
    const auto databases = parse_evidence(*model, kitchen_text(config, 5, 200, options), "scenes", diagnostics);
    ASSERT_TRUE(databases) << diagnostics.render();
    EXPECT_EQ(diagnostics.warning_count(), before) << diagnostics.render();  // no constant that a domain does not list
    ASSERT_EQ(databases->size(), 200u);
    const PredicateId object = *model->find_predicate("object"), place = *model->find_predicate("scene");
    for (std::size_t i = 0; i < databases->size(); ++i) {
      const KitchenScene scene = generate_kitchen_scene(config, 5, i);
      EXPECT_EQ((*databases)[i].of(object).size(), scene.objects.size());
      EXPECT_EQ((*databases)[i].of(place).size(), 1u);
    }
  }
}

TEST(KitchenGenerator, RecordedSpellingIsLowerCaseWithoutBlanks) {
  KitchenTextOptions options;
  options.spelling = KitchenSpelling::kRecorded;
  const std::string text = kitchen_text(default_kitchen(), 5, 200, options);
  EXPECT_THAT(text, HasSubstr("scene(breakfast)\n"));
  EXPECT_THAT(text, HasSubstr(",round)\n"));
  EXPECT_THAT(text, HasSubstr(",Dr_Oetker)\n"));
  EXPECT_THAT(text, HasSubstr(",Milk)\n"));
  EXPECT_THAT(text, Not(HasSubstr(",Round)")));
  EXPECT_EQ(text.find(' '), std::string::npos);
}

TEST(KitchenGenerator, UnlabelledScenesDifferByTheLabelsOnly) {
  KitchenTextOptions options;
  const KitchenConfig config = default_kitchen();
  std::string labelled = kitchen_text(config, 2, 30, options);
  options.labels = false;
  const std::string unlabelled = kitchen_text(config, 2, 30, options);
  EXPECT_THAT(unlabelled, Not(HasSubstr("object(")));
  for (std::size_t at = labelled.find("object("); at != std::string::npos; at = labelled.find("object(")) {
    labelled.erase(at, labelled.find('\n', at) + 1 - at);
  }
  EXPECT_EQ(labelled, unlabelled);
}

TEST(KitchenGenerator, ScenesHoldTwoToEightObjectsInFourContexts) {
  const auto all = scenes(default_kitchen(), 4000);
  std::vector<double> contexts(4, 0.0);
  double sum = 0;
  for (const KitchenScene& scene : all) {
    EXPECT_GE(scene.objects.size(), 2u);
    EXPECT_LE(scene.objects.size(), 8u);
    sum += static_cast<double>(scene.objects.size());
    contexts[scene.context] += 1.0 / 4000.0;
  }
  // Means of the config's tables; four standard errors.
  EXPECT_NEAR(sum / 4000.0, 245.0 / 50.0, 4 * 1.4 / std::sqrt(4000.0));
  const std::vector<double> expected{.5, .24, .14, .12};
  for (std::size_t i = 0; i < 4; ++i) EXPECT_NEAR(contexts[i], expected[i], 4 * 0.5 / std::sqrt(4000.0));
}

TEST(KitchenGenerator, ClassesStayInTheirContexts) {
  const KitchenConfig config = default_kitchen();
  std::set<std::uint32_t> seen;
  for (const KitchenScene& scene : scenes(config, 4000)) {
    for (const KitchenObject& object : scene.objects) {
      EXPECT_GT(config.classes[object.object_class].frequency[scene.context], 0.0);
      seen.insert(object.object_class);
    }
  }
  EXPECT_EQ(seen.size(), 25u);
}

TEST(KitchenGenerator, ShapesAndColoursAreDistinctAndSometimesSeveral) {
  const auto all = objects(scenes(default_kitchen(), 4000));
  const double size = static_cast<double>(all.size());
  for (const KitchenObject& object : all) {
    EXPECT_EQ(std::set(object.shapes.begin(), object.shapes.end()).size(), object.shapes.size());
    EXPECT_EQ(std::set(object.colors.begin(), object.colors.end()).size(), object.colors.size());
    EXPECT_LE(object.shapes.size(), 2u);
  }
  EXPECT_NEAR(share(all, [](const auto& o) { return o.shapes.size() == 2; }), 0.48, 2 / std::sqrt(size));
  EXPECT_NEAR(share(all, [](const auto& o) { return o.colors.size() >= 2; }), 0.13, 2 / std::sqrt(size));
  EXPECT_NEAR(share(all, [](const auto& o) { return !o.big; }), 0.016, 0.005);
}

TEST(KitchenGenerator, ConfusionIsAsFrequentAsConfigured) {
  KitchenConfig config = default_kitchen();
  config.second_shape = config.another_color = 0;
  for (KitchenClass& c : config.classes) {
    c.shapes = {1, 0, 0};
    c.colors = {0, 0, 0, 0, 0, 1};
  }
  const auto all = objects(scenes(config, 4000));
  EXPECT_NEAR(share(all, [](const auto& o) { return o.shapes[0] != 0; }), 0.1, 0.012);
  EXPECT_NEAR(share(all, [](const auto& o) { return o.colors[0] != 5; }), 0.1, 0.012);
  EXPECT_GT(share(all, [](const auto& o) { return o.shapes[0] == 2; }), 0.03);
}

// Counts of the paper's Fig. 6 over 587 clusters: 48 texts, 66 logos, 62 similar images and 56 user results, 37 products.
TEST(KitchenGenerator, AnnotatorsAreAsSilentAsThoseOfThePaper) {
  const auto all = objects(scenes(default_kitchen(), 6000));
  EXPECT_NEAR(share(all, [](const auto& o) { return o.text.has_value(); }), 48.0 / 587, 0.01);
  EXPECT_NEAR(share(all, [](const auto& o) { return o.logo.has_value(); }), 66.0 / 587, 0.01);
  EXPECT_NEAR(share(all, [](const auto& o) { return o.image.has_value(); }), 118.0 / 587, 0.015);
  EXPECT_NEAR(share(all, [](const auto& o) { return o.product.has_value(); }), 37.0 / 587, 0.01);
}

TEST(KitchenGenerator, DetectorIsMostlySilentAndRightAboutHalfOfTheTime) {
  const KitchenConfig config = default_kitchen();
  auto all = objects(scenes(config, 6000));
  EXPECT_NEAR(share(all, [](const auto& o) { return o.detected.has_value(); }), 91.0 / 245, 0.06);
  all.erase(std::remove_if(all.begin(), all.end(), [](const auto& o) { return !o.detected; }), all.end());
  EXPECT_NEAR(share(all, [&](const auto& o) { return *o.detected == config.classes[o.object_class].name; }), 0.5, 0.03);
  for (const KitchenObject& object : all) EXPECT_TRUE(config.classes[object.object_class].detectable);
}

TEST(KitchenGenerator, ThingsThatBelongTogetherStandTogether) {
  KitchenConfig config = default_kitchen();
  const double milk = together(config, "Corn_flakes", "Milk");
  config.pairs.clear();
  EXPECT_GT(milk, together(config, "Corn_flakes", "Milk") + 0.1);
  config.same_class = 0;
  for (const KitchenScene& scene : scenes(config, 500)) {
    std::set<std::uint32_t> classes;
    for (const KitchenObject& object : scene.objects) classes.insert(object.object_class);
    EXPECT_EQ(classes.size(), scene.objects.size());
  }
}

TEST(KitchenGenerator, BadConfigsAreNamed) {
  const auto problem_of = [](const auto& change) {
    KitchenConfig config = default_kitchen();
    change(config);
    return validate(config);
  };
  EXPECT_THAT(problem_of([](auto& c) { c.context_frequency.pop_back(); }),
              HasSubstr("context_frequency: 3 numbers, 4"));
  EXPECT_THAT(problem_of([](auto& c) { c.object_counts = {}; }), HasSubstr("object_counts"));
  EXPECT_THAT(problem_of([](auto& c) { c.classes[3].shapes[0] = -1; }), HasSubstr("Knife: shapes: -1"));
  EXPECT_THAT(problem_of([](auto& c) { c.classes[3].colors = {0, 0, 0, 0, 0, 0}; }),
              HasSubstr("no weight is positive"));
  EXPECT_THAT(problem_of([](auto& c) { c.classes[3].frequency.pop_back(); }), HasSubstr("one frequency for each"));
  EXPECT_THAT(problem_of([](auto& c) { c.pairs.push_back({"Milk", "Honey", 2}); }), HasSubstr("no class 'Honey'"));
  EXPECT_THAT(problem_of([](auto& c) { c.second_shape = 1.5; }), HasSubstr("1.5 is not a probability"));
  EXPECT_THAT(problem_of([](auto& c) { c.detector.rate = -0.1; }), HasSubstr("both are probabilities"));
  EXPECT_THAT(problem_of([](auto& c) { c.same_class = std::nan(""); }), HasSubstr("same_class"));
  EXPECT_THAT(problem_of([](auto& c) {
                for (auto& k : c.classes) k.frequency[2] = 0;
              }),
              HasSubstr("context 'Drawer' has no classes"));
}

}  // namespace
}  // namespace sherlog
