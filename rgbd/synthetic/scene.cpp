#include "rgbd/synthetic/scene.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace sherlog::rgbd {
namespace {

using Eigen::Vector3d;
constexpr double kNone = std::numeric_limits<double>::infinity();
constexpr double kBowlWall = 0.9;  // inner to outer radius

// Roots of a t^2 + 2 b t + c, ordered. False: none.
bool roots(double a, double b, double c, double& t0, double& t1) {
  const double inside = b * b - a * c;
  if (!(inside >= 0) || a <= 0) return false;
  const double root = std::sqrt(inside);
  t0 = (-b - root) / a;
  t1 = (-b + root) / a;
  return true;
}

// The unit cube [-1, 1]^3 by slabs.
double meet_box(const Vector3d& o, const Vector3d& d, Vector3d& normal) {
  double enter = -kNone, leave = kNone;
  int axis = 0;
  for (int i = 0; i < 3; ++i) {
    if (d[i] == 0) {
      if (std::abs(o[i]) > 1) return kNone;
      continue;
    }
    const double near = (-std::copysign(1.0, d[i]) - o[i]) / d[i];
    const double far = (std::copysign(1.0, d[i]) - o[i]) / d[i];
    if (near > enter) {
      enter = near;
      axis = i;
    }
    leave = std::min(leave, far);
  }
  if (enter > leave || enter <= 0) return kNone;
  normal = Vector3d::Zero();
  normal[axis] = -std::copysign(1.0, d[axis]);
  return enter;
}

// The unit cylinder: radius 1, |z| <= 1.
double meet_cylinder(const Vector3d& o, const Vector3d& d, Vector3d& normal) {
  double best = kNone, t0 = 0, t1 = 0;
  if (roots(d.head<2>().squaredNorm(), o.head<2>().dot(d.head<2>()), o.head<2>().squaredNorm() - 1, t0, t1) && t0 > 0 &&
      std::abs(o.z() + t0 * d.z()) <= 1) {
    best = t0;
    normal = {o.x() + t0 * d.x(), o.y() + t0 * d.y(), 0};
  }
  if (d.z() != 0) {
    const double side = -std::copysign(1.0, d.z());
    const double t = (side - o.z()) / d.z();
    if (t > 0 && t < best && (o.head<2>() + t * d.head<2>()).squaredNorm() <= 1) {
      best = t;
      normal = {0, 0, side};
    }
  }
  return best;
}

// Radius 1 around the stretch |z| <= half.
double meet_capsule(const Vector3d& o, const Vector3d& d, double half, Vector3d& normal) {
  double best = kNone, t0 = 0, t1 = 0;
  if (half > 0 &&
      roots(d.head<2>().squaredNorm(), o.head<2>().dot(d.head<2>()), o.head<2>().squaredNorm() - 1, t0, t1) && t0 > 0 &&
      std::abs(o.z() + t0 * d.z()) <= half) {
    best = t0;
    normal = {o.x() + t0 * d.x(), o.y() + t0 * d.y(), 0};
  }
  for (const double end : {-half, half}) {
    const Vector3d centred = o - Vector3d(0, 0, end);
    if (roots(d.squaredNorm(), centred.dot(d), centred.squaredNorm() - 1, t0, t1) && t0 > 0 && t0 < best) {
      best = t0;
      normal = centred + t0 * d;
    }
  }
  return best;
}

// The lower half of the unit sphere, from outside or through the opening from inside.
double meet_bowl(const Vector3d& o, const Vector3d& d, Vector3d& normal) {
  double best = kNone, t0 = 0, t1 = 0;
  const double a = d.squaredNorm(), b = o.dot(d), c = o.squaredNorm();
  if (roots(a, b, c - 1, t0, t1) && t0 > 0 && o.z() + t0 * d.z() <= 0) {
    best = t0;
    normal = o + t0 * d;
  }
  if (roots(a, b, c - kBowlWall * kBowlWall, t0, t1) && t1 > 0 && t1 < best && o.z() + t1 * d.z() <= 0) {
    best = t1;
    normal = -(o + t1 * d);
  }
  if (d.z() < 0) {  // the rim
    const double t = -o.z() / d.z(), r = (o.head<2>() + t * d.head<2>()).norm();
    if (t > 0 && t < best && r >= kBowlWall && r <= 1) {
      best = t;
      normal = Vector3d::UnitZ();
    }
  }
  return best;
}

// Body to unit shape.
struct Placed {
  Eigen::Matrix3d to_unit;    // directions
  Eigen::Matrix3d to_normal;  // unit normals to the world
  Vector3d centre;
  double half = 0, radius = 0;  // of the capsule's stretch; of the bounding sphere
  const Body* body = nullptr;
};

Placed place(const Body& body) {
  Placed p;
  p.body = &body;
  p.centre = body.pose.translation();
  Vector3d scale = body.size / 2;
  if (body.shape == BodyShape::kCapsule) {
    scale.setConstant(body.size.x() / 2);
    p.half = body.size.z() / body.size.x();
    p.radius = body.size.z() / 2 + scale.x();
  } else if (body.shape == BodyShape::kBowl) {
    scale.z() = body.size.z();
    p.radius = scale.maxCoeff();
  } else {
    p.radius = scale.norm();
  }
  const Vector3d inverse = scale.cwiseInverse();
  p.to_unit = inverse.asDiagonal() * body.pose.linear().transpose();
  p.to_normal = body.pose.linear() * inverse.asDiagonal();
  return p;
}

double meet_placed(const Placed& p, const Vector3d& origin, const Vector3d& direction, Vector3d& unit_normal) {
  const Vector3d o = p.to_unit * (origin - p.centre), d = p.to_unit * direction;
  switch (p.body->shape) {
    case BodyShape::kBox:
      return meet_box(o, d, unit_normal);
    case BodyShape::kCylinder:
      return meet_cylinder(o, d, unit_normal);
    case BodyShape::kCapsule:
      return meet_capsule(o, d, p.half, unit_normal);
    case BodyShape::kBowl:
      return meet_bowl(o, d, unit_normal);
  }
  return kNone;
}

// Pixels that the bounding sphere may cover.
cv::Rect bounds(const Placed& p, const Calibration& c, const Eigen::Isometry3d& to_camera) {
  const cv::Rect all(0, 0, c.width, c.height);
  const Vector3d centre = to_camera * p.centre;
  const double near = centre.z() - p.radius;
  if (centre.z() + p.radius <= 0) return {};
  if (near <= 0.05) return all;
  // At the depth of its nearest point a sphere looks larger than it does.
  const auto range = [&](double middle, double focal, double axis, int side, int& first, int& last) {
    const double low = std::min((middle - p.radius) / near, (middle - p.radius) / (centre.z() + p.radius));
    const double high = std::max((middle + p.radius) / near, (middle + p.radius) / (centre.z() + p.radius));
    first = static_cast<int>(std::floor(std::clamp(low * focal + axis, -1.0, side + 1.0)));
    last = static_cast<int>(std::ceil(std::clamp(high * focal + axis, -1.0, side + 1.0)));
  };
  int x0 = 0, x1 = 0, y0 = 0, y1 = 0;
  range(centre.x(), c.fx, c.cx, c.width, x0, x1);
  range(centre.y(), c.fy, c.cy, c.height, y0, y1);
  return cv::Rect(x0, y0, x1 - x0 + 1, y1 - y0 + 1) & all;
}

View empty_view(cv::Size size) {
  View view;
  view.entities = cv::Mat1w::zeros(size);
  view.depth = cv::Mat1f::zeros(size);
  view.measurable = cv::Mat1b::zeros(size);
  view.facing = cv::Mat1f::zeros(size);
  view.colour = ColourImage(size, cv::Vec3b(40, 40, 40));
  return view;
}

View copy(const View& view) {
  return {view.entities.clone(), view.depth.clone(), view.measurable.clone(), view.facing.clone(), view.colour.clone()};
}

}  // namespace

bool meet(const Body& body, const Vector3d& origin, const Vector3d& direction, double& t, Vector3d& normal) {
  const Placed p = place(body);
  Vector3d unit_normal = Vector3d::Zero();
  t = meet_placed(p, origin, direction, unit_normal);
  if (t == kNone) return false;
  normal = (p.to_normal * unit_normal).normalized();
  return true;
}

View render(const Scene& scene, const Calibration& c, const Eigen::Isometry3d& camera, const View* background,
            std::uint16_t first_entity) {
  View view = background != nullptr ? copy(*background) : empty_view(c.size());
  const Eigen::Isometry3d to_camera = camera.inverse();
  const Vector3d origin = camera.translation();
  const Vector3d light = Vector3d(0.3, -0.4, 0.87).normalized();
  for (const Body& body : scene.bodies) {
    const Placed p = place(body);
    const cv::Rect area = bounds(p, c, to_camera);
    for (int y = area.y; y < area.y + area.height; ++y) {
      for (int x = area.x; x < area.x + area.width; ++x) {
        const Vector3d ray = camera.linear() * Vector3d((x - c.cx) / c.fx, (y - c.cy) / c.fy, 1);  // t is the depth
        Vector3d unit_normal = Vector3d::Zero();
        const double t = meet_placed(p, origin, ray, unit_normal);
        float& depth = view.depth(y, x);
        if (t == kNone || (depth > 0 && t >= static_cast<double>(depth))) continue;
        const Vector3d normal = (p.to_normal * unit_normal).normalized();
        depth = static_cast<float>(t);
        view.entities(y, x) = static_cast<std::uint16_t>(body.entity + first_entity);
        view.measurable(y, x) = body.gives_depth ? 255 : 0;
        view.facing(y, x) = static_cast<float>(std::abs(normal.dot(ray)) / ray.norm());
        const double shade = 0.7 + 0.3 * normal.dot(light);
        for (int k = 0; k < 3; ++k) view.colour(y, x)[k] = cv::saturate_cast<std::uint8_t>(shade * body.colour[k]);
      }
    }
  }
  return view;
}

Eigen::Isometry3d look_at(const Vector3d& eye, const Vector3d& target) {
  const Vector3d z = (target - eye).normalized();
  const Vector3d x = z.cross(Vector3d::UnitZ()).normalized();
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.linear().col(0) = x;
  pose.linear().col(1) = z.cross(x);
  pose.linear().col(2) = z;
  pose.translation() = eye;
  return pose;
}

std::vector<PlacedMesh> meshes_of(std::span<const Body> bodies) {
  std::vector<PlacedMesh> meshes;
  for (const Body& body : bodies) {
    switch (body.shape) {
      case BodyShape::kBox:
        meshes.push_back({box_mesh(body.size), body.pose});
        break;
      case BodyShape::kCylinder:
        meshes.push_back({cylinder_mesh(body.size.x(), body.size.z()), body.pose});
        break;
      case BodyShape::kCapsule:
        meshes.push_back({capsule_mesh(body.size.x(), body.size.z()), body.pose});
        break;
      case BodyShape::kBowl:
        break;
    }
  }
  return meshes;
}

Body limb(const Vector3d& a, const Vector3d& b, double diameter, cv::Vec3b colour, std::uint16_t entity) {
  Body body{
      .shape = BodyShape::kCapsule, .size = {diameter, diameter, (b - a).norm()}, .colour = colour, .entity = entity};
  body.pose.translation() = (a + b) / 2;
  if ((b - a).norm() > 0)
    body.pose.linear() = Eigen::Quaterniond::FromTwoVectors(Vector3d::UnitZ(), b - a).toRotationMatrix();
  return body;
}

}  // namespace sherlog::rgbd
