// Ready-made synthetic sequences with their truth, by name.
//
//   table_moves       a kitchen table; a person's arm carries objects to other places
//   table_removals    the same; objects are carried away, and one comes that was not there
//   table_occlusion   the same; a large box is put in front of smaller things and taken away again
//   random_kitchen    the same table; in each frame another thing has been moved, taken away or put there
//   table_and_counter from farther away: things on the table and on the higher counter at the wall, and carried between them
//   robot_table       the robot's arm moves over the table, at up to a metre a second
//   people_crossing   a room 5.5 m deep; two people cross, one in front of the other
//   window            the same with windows and a glass door; one person walks past and stops in front of them
//   hall              a room to 7.5 m with windows, an aluminium panel and an oven; four people come and go
//   crowd             50 people, for trying out limits
//   empty_room        nothing happens
//
// Frames    the camera stands still. The world's floor is z = 0; the camera looks along +y.
// Random    all of it follows from (name, size, frames, seed): the same bits wherever it is made
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "rgbd/synthetic/sensor.h"

namespace sherlog::rgbd {

struct SequenceOptions {
  std::int32_t width = 640, height = 480;
  std::size_t frames = 0;  // 0: the sequence's own number. A longer one goes slower through the same story.
  std::uint64_t seed = 1;
};

// A frame with what is true of it.
struct TrueFrame {
  Frame frame;           // as measured
  cv::Mat1w entities;    // number into `scene.entities` plus one; 0 = nothing
  DepthImage depth;      // without gaps and noise, millimetres
  MaskImage foreground;  // entities that were not here in the first frame
  Scene scene;           // all entities, scenery first; the bodies of those that move
};

class SyntheticSequence {
 public:
  using Story = std::function<Scene(double)>;  // what moves, at a moment in 0 ... 1

  SyntheticSequence(std::string name, Calibration calibration, Eigen::Isometry3d camera, std::size_t frames,
                    Scene scenery, Story story, SensorModel sensor, std::uint64_t seed);

  const std::string& name() const { return name_; }
  const Calibration& calibration() const { return calibration_; }
  const Eigen::Isometry3d& camera() const { return camera_; }
  std::size_t size() const { return frames_; }
  double rate() const { return 30; }  // frames a second
  // What never moves: rooms and furniture. All of it is what a semantic map knows.
  const Scene& scenery() const { return scenery_; }
  // What moves in a frame; entities' numbers start at one again.
  Scene movers(std::size_t index) const;
  TrueFrame frame(std::size_t index) const;

 private:
  std::string name_;
  Calibration calibration_;
  Eigen::Isometry3d camera_;
  std::size_t frames_;
  Scene scenery_;
  Story story_;
  SensorModel sensor_;
  std::uint64_t seed_;
  View background_;
};

std::vector<std::string> sequence_names();
// Nothing: there is no such name, or the size is not one (1 ... 16384).
std::optional<SyntheticSequence> make_sequence(std::string_view name, const SequenceOptions& options = {});

}  // namespace sherlog::rgbd
