// Scenes made of simple bodies, and what a perfect camera sees of them.
//
// Idea      A body is a unit shape with a scale and a pose; a ray is taken to the body's frame, where meeting it is a
//           line or two of school geometry. Bodies belong to entities: a cup, a person, the robot, the room. What is
//           seen carries the entity's number in every pixel, which is the truth that a perception chain is measured
//           against.
// Frames    the world's z axis points up; metres
// Cost      O(pixels that the bodies' bounding spheres cover)
#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <opencv2/core.hpp>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "rgbd/depth/known_structure.h"
#include "rgbd/frames/frame.h"

namespace sherlog::rgbd {

// The origin is the centre; of a bowl it is the middle of its opening, which faces +z.
enum class BodyShape : std::uint8_t {
  kBox,       // size: edges
  kCylinder,  // axis z; size: diameters along x and y, height
  kCapsule,   // axis z; size.x: diameter, size.z: between the centres of its ends (0: a ball)
  kBowl,      // half an ellipsoid, hollow; size: diameters along x and y, depth
};

struct Body {
  BodyShape shape = BodyShape::kBox;
  Eigen::Vector3d size = Eigen::Vector3d::Ones();
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();  // to the world
  cv::Vec3b colour{128, 128, 128};
  std::uint16_t entity = 0;  // number of it in Scene::entities, plus one
  bool gives_depth = true;   // false: windows, screens, black cloth
};

enum class EntityKind : std::uint8_t { kScenery, kObject, kPerson, kRobot };

struct Entity {
  EntityKind kind = EntityKind::kScenery;
  std::string name = {};          // unique in a sequence: "table", "milk", "person 1"
  std::string object_class = {};  // objects: "Milk"
  std::string shape = {};         // objects: "box", "cylinder", "round" or "flat"
  std::string colour_name = {};   // objects: "red"
  Eigen::Vector3d size = Eigen::Vector3d::Zero();
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  std::int32_t person = 0;                                           // people: label from 1, the same in all frames
  std::vector<std::pair<std::string, Eigen::Vector3d>> joints = {};  // people: in the world
  bool is_foreground = false;                                        // was not here in the first frame
};

struct Scene {
  std::vector<Entity> entities;
  std::vector<Body> bodies;

  // Adds an entity; its number for bodies.
  std::uint16_t add(Entity entity) {
    entities.push_back(std::move(entity));
    return static_cast<std::uint16_t>(entities.size());
  }
};

// What a perfect camera sees.
struct View {
  cv::Mat1w entities;    // number of the entity, 0 = nothing there
  cv::Mat1f depth;       // metres along the axis, 0 = nothing there
  cv::Mat1b measurable;  // 255: the surface gives depth
  cv::Mat1f facing;      // cosine between ray and surface normal, in 0 ... 1
  ColourImage colour;
};

// `background`, of the same camera and size, is what the bodies stand in front of; their entities' numbers go on from
// `first_entity`. The result is a view of its own.
View render(const Scene& scene, const Calibration& calibration, const Eigen::Isometry3d& camera,
            const View* background = nullptr, std::uint16_t first_entity = 0);

// Pose of a camera at `eye` that looks at `target`, its x axis horizontal. Requires a direction that is not vertical.
Eigen::Isometry3d look_at(const Eigen::Vector3d& eye, const Eigen::Vector3d& target);
// A capsule from a to b.
Body limb(const Eigen::Vector3d& a, const Eigen::Vector3d& b, double diameter, cv::Vec3b colour, std::uint16_t entity);

// The bodies as a map or a robot's model would have them, to be drawn; bowls are left out.
std::vector<PlacedMesh> meshes_of(std::span<const Body> bodies);

// Point where the ray origin + t direction meets the body: least t > 0, with the outward normal, both in the world.
// False: none.
bool meet(const Body& body, const Eigen::Vector3d& origin, const Eigen::Vector3d& direction, double& t,
          Eigen::Vector3d& normal);

}  // namespace sherlog::rgbd
