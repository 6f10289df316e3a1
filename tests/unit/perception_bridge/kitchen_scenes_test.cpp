#include "perception_bridge/kitchen_scenes.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace sherlog {
namespace {

using testing::IsEmpty;

TEST(KitchenScene, IsAGoodSceneAndComesOutAsItWentIn) {
  for (std::uint64_t number = 0; number < 40; ++number) {
    const Scene scene = kitchen_scene(default_kitchen(), 5, number);
    EXPECT_THAT(validate(scene), IsEmpty());
    EXPECT_EQ(scene.timestamp, KitchenSceneOptions{}.start + 600 * static_cast<double>(number));
    SceneMessages messages;
    EXPECT_EQ(scene_from_json(scene_to_json(scene), messages), scene);
    EXPECT_THAT(messages.warnings, IsEmpty()) << "every type is known";
    for (const Cluster& cluster : scene.clusters) EXPECT_TRUE(position_of(cluster));
  }
}

TEST(KitchenScene, HasTheObjectsOfTheGeneratedOne) {
  for (std::uint64_t number = 0; number < 40; ++number) {
    EXPECT_EQ(kitchen_scene(default_kitchen(), 5, number).clusters.size(),
              generate_kitchen_scene(default_kitchen(), 5, number).objects.size());
  }
}

TEST(KitchenScene, DependsOnSeedAndNumberAlone) {
  EXPECT_EQ(kitchen_scene(default_kitchen(), 5, 7), kitchen_scene(default_kitchen(), 5, 7));
  EXPECT_NE(kitchen_scene(default_kitchen(), 5, 7), kitchen_scene(default_kitchen(), 6, 7));
}

TEST(KitchenScene, LabelsAreLeftOutWhereTheyAreNotWanted) {
  const auto labels = [](const Scene& scene) {
    std::size_t count = 0;
    for (const Cluster& cluster : scene.clusters)
      count += annotations_of(cluster.annotations, "rs.annotation.GroundTruth").size();
    return count;
  };
  const Scene with = kitchen_scene(default_kitchen(), 5, 1),
              without = kitchen_scene(default_kitchen(), 5, 1, {.labels = false});
  EXPECT_EQ(labels(with), with.clusters.size());
  EXPECT_EQ(labels(without), 0u);
  EXPECT_EQ(with.clusters.size(), without.clusters.size());
}

}  // namespace
}  // namespace sherlog
