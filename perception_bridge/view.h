// What a sensor sees: whether a place that was seen before is in the picture now.
//
// Idea      Two kinds of view, both scene annotations: a frustum (the camera's pose, two angles, a near and a far distance) and a
//           box in a frame (a table, a region). A position in another frame than the view's is out of view: nobody looked there.
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

// The views of a scene: a place is in view where one of them has it. None: nothing is known, and everything is in view.
struct SceneView {
  std::vector<ViewFrustum> frusta;
  std::vector<ViewBox> boxes;
};

SceneView view_of(const Scene& scene);

bool sees(const ViewFrustum& view, const ScenePosition& position);
bool sees(const ViewBox& view, const ScenePosition& position);
bool sees(const SceneView& view, const ScenePosition& position);

}  // namespace sherlog
