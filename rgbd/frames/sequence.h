// Recorded sequences in folders: read, and written.
//
// Two layouts. Ours:
//   calibration.txt       a line each: width, height, fx, fy, cx, cy and optionally units_per_metre, then the number
//   frames.txt            a line each: time depth-file colour-file [tx ty tz qx qy qz qw], files relative to the folder
//   depth/000000.png ...  16 bits, 1/1000 m where calibration.txt does not say otherwise, 0 = gap
//   colour/000000.png ... 8 bits, three channels
// and that of the TUM RGB-D recordings:
//   rgb.txt, depth.txt    a line each: time file
//   associations.txt      optional, a line each: time file time file, depth or colour first; else frames are paired by
//                         nearest times, at most 20 ms apart, each at most once
//   groundtruth.txt       optional, a line each: time tx ty tz qx qy qz qw; a frame has the nearest pose within 20 ms
//   calibration.txt       optional; else the recordings' usual 525 pixels; 5000 units a metre where it does not say it
// '#' begins a comment line. Which one a folder has is seen from frames.txt or depth.txt.
// Errors    values: nothing is returned, and `problem` is "file: sentence" or "file:line: sentence". A frame that
//           cannot be read does not end the sequence: the next may be asked for.
// Source    the layout of Sturm, Engelhard, Endres, Burgard, Cremers: A benchmark for the evaluation of RGB-D SLAM
//           systems, IROS 2012
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "rgbd/frames/frame.h"

namespace sherlog::rgbd {

enum class SequenceLayout : std::uint8_t { kPlain, kTum };

// Where one frame is.
struct FrameEntry {
  double time = 0;
  std::filesystem::path depth, colour;
  std::optional<Eigen::Isometry3d> pose;
};

struct Sequence {
  SequenceLayout layout = SequenceLayout::kPlain;
  std::filesystem::path folder;
  Calibration calibration;
  std::vector<FrameEntry> frames;  // times increase strictly
  std::size_t unpaired = 0;        // TUM: depth images without a colour image near in time
  bool poses_missed = false;       // TUM: there are poses, but none near in time to a frame
};

// Reads the lists, not the images. Nothing where the folder has no layout, a list or the calibration is wrong, there is
// no frame, or time goes backwards or stands.
std::optional<Sequence> open_sequence(const std::filesystem::path& folder, std::string& problem);

// Nothing where an image is missing, no PNG, cut off or damaged, of other channels or bits, or of another size than the
// calibration. Depth comes in millimetres, rounded; what does not fit 16 bits is a gap.
std::optional<Frame> read_frame(const Sequence& sequence, std::size_t index, std::string& problem);

// The files are complete after finish(); without it the images are there, and the lists as far as they were written.
class SequenceWriter {
 public:
  // The folder is made with the first frame, where it is missing.
  SequenceWriter(std::filesystem::path folder, const Calibration& calibration,
                 SequenceLayout layout = SequenceLayout::kPlain);
  // False: see problem(). Refuses frames of another size than the calibration, and time that does not increase.
  bool add(const Frame& frame);
  bool finish();
  const std::string& problem() const { return problem_; }

 private:
  bool make_folders();
  bool write_lists();

  std::filesystem::path folder_;
  Calibration calibration_;
  SequenceLayout layout_;
  std::vector<FrameEntry> frames_;
  std::string problem_;
};

}  // namespace sherlog::rgbd
