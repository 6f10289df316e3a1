// Writes frames as a recording, with what is known beside them.
//
// Output    the layout of rgbd/frames/sequence.h; robot.txt where the source says where its robot is; and where it knows
//           them, map.json and known.json as --map and --known take them. So what is perceived in the recording is what
//           is perceived in the source.
#pragma once

#include "rgbd/frames/sequence.h"
#include "rgbd/pipeline/frame_source.h"
#include "rgbd/pipeline/robot_poses.h"

namespace sherlog::rgbd {

class Recorder {
 public:
  // `source` has to outlive it.
  Recorder(const std::filesystem::path& folder, const FrameSource& source);
  // A frame of the source, in their order. False: see problem().
  bool add(const Frame& frame, std::size_t index);
  bool finish();
  const std::string& problem() const { return problem_.empty() ? writer_.problem() : problem_; }

 private:
  bool write(const char* name, const std::string& text);

  std::filesystem::path folder_;
  const FrameSource& source_;
  SequenceWriter writer_;
  RobotPosesWriter robot_;
  std::string problem_;
};

}  // namespace sherlog::rgbd
