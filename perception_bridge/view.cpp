#include "perception_bridge/view.h"

#include <algorithm>
#include <cmath>

namespace sherlog {
namespace {

using Vector = std::array<double, 3>;

// The vector in the frame from which the rotation (x, y, z, w) leads: v + 2 q x (q x v + w v) with the conjugate.
Vector rotate_back(const std::array<double, 4>& rotation, const Vector& v) {
  const double norm = std::sqrt(rotation[0] * rotation[0] + rotation[1] * rotation[1] + rotation[2] * rotation[2] +
                                rotation[3] * rotation[3]);
  if (!(norm > 0)) return v;
  const Vector q = {-rotation[0] / norm, -rotation[1] / norm, -rotation[2] / norm};
  const double w = rotation[3] / norm;
  const auto cross = [](const Vector& a, const Vector& b) {
    return Vector{a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
  };
  Vector inner = cross(q, v);
  for (std::size_t i = 0; i < 3; ++i) inner[i] += w * v[i];
  const Vector outer = cross(q, inner);
  return {v[0] + 2 * outer[0], v[1] + 2 * outer[1], v[2] + 2 * outer[2]};
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
  return view;
}

bool sees(const ViewFrustum& view, const ScenePosition& position) {
  if (view.frame != position.frame || position.coordinates.size() != 3) return false;
  Vector relative = {};
  for (std::size_t i = 0; i < 3; ++i) relative[i] = position.coordinates[i] - view.translation[i];
  const Vector p = rotate_back(view.rotation, relative);
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

}  // namespace sherlog
