// A walking person of capsules, with the joints as truth.
//
// Idea      Two angles of the hips, knees, shoulders and elbows each, as sines of the phase of the step; lengths are
//           fractions of the height (Drillis and Contini 1966, rounded). The feet slide a little, which no depth image
//           shows.
#pragma once

#include "rgbd/synthetic/scene.h"

namespace sherlog::rgbd {

struct Posture {
  Eigen::Vector3d place = Eigen::Vector3d::Zero();  // on the floor, below the hips
  double heading = 0;                               // around z; 0 looks along +x
  double height = 1.75;                             // metres
  double phase = 0;                                 // of the step, a full turn for two steps
  double swing = 0.5;                               // of the legs, radians; 0 stands
  double left_arm = 0, right_arm = 0;               // raised forwards at the shoulder, radians, beside the swing
  double left_elbow = 0.2, right_elbow = 0.2;       // bent, radians
  double spread = 0.12;                             // of the arms to the sides, radians
};

struct Clothes {
  cv::Vec3b shirt{60, 60, 200}, trousers{120, 60, 40}, skin{150, 180, 220};
  bool trousers_give_depth = true;  // false: black jeans
};

// Adds the person and its bodies; the entity's number.
std::uint16_t add_person(Scene& scene, std::string name, std::int32_t label, const Posture& posture,
                         const Clothes& clothes);

}  // namespace sherlog::rgbd
