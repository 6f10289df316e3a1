// Where frames come from: a recording in a folder, or a synthetic sequence by name.
//
// Input     a folder (rgbd/frames/sequence.h) with or without a robot.txt (robot_poses.h), or "synthetic:table_moves"
//           (rgbd/synthetic/sequences.h)
// Errors    a sentence; of single frames too, and the next may be asked for
#pragma once

#include <functional>
#include <optional>
#include <string>

#include "rgbd/frames/frame.h"
#include "rgbd/pipeline/object_annotators.h"
#include "rgbd/pipeline/people_annotators.h"
#include "rgbd/synthetic/sequences.h"

namespace sherlog::rgbd {

struct FrameSource {
  std::string name;  // of the folder or the sequence
  Calibration calibration;
  std::size_t frames = 0;
  std::size_t unpaired = 0;   // depth images that have no colour image
  bool poses_missed = false;  // poses that are given are none of these frames'
  std::function<std::optional<Frame>(std::size_t index, std::string& problem)> read;
  std::function<TrueFrame(std::size_t index)> truth = {};          // of synthetic sequences only
  std::function<std::vector<Body>(std::size_t index)> robot = {};  // of a frame that can be read: where its parts are
  std::vector<Body> structure = {};                                // of synthetic rooms
  Knowledge knowledge;  // of synthetic kitchens: their tables and all things that there are

  KnownBodies bodies_at(std::size_t index) const;
};

// `seed`: of the noise of synthetic sequences.
std::optional<FrameSource> open_frames(const std::string& frames, std::uint64_t seed, std::string& problem);

// What a robot knows of its own: its furniture, and its arm where it is now.
std::vector<Body> robot_bodies(const SyntheticSequence& sequence, std::size_t index);
KnownBodies known_bodies(const SyntheticSequence& sequence, std::size_t index);
// The level surfaces of its furniture, and the catalogue.
Knowledge knowledge_of(const SyntheticSequence& sequence);

}  // namespace sherlog::rgbd
