// The parts that synthetic kitchens are made of: things on tables, the arm that moves them, rooms.
#pragma once

#include <span>
#include <string>

#include "rgbd/synthetic/scene.h"

namespace sherlog::rgbd {

// A kind of thing that stands on tables.
struct Thing {
  const char* object_class;
  const char* shape;  // "box", "cylinder", "round", "flat"
  const char* colour_name;
  cv::Vec3b colour;
  Eigen::Vector3d size;  // standing
};

// Cereals, milk, tea, cup, can, chips, bowl, plate, knife, juice.
std::span<const Thing> things();

// Puts a thing with its foot at `foot`, turned by `heading` around z; the entity's number.
std::uint16_t add_thing(Scene& scene, const Thing& thing, std::string name, const Eigen::Vector3d& foot, double heading,
                        bool is_foreground);

inline constexpr double kTableHeight = 0.75, kCounterHeight = 0.9;

// A table with a counter and a wall behind it.
Scene table_room();
// Walls, floor and cupboards of a room so deep; `windows` of them in the far wall, a screen and an oven's glass where
// asked.
Scene living_room(double depth, int windows, bool shiny);

// A person's arm that comes over the far edge of the table, its hand at the place.
void add_reaching_arm(Scene& scene, std::string name, const Eigen::Vector3d& hand);
// A robot's arm: six joints by angles (radians) from a base; the bodies belong to one entity.
std::uint16_t add_robot_arm(Scene& scene, const Eigen::Isometry3d& base, std::span<const double> angles);

}  // namespace sherlog::rgbd
