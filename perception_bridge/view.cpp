#include "perception_bridge/view.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace sherlog {
namespace {

Eigen::Quaterniond rotation_of(const std::array<double, 4>& xyzw) {
  const Eigen::Quaterniond q(xyzw[3], xyzw[0], xyzw[1], xyzw[2]);
  return q.norm() > 0 ? q.normalized() : Eigen::Quaterniond::Identity();
}

Eigen::Vector3d point_of(const std::vector<double>& coordinates) {
  return {coordinates[0], coordinates[1], coordinates[2]};
}

std::vector<double> numbers_at(const Annotation& annotation, std::string_view field) {
  const Value* value = find(annotation.fields, field);
  return value == nullptr ? std::vector<double>() : numbers_of(*value).value_or(std::vector<double>());
}

double number_at(const Annotation& annotation, std::string_view field, double otherwise) {
  const Value* value = find(annotation.fields, field);
  return value == nullptr ? otherwise : value->number().value_or(otherwise);
}

}  // namespace

SceneView view_of(const Scene& scene) {
  SceneView view;
  for (const Annotation* annotation : annotations_of(scene.annotations, "sherlog.annotation.ViewFrustum")) {
    ViewFrustum frustum;
    frustum.frame = annotation->frame.value_or(scene.frame.value_or(""));
    const auto translation = numbers_at(*annotation, "translation"), rotation = numbers_at(*annotation, "rotation");
    if (translation.size() != 3 || rotation.size() != 4) continue;
    std::copy(translation.begin(), translation.end(), frustum.translation.begin());
    std::copy(rotation.begin(), rotation.end(), frustum.rotation.begin());
    frustum.horizontal_angle = number_at(*annotation, "horizontal_angle", 0);
    frustum.vertical_angle = number_at(*annotation, "vertical_angle", 0);
    frustum.near = number_at(*annotation, "near", frustum.near);
    frustum.far = number_at(*annotation, "far", frustum.far);
    view.frusta.push_back(frustum);
  }
  for (const Annotation* annotation : annotations_of(scene.annotations, "sherlog.annotation.ViewBox")) {
    ViewBox box;
    box.frame = annotation->frame.value_or(scene.frame.value_or(""));
    box.min = numbers_at(*annotation, "min");
    box.max = numbers_at(*annotation, "max");
    view.boxes.push_back(std::move(box));
  }
  if (view.frusta.empty()) return view;
  for (const Cluster& cluster : scene.clusters) {
    if (auto box = box_of(cluster)) view.things.push_back(std::move(*box));
  }
  return view;
}

std::optional<ThingBox> box_of(const Cluster& cluster) {
  const auto position = position_of(cluster);
  if (!position || position->coordinates.size() != 3 || position->rotation.empty()) return std::nullopt;
  for (const Annotation* geometry : annotations_of(cluster.annotations, "rs.annotation.Geometry")) {
    const auto size = numbers_at(*geometry, "size");
    if (size.size() != 3) continue;
    const auto& q = position->rotation;
    const auto& at = position->coordinates;
    return ThingBox{position->frame, {at[0], at[1], at[2]}, {q[0], q[1], q[2], q[3]}, {size[0], size[1], size[2]}};
  }
  return std::nullopt;
}

bool sees(const ViewFrustum& view, const ScenePosition& position) {
  if (view.frame != position.frame || position.coordinates.size() != 3) return false;
  const Eigen::Vector3d eye(view.translation.data());
  const Eigen::Vector3d p = rotation_of(view.rotation).conjugate() * (point_of(position.coordinates) - eye);
  if (!(p[2] > 0) || p[2] < view.near || p[2] > view.far) return false;
  // Angles, not tangents: a view of 180 degrees and more is one too.
  return std::abs(std::atan2(p[0], p[2])) <= view.horizontal_angle / 2 &&
         std::abs(std::atan2(p[1], p[2])) <= view.vertical_angle / 2;
}

bool sees(const ViewBox& view, const ScenePosition& position) {
  if (view.frame != position.frame) return false;
  const std::size_t size = std::min({view.min.size(), view.max.size(), position.coordinates.size()});
  for (std::size_t i = 0; i < size; ++i) {
    if (!(position.coordinates[i] >= view.min[i] && position.coordinates[i] <= view.max[i])) return false;
  }
  return size > 0;
}

bool sees(const SceneView& view, const ScenePosition& position) {
  if (view.frusta.empty() && view.boxes.empty()) return true;
  return std::any_of(view.frusta.begin(), view.frusta.end(), [&](const ViewFrustum& v) { return sees(v, position); }) ||
         std::any_of(view.boxes.begin(), view.boxes.end(), [&](const ViewBox& v) { return sees(v, position); });
}

namespace {

// Boxes are taken for smaller than they are, and the place in them for larger: measured edges are not exact, things are round,
// and what is really seen must not be out of view.
constexpr double kEdge = 0.005;
constexpr double kCorners = 0.8;  // how far out from the middle of a thing its corners are looked for

// In the box's own frame.
Eigen::Vector3d within(const ThingBox& box, const Eigen::Vector3d& point) {
  return rotation_of(box.rotation).conjugate() * (point - Eigen::Vector3d(box.translation.data()));
}

bool contains(const ThingBox& box, const Eigen::Vector3d& point, double margin) {
  const Eigen::Vector3d local = within(box, point).cwiseAbs(), size(box.size.data());
  return ((local - size / 2).array() <= margin).all();
}

// Between the eye and the point, by slabs. What the box has in it is not behind it.
bool stands_between(const ThingBox& box, const Eigen::Vector3d& eye, const Eigen::Vector3d& point) {
  if (contains(box, point, 2 * kEdge)) return false;
  const Eigen::Vector3d from = within(box, eye), to = within(box, point);
  double enters = 0, leaves = 1;
  for (Eigen::Index a = 0; a < 3; ++a) {
    const double half = box.size[static_cast<std::size_t>(a)] / 2 - kEdge, step = to[a] - from[a];
    if (half <= 0) return false;
    if (step == 0) {
      if (std::abs(from[a]) > half) return false;
      continue;
    }
    const double one = (-half - from[a]) / step, other = (half - from[a]) / step;
    enters = std::max(enters, std::min(one, other));
    leaves = std::min(leaves, std::max(one, other));
  }
  return enters < leaves;
}

std::vector<Eigen::Vector3d> points_of(const Cluster& thing, const ScenePosition& position) {
  std::vector<Eigen::Vector3d> points = {point_of(position.coordinates)};
  const auto box = box_of(thing);
  for (int corner = 0; box && corner < 8; ++corner) {
    const Eigen::Vector3d side((corner & 1) != 0 ? 1 : -1, (corner & 2) != 0 ? 1 : -1, (corner & 4) != 0 ? 1 : -1);
    const Eigen::Vector3d size(box->size.data());
    points.push_back(points.front() + rotation_of(box->rotation) * (kCorners / 2 * size.cwiseProduct(side)));
  }
  return points;
}

// All of the points behind things, as the frustum's camera sees it. A thing that is seen where the first point is shows that
// this place is seen.
bool covered(const SceneView& view, const ViewFrustum& frustum, const std::vector<Eigen::Vector3d>& points) {
  const Eigen::Vector3d eye(frustum.translation.data());
  const auto in_frame = [&](const ThingBox& box) { return box.frame == frustum.frame; };
  if (std::ranges::any_of(view.things,
                          [&](const ThingBox& box) { return in_frame(box) && contains(box, points.front(), 0); }))
    return false;
  return std::ranges::all_of(points, [&](const Eigen::Vector3d& point) {
    return std::ranges::any_of(view.things,
                               [&](const ThingBox& box) { return in_frame(box) && stands_between(box, eye, point); });
  });
}

}  // namespace

bool sees_thing(const SceneView& view, const Cluster& thing) {
  const auto position = position_of(thing);
  if (!position) return true;
  if (!sees(view, *position)) return false;
  if (position->coordinates.size() != 3 || view.things.empty()) return true;
  const auto points = points_of(thing, *position);
  const bool in_a_box = std::ranges::any_of(view.boxes, [&](const ViewBox& box) { return sees(box, *position); });
  return in_a_box || std::ranges::any_of(view.frusta, [&](const ViewFrustum& frustum) {
           return sees(frustum, *position) && !covered(view, frustum, points);
         });
}

}  // namespace sherlog
