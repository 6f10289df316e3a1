// What a sensor sees: whether a place that was seen before is in the picture now.
//
// Idea      Two kinds of view, both scene annotations: a frustum (the camera's pose, two angles, a near and a far distance) and a
//           box in a frame (a table, a region). A position in another frame than the view's is out of view: nobody looked there.
//           What a camera looks at may stand in the way: a thing that was wholly behind a cluster of the scene is out of view too.
// Input     metres, radians; the camera looks along its z axis, x to the right, y down (the optical convention of ROS); the
//           rotation is a quaternion x, y, z, w from the camera to the frame
#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "perception_bridge/scene.h"

namespace sherlog {

struct ViewFrustum {
  std::string frame;
  std::array<double, 3> translation = {};
  std::array<double, 4> rotation = {0, 0, 0, 1};
  double horizontal_angle = 0, vertical_angle = 0;  // from edge to edge
  double near = 0, far = 1e9;
};

struct ViewBox {
  std::string frame;
  std::vector<double> min, max;  // of one length; coordinates beyond it do not matter
};

// A thing that has a pose and a size, as a box around it. Its shape within the box is not known.
struct ThingBox {
  std::string frame;
  std::array<double, 3> translation = {};  // of its middle
  std::array<double, 4> rotation = {0, 0, 0, 1};
  std::array<double, 3> size = {};
};
// Nothing where an annotation is missing.
std::optional<ThingBox> box_of(const Cluster& cluster);

// The views of a scene: a place is in view where one of them has it. None: nothing is known, and everything is in view.
struct SceneView {
  std::vector<ViewFrustum> frusta;
  std::vector<ViewBox> boxes;
  std::vector<ThingBox> things = {};  // that may stand in the way of a frustum
};

SceneView view_of(const Scene& scene);

bool sees(const ViewFrustum& view, const ScenePosition& position);
bool sees(const ViewBox& view, const ScenePosition& position);
bool sees(const SceneView& view, const ScenePosition& position);
// Whether the thing would be seen where it was: its middle is in view, and not all of it is behind one thing or several. One
// without a position counts as in view; of one without a size the middle decides.
bool sees_thing(const SceneView& view, const Cluster& thing);

}  // namespace sherlog
