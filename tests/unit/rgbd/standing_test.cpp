// What stands on a table and what does not, from wherever one looks: far away, from above, over what gives no depth.
#include <gtest/gtest.h>

#include <numbers>

#include "rgbd/objects/shape.h"
#include "tests/support/shot.h"

namespace sherlog::rgbd {
namespace {

using Eigen::Vector3d;
using Names = std::multiset<std::string>;

const Vector3d kTableMiddle(0, 1.15, kTableHeight);

Shot shot_from(double distance, double elevation_degrees) {
  Shot shot;
  const double turn = elevation_degrees * std::numbers::pi / 180;
  shot.camera = look_at(kTableMiddle + distance * Vector3d(0, -std::cos(turn), std::sin(turn)), kTableMiddle);
  return shot;
}

TEST(Standing, ThingsAreFoundFromFarAwayAndFromAbove) {
  for (const double distance : {1.0, 1.8, 2.3}) {
    for (const double elevation : {35.0, 60.0, 85.0}) {
      Shot shot = shot_from(distance, elevation);
      shot.add_body(BodyShape::kBox, "carton", {0.1, 0.08, 0.2}, -0.3, 1.2, 0.1);
      shot.add_body(BodyShape::kCylinder, "can", {0.09, 0.09, 0.12}, 0, 1.1, 0.06);
      shot.add_body(BodyShape::kBox, "box", {0.2, 0.15, 0.1}, 0.3, 1.1, 0.05);
      shot.take();
      const Hypotheses found = shot.find();
      EXPECT_EQ(found.reaching, 0U) << distance << " m, " << elevation << " degrees";
      EXPECT_EQ(shot.names(found), (Names{"box", "can", "carton"})) << distance << " m, " << elevation << " degrees";
    }
  }
}

TEST(Standing, BallsAreRoundAndOnTheTable) {
  for (const double elevation : {25.0, 35.0, 50.0, 65.0}) {
    for (const double diameter : {0.08, 0.12, 0.18, 0.24}) {
      Shot shot = shot_from(1.2, elevation);
      shot.add_ball("ball", diameter, -0.1, 1.15);
      shot.take();
      const Hypotheses found = shot.find();
      ASSERT_EQ(found.reaching, 0U) << diameter << " m, " << elevation << " degrees";
      ASSERT_EQ(found.things.size(), 1U) << diameter << " m, " << elevation << " degrees";
      const ShapeFit fit = fit_shape(found.things[0], 0.002);
      EXPECT_EQ(fit.shape, "round") << diameter << " m, " << elevation << " degrees";
      EXPECT_NEAR(fit.box.size.x(), diameter, 0.01) << diameter << " m, " << elevation << " degrees";
      const Vector3d centre = shot.table.in_world * fit.box.centre;
      EXPECT_LT((centre.head<2>() - Eigen::Vector2d(-0.1, 1.15)).norm(), 0.01) << diameter << " m, " << elevation;
    }
  }
}

TEST(Standing, WhatIsHeldOverTheTableHovers) {
  for (const double elevation : {25.0, 35.0, 50.0}) {
    for (const double above : {0.08, 0.15, 0.25}) {
      Shot shot = shot_from(1.2, elevation);
      shot.add_ball("ball", 0.08, -0.2, 1.15, above);
      shot.add_body(BodyShape::kBox, "carton", {0.1, 0.08, 0.15}, 0.2, 1.15, above + 0.075);
      shot.take();
      const Hypotheses found = shot.find();
      EXPECT_EQ(found.reaching, 2U) << above << " m, " << elevation << " degrees";
      EXPECT_TRUE(shot.names(found).empty()) << above << " m, " << elevation << " degrees";
    }
  }
}

// Nothing is measured of its lower part: that is no air below it.
TEST(Standing, ThingsBehindGlassAreFound) {
  Shot shot;
  shot.add_body(BodyShape::kCylinder, "can", {0.07, 0.07, 0.14}, 0, 1.2, 0.07);
  shot.add_body(BodyShape::kBox, "glass", {0.2, 0.01, 0.09}, 0, 1.1, 0.045, false);
  shot.take();
  const Hypotheses found = shot.find();
  EXPECT_EQ(found.reaching, 0U);
  EXPECT_EQ(shot.names(found).count("can"), 1U);
}

TEST(Standing, ThingsMayHangOverTheEdge) {
  Shot shot;
  double near_edge = 0;
  for (const Body& body : shot.scene.bodies) {
    if (shot.scene.entities[body.entity - 1U].name == "table")
      near_edge = body.pose.translation().y() - body.size.y() / 2;
  }
  ASSERT_GT(near_edge, 0.3);
  for (const double over : {0.0, 0.01, 0.02, 0.03}) {
    Shot at_edge = shot;
    at_edge.camera = look_at({0, near_edge - 0.9, 1.5}, {0, near_edge + 0.2, kTableHeight});
    at_edge.add_body(BodyShape::kCylinder, "can", {0.08, 0.08, 0.12}, 0.1, near_edge + 0.04 - over, 0.06);
    at_edge.take();
    const Hypotheses found = at_edge.find();
    EXPECT_EQ(found.reaching, 0U) << over;
    EXPECT_EQ(at_edge.names(found), Names{"can"}) << over;
  }
}

}  // namespace
}  // namespace sherlog::rgbd
