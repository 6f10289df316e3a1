// A table on which from frame to frame one thing is moved, taken away, or put (back) there, wherever there is room.
//
// Random    all of it follows from the seed; things hide each other as it happens
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "rgbd/synthetic/scene.h"

namespace sherlog::rgbd {

struct RandomKitchen {
  struct Placed {
    std::size_t kind = 0;  // into things()
    Eigen::Vector3d foot = Eigen::Vector3d::Zero();
    double heading = 0;
  };
  std::vector<std::vector<Placed>> steps;  // what stands there

  Scene scene(std::size_t step) const;
};

// Six of the ten things to begin with.
RandomKitchen random_kitchen(std::uint64_t seed, std::size_t steps);

}  // namespace sherlog::rgbd
