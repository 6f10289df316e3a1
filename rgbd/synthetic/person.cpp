#include "rgbd/synthetic/person.h"

#include <algorithm>
#include <cmath>

namespace sherlog::rgbd {
namespace {

using Eigen::Vector3d;

// Down, turned forwards by `angle` and to the side by `aside`.
Vector3d swung(const Vector3d& forward, const Vector3d& side, double angle, double aside) {
  return (std::sin(angle) * forward - std::cos(angle) * Vector3d::UnitZ() + std::sin(aside) * side).normalized();
}

}  // namespace

std::uint16_t add_person(Scene& scene, std::string name, std::int32_t label, const Posture& p, const Clothes& clothes) {
  const double h = p.height;
  const Vector3d forward(std::cos(p.heading), std::sin(p.heading), 0), left(-forward.y(), forward.x(), 0);
  Entity person{.kind = EntityKind::kPerson, .name = std::move(name), .person = label, .is_foreground = true};
  person.pose.translation() = p.place;
  person.size = {0.25 * h, 0.25 * h, h};
  const auto joint = [&](const char* which, const Vector3d& at) {
    person.joints.emplace_back(which, at);
    return at;
  };
  struct Limb {
    Vector3d a, b;
    double diameter;
    cv::Vec3b colour;
    bool gives_depth;
  };
  std::vector<Limb> limbs;
  const auto add = [&](const Vector3d& a, const Vector3d& b, double diameter, cv::Vec3b colour,
                       bool gives_depth = true) {
    limbs.push_back({a, b, diameter * h, colour, gives_depth});
  };

  const Vector3d hips = joint("hips", p.place + 0.52 * h * Vector3d::UnitZ());
  const Vector3d neck = joint("neck", p.place + 0.83 * h * Vector3d::UnitZ());
  const Vector3d head = joint("head", p.place + 0.93 * h * Vector3d::UnitZ());
  add(head - 0.01 * h * Vector3d::UnitZ(), head + 0.01 * h * Vector3d::UnitZ(), 0.10, clothes.skin);
  add(neck, head, 0.06, clothes.skin);
  for (const double s : {-0.05, 0.05}) {
    add(hips + s * h * left, p.place + 0.76 * h * Vector3d::UnitZ() + 1.2 * s * h * left, 0.11, clothes.shirt);
  }
  for (const bool is_left : {true, false}) {
    const double sign = is_left ? 1 : -1;
    const double thigh_angle = sign * p.swing * std::sin(p.phase);
    const double knee_bend = p.swing * std::max(0.0, std::sin(p.phase * 1.0 + (is_left ? -1.2 : 1.94)));
    const Vector3d hip = hips + sign * 0.05 * h * left;
    const Vector3d knee = hip + 0.25 * h * swung(forward, left, thigh_angle, 0);
    const Vector3d foot = knee + 0.25 * h * swung(forward, left, thigh_angle - knee_bend, 0);
    joint(is_left ? "left knee" : "right knee", knee);
    joint(is_left ? "left foot" : "right foot", foot);
    add(hip, knee, 0.09, clothes.trousers, clothes.trousers_give_depth);
    add(knee, foot, 0.065, clothes.trousers, clothes.trousers_give_depth);
    add(foot, foot + 0.07 * h * forward, 0.045, {40, 40, 60});

    const double arm_angle = -0.8 * thigh_angle + (is_left ? p.left_arm : p.right_arm);
    const double elbow_bend = is_left ? p.left_elbow : p.right_elbow;
    const Vector3d shoulder = p.place + 0.80 * h * Vector3d::UnitZ() + sign * 0.115 * h * left;
    const Vector3d elbow = shoulder + 0.17 * h * swung(forward, left, arm_angle, sign * p.spread);
    const Vector3d hand = elbow + 0.19 * h * swung(forward, left, arm_angle + elbow_bend, sign * p.spread);
    joint(is_left ? "left shoulder" : "right shoulder", shoulder);
    joint(is_left ? "left elbow" : "right elbow", elbow);
    joint(is_left ? "left hand" : "right hand", hand);
    add(neck - 0.04 * h * Vector3d::UnitZ(), shoulder, 0.06, clothes.shirt);
    add(shoulder, elbow, 0.055, clothes.shirt);
    add(elbow, hand, 0.045, clothes.skin);
  }
  const std::uint16_t number = scene.add(std::move(person));
  for (const Limb& l : limbs) {
    Body body = limb(l.a, l.b, l.diameter, l.colour, number);
    body.gives_depth = l.gives_depth;
    scene.bodies.push_back(body);
  }
  return number;
}

}  // namespace sherlog::rgbd
