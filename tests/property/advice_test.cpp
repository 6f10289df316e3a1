// Advice is worth following: on scenes that nobody tuned it for, what it names tells at least as much as a random choice.
#include "inference/advice.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <random>
#include <set>
#include <string>
#include <vector>

#include "perception_bridge/kitchen_generator.h"

namespace sherlog {
namespace {

constexpr const char* kAnnotators[] = {"color", "size", "goggles_Logo", "goggles_Text", "linemod"};

// What one annotator says of a thing, by name.
std::set<std::string> report(const KitchenConfig& config, const KitchenObject& object, const std::string& annotator) {
  std::set<std::string> values;
  if (annotator == "shape") {
    for (const std::uint32_t shape : object.shapes) values.insert(config.shapes[shape]);
  } else if (annotator == "color") {
    for (const std::uint32_t color : object.colors) values.insert(config.colors[color]);
  } else if (annotator == "size") {
    if (object.big) values.insert(*object.big ? "Big" : "Small");
  } else {
    const auto& value = annotator == "goggles_Logo"   ? object.logo
                        : annotator == "goggles_Text" ? object.text
                                                      : object.detected;
    if (value) values.insert(*value);
  }
  return values;
}

// Naive Bayes counted on other scenes: each atom of an annotator is true with a probability of its class.
struct Counted {
  std::string model;
  std::map<std::string, std::set<std::string>> values;  // by annotator
};

Counted count(const KitchenConfig& config) {
  Counted result;
  std::vector<double> things(config.classes.size(), 0);
  std::map<std::string, std::map<std::string, std::vector<double>>> seen;
  for (std::uint64_t number = 0; number < 2000; ++number) {
    for (const KitchenObject& object : generate_kitchen_scene(config, 1, number).objects) {
      ++things[object.object_class];
      for (const char* annotator : {"shape", "color", "size", "goggles_Logo", "goggles_Text", "linemod"}) {
        for (const std::string& value : report(config, object, annotator)) {
          auto& counts = seen[annotator][value];
          counts.resize(config.classes.size(), 0);
          ++counts[object.object_class];
        }
      }
    }
  }
  std::vector<double> prior;
  for (const double n : things) prior.push_back(std::log(n + 1));
  result.model = "object(cluster, object!)\n";
  for (const auto& [annotator, by_value] : seen) {
    result.model += fmt::format("{}(cluster, {}Value)\n", annotator, annotator);
    for (const auto& [value, counts] : by_value) {
      result.values[annotator].insert(value);
      for (std::size_t c = 0; c < things.size(); ++c) {
        const double p = (counts[c] + 0.5) / (things[c] + 1);
        prior[c] += std::log(1 - p);
        result.model += fmt::format("{:.17g} {}(x, {}) ^ object(x, {})\n", std::log(p / (1 - p)), annotator,
                                    quoted_constant(value), config.classes[c].name);
      }
    }
  }
  for (std::size_t c = 0; c < things.size(); ++c) {
    result.model += fmt::format("{:.17g} object(x, {})\n", prior[c], config.classes[c].name);
  }
  return result;
}

TEST(Advice, TellsAtLeastAsMuchAsARandomChoice) {
  // A small kitchen: eight classes, one or two things a scene.
  KitchenConfig config = default_kitchen();
  const std::set<std::string> kept{"Bowl", "Knife", "Plate", "Spatula", "Corn_flakes", "Milk", "Ketchup", "Oil"};
  std::erase_if(config.classes, [&](const KitchenClass& c) { return !kept.contains(c.name); });
  std::erase_if(config.pairs,
                [&](const KitchenPair& pair) { return !kept.contains(pair.first) || !kept.contains(pair.second); });
  config.object_counts = {0, 1, 1};
  ASSERT_EQ(validate(config), "");
  const Counted counted = count(config);
  Diagnostics diagnostics;
  const auto model = parse_model(counted.model, "counted", diagnostics);
  ASSERT_TRUE(model) << diagnostics.render();
  std::vector<AnnotatorCost> annotators;
  AdviceOptions options;
  options.information.inference.threads = 1;
  for (const char* name : kAnnotators) {
    annotators.push_back({name, 1.0, {*model->find_predicate(name)}});
    options.grounding.open_world.push_back(annotators.back().predicates.front());
  }
  Monitor monitor;
  const auto read = [&](const std::string& text) {
    return parse_evidence(*model, text, "scene", diagnostics)->front();
  };
  const auto entropy = [&](const Evidence& evidence, const Query& query) {
    const GroundingResult grounded = ground(*model, evidence, query, options.grounding, monitor);
    return query_entropy(*grounded.network, options.information.inference, monitor).marginal;
  };

  std::mt19937_64 random(7);
  double advised = 0, by_chance = 0, expected = 0;
  constexpr std::uint64_t kScenes = 200;
  for (std::uint64_t number = 0; number < kScenes; ++number) {
    const KitchenScene scene = generate_kitchen_scene(config, 2, number);
    std::string text;
    for (std::size_t i = 0; i < scene.objects.size(); ++i) {
      text += fmt::format("cluster = {{C{}}}\n", i);
      for (const std::string& value : report(config, scene.objects[i], "shape")) {
        text += fmt::format("shape(C{},{})\n", i, value);
      }
    }
    const Evidence evidence = read(text);
    const auto query = parse_query(*model, evidence, {"object"}, diagnostics);
    ASSERT_TRUE(query) << diagnostics.render();
    const AdviceResult result = advise(*model, evidence, *query, annotators, options, monitor);
    ASSERT_EQ(result.termination, Termination::kCompleted) << result.message;
    ASSERT_EQ(result.advice.size(), scene.objects.size() * std::size(kAnnotators));
    // Runs the annotator: all of its atoms about the thing become known.
    const auto drop = [&](const Advice& advice) {
      const std::string& annotator = annotators[advice.annotator].name;
      const KitchenObject& object = scene.objects[std::stoul(advice.cluster[0].substr(1))];
      const std::set<std::string> said = report(config, object, annotator);
      std::string more = text;
      for (const std::string& value : counted.values.at(annotator)) {
        more += fmt::format("{}{}({},{})\n", said.contains(value) ? "" : "!", annotator, advice.cluster[0],
                            quoted_constant(value));
      }
      return result.entropy.marginal - entropy(read(more), *query);
    };
    for (const Advice& advice : result.advice) EXPECT_GE(advice.expected_entropy_drop, 0.0);
    advised += drop(result.advice.front());
    by_chance += drop(result.advice[random() % result.advice.size()]);
    expected += result.advice.front().expected_entropy_drop;
  }
  EXPECT_GE(advised, by_chance);
  // The things are independent of each other here, so that the drops are what was promised, up to chance and to the
  // model's mistakes.
  EXPECT_NEAR(advised / kScenes, expected / kScenes, 0.15);
  EXPECT_GT(expected / kScenes, 0.3);
}

}  // namespace
}  // namespace sherlog
