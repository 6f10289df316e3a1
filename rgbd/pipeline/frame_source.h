// Where frames come from: a recording in a folder, or a synthetic sequence by name.
//
// Input     a folder (rgbd/frames/sequence.h), or "synthetic:table_moves" (rgbd/synthetic/sequences.h)
// Errors    a sentence; of single frames too, and the next may be asked for
#pragma once

#include <functional>
#include <optional>
#include <string>

#include "rgbd/frames/frame.h"
#include "rgbd/pipeline/object_annotators.h"
#include "rgbd/synthetic/sequences.h"

namespace sherlog::rgbd {

struct FrameSource {
  std::string name;  // of the folder or the sequence
  Calibration calibration;
  std::size_t frames = 0;
  std::size_t unpaired = 0;  // depth images that have no colour image
  std::function<std::optional<Frame>(std::size_t index, std::string& problem)> read;
  std::function<TrueFrame(std::size_t index)> truth = {};  // of synthetic sequences only
  Knowledge knowledge;  // of synthetic kitchens: their tables and all things that there are
};

// `seed`: of the noise of synthetic sequences.
std::optional<FrameSource> open_frames(const std::string& frames, std::uint64_t seed, std::string& problem);

// The level surfaces of its furniture, and the catalogue.
Knowledge knowledge_of(const SyntheticSequence& sequence);

}  // namespace sherlog::rgbd
