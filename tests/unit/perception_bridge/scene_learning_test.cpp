#include "perception_bridge/scene_learning.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <map>
#include <random>

#include "tests/unit/perception_bridge/tracking_scenes.h"

namespace sherlog {
namespace {

using testing::HasSubstr;

struct World {
  double color_noise = 0.03, place_noise = 0.02;
  double moves = 0.15, goes = 0.1;  // probabilities, of each thing before each scene
};

Annotation label(const std::string& name) { return made("rs.annotation.GroundTruth", {{"object", Value(name)}}); }

// Things that are carried about a table of a square metre, as a noisy camera sees them; each cluster is labelled.
std::vector<Scene> recording(const World& world, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> uniform(0, 1);
  std::normal_distribution<double> noise(0, 1);
  std::vector<Thing> things(6);
  std::vector<bool> here(things.size(), true);
  for (Thing& thing : things) {
    thing.x = uniform(random), thing.y = uniform(random);
    for (double& channel : thing.color) channel = uniform(random);
  }
  std::vector<Scene> scenes;
  for (int step = 0; step < 6; ++step) {
    std::vector<Thing> seen;
    std::vector<std::string> names;
    for (std::size_t i = 0; i < things.size(); ++i) {
      if (step > 0 && uniform(random) < world.goes) here[i] = !here[i];
      if (step > 0 && uniform(random) < world.moves) things[i].x = uniform(random), things[i].y = uniform(random);
      if (!here[i]) continue;
      Thing look = things[i];
      look.x += world.place_noise * noise(random), look.y += world.place_noise * noise(random);
      for (double& channel : look.color) channel += world.color_noise * noise(random);
      seen.push_back(look);
      names.push_back(fmt::format("thing {}", i));
    }
    scenes.push_back(scene_of(step, seen));
    for (std::size_t n = 0; n < names.size(); ++n) scenes.back().clusters[n].annotations.push_back(label(names[n]));
  }
  return scenes;
}

SceneTraining training_of(const World& world, std::uint64_t recordings) {
  SceneTraining training;
  for (std::uint64_t seed = 1; seed <= recordings; ++seed) training.recordings.push_back(recording(world, seed));
  training.mapping = *shipped_mapping("identity");
  return training;
}

LearnedScenes learned_from(const SceneTraining& training) {
  Monitor monitor;
  return learn_from_scenes(training, monitor);
}

// The share of clusters in fresh recordings that are taken for what they are.
double share_right(const World& world, std::string_view model, const EvidenceMapping& mapping) {
  double right = 0, total = 0;
  for (std::uint64_t seed = 1001; seed <= 1025; ++seed) {
    Diagnostics diagnostics;
    std::string problem;
    auto tracker = SceneTracker::make(*parse_model(model, "model", diagnostics), mapping, {}, {}, problem);
    EXPECT_TRUE(tracker) << problem;
    std::map<std::string, std::string> first;  // true name -> object
    for (const Scene& scene : recording(world, seed)) {
      const TrackingStep step = fed(*tracker, scene);
      for (std::size_t n = 0; n < scene.clusters.size(); ++n) {
        const std::string name = true_object(scene.clusters[n]);
        const auto known = first.find(name);
        if (known != first.end()) {
          right += known->second == step.clusters[n].object ? 1 : 0;
          ++total;
        } else {
          first.emplace(name, step.clusters[n].object);
        }
      }
    }
  }
  return right / total;
}

double place_sigma(const EvidenceMapping& mapping) {
  const auto rule = std::ranges::find(mapping.similarity.rules, DistanceKind::kPosition, &SimilarityRule::distance);
  return rule->sigma;
}

TEST(SceneLearning, FindsTheSpreadOfPlacesAmongThingsThatWereMoved) {
  for (const double noise : {0.02, 0.04}) {
    World world;
    world.place_noise = noise;
    const LearnedScenes learned = learned_from(training_of(world, 20));
    ASSERT_EQ(learned.termination, Termination::kCompleted) << learned.message;
    EXPECT_NEAR(place_sigma(learned.mapping), noise, 0.15 * noise);
    EXPECT_GT(learned.log_likelihood, learned.log_likelihood_before);
  }
}

TEST(SceneLearning, PlacesAreNotKnownToLessThanACentimetre) {
  World world;
  world.place_noise = 0.0005;
  const LearnedScenes learned = learned_from(training_of(world, 5));
  EXPECT_DOUBLE_EQ(place_sigma(learned.mapping), 0.01);
}

TEST(SceneLearning, WhatIsLearnedKnowsMoreThanTable1) {
  const World world;
  const LearnedScenes learned = learned_from(training_of(world, 20));
  ASSERT_EQ(learned.termination, Termination::kCompleted) << learned.message;
  const double with_learned = share_right(world, learned.model, learned.mapping);
  const double with_table1 = share_right(world, paper_identity_model(), *shipped_mapping("identity"));
  EXPECT_GE(with_learned, 0.97);
  EXPECT_GT(with_learned, with_table1);
}

TEST(SceneLearning, HowOftenThingsMoveIsInTheWeights) {
  World calm, restless;
  calm.moves = 0.03;
  restless.moves = 0.5;
  const LearnedScenes one = learned_from(training_of(calm, 15)), other = learned_from(training_of(restless, 15));
  EXPECT_GT(one.weights[0] - one.weights[1], other.weights[0] - other.weights[1]);
}

TEST(SceneLearning, ClustersWithoutALabelTeachNothing) {
  SceneTraining training = training_of({}, 5);
  const LearnedScenes before = learned_from(training);
  for (std::vector<Scene>& scenes : training.recordings) {
    for (Scene& scene : scenes) {
      Cluster stranger = scene.clusters.front();
      stranger.id = "stranger";
      std::erase_if(stranger.annotations, [](const Annotation& a) { return a.type == "rs.annotation.GroundTruth"; });
      scene.clusters.push_back(stranger);
    }
  }
  const LearnedScenes after = learned_from(training);
  EXPECT_EQ(after.model, before.model);
  EXPECT_EQ(after.same_pairs, before.same_pairs);
}

TEST(SceneLearning, SaysWhatItLacks) {
  SceneTraining training = training_of({}, 3);
  training.mapping = *shipped_mapping("fusion");
  EXPECT_THAT(learned_from(training).message, HasSubstr("no pair rule for 'similar'"));
  training = training_of({}, 3);
  for (std::vector<Scene>& scenes : training.recordings) {
    for (Scene& scene : scenes) {
      for (Cluster& cluster : scene.clusters) cluster.annotations.pop_back();
    }
  }
  const LearnedScenes learned = learned_from(training);
  EXPECT_EQ(learned.termination, Termination::kRefused);
  EXPECT_THAT(learned.message, HasSubstr("0 labelled steps"));
}

}  // namespace
}  // namespace sherlog
