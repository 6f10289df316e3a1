// Who is who among the keypoints, from frame to frame.
//
// Idea      Seen from above people are apart even where they overlap in the picture: keypoints are clustered in the
//           plane of x and depth. A handful of means is kept from frame to frame, each with a label and an age that
//           grows with its size; older ones go first, so that noise and newcomers never take over a label. For every
//           frame means are added until each keypoint has one within half a metre, drawn to the middle of what is
//           theirs, and dropped where two meet.
//           Two things are ours. A keypoint is claimed only by means that have a tenth of the age of the oldest one in
//           reach, or have settled: in the random permutations a mean of age nothing, made for a stray keypoint between
//           two people, has the same chance as they have, draws half a body to itself, and is that person for a frame.
//           And a mean that is dropped rests where it was for as many frames as it has lived, but a second at most:
//           what turns up there gets its label and age back, so that a person may be hidden for a moment.
//           The paper keeps at most fifteen means. Where more are wanted, the keypoints in want of one are counted by groups
//           of the same radius, so that whoever looks at a crowd is told.
// Source    the pose paper, section III.B, Algs. 1-3 and Eq. 1. Read as: a new mean gets a fresh label; a keypoint
//           takes the mean that a permutation names first, not the place in the permutation; the loop over j ends where
//           i is deleted, and counts are swapped with the rest; a mean without keypoints stays where it is; age grows
//           once a frame, by the last of the three rounds.
// Random    four permutations a round from (seed, frame, round)
// Cost      O(keypoints x means) a frame
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "rgbd/pose/keypoints.h"

namespace sherlog::rgbd {

struct SegmentationOptions {
  std::size_t most_means = 15;   // k_max
  std::size_t least_group = 15;  // keypoints that make a group of those for whom there was no mean any more
  float radius = 0.5F;           // r, metres
  float overlap = 0.7F;          // r2 as a part of r
  std::size_t rounds = 3;
  double tenure = 0.1;        // part of the oldest's age that a claim needs; 0 as printed
  double settled = 500;       // an age that is always enough for one: of a person, a second
  std::size_t patience = 30;  // frames that a dropped mean rests at most; 0 as printed
  std::uint64_t seed = 1;
};

struct Segment {
  float x = 0, depth = 0;  // of the mean, metres
  double age = 0;          // sum over frames of 1 + the root of the number of its keypoints
  std::int32_t label = 0;  // from 1, never given to another one
  std::uint64_t born = 0;  // the frame
  std::size_t count = 0;   // keypoints
};

class SpatioTemporalSegmentation {
 public:
  static constexpr std::size_t kNone = static_cast<std::size_t>(-1);
  static constexpr std::size_t kPermutations = 4;

  explicit SpatioTemporalSegmentation(const SegmentationOptions& options = {}) : options_(options) {}

  // One frame. Label of each keypoint, that of the nearest mean with a claim to it; 0 where none is within the radius.
  std::vector<std::int32_t> next(std::span<const Keypoint> points);
  // The first k means.
  std::span<const Segment> segments() const { return segments_; }
  // Groups of keypoints in the last frame that should have had a mean of their own, had there been room for more than
  // `most_means`: theirs is no label, or somebody else's.
  std::size_t crowded_out() const;

  // The steps, for tests.
  void increase_k(std::span<const Keypoint> points);
  // Index of the mean of each keypoint, the first of a permutation that has a claim; kNone: none within the radius.
  std::vector<std::size_t> local_neighbourhood(std::span<const Keypoint> points,
                                               std::span<const std::vector<std::size_t>> permutations) const;
  void mean_shift(std::span<const Keypoint> points, std::span<const std::size_t> assigned);
  void reduce_k();

 private:
  struct Resting {
    Segment segment;
    std::uint64_t until = 0;  // the last frame in which it can come back
  };
  // A mean where the keypoint is: the oldest of those that rest within the radius, or a new one.
  Segment wake_or_make(const Keypoint& point);
  void rest(const Segment& segment);
  double least_age(const Keypoint& point) const;  // of a mean with a claim to the keypoint
  std::vector<std::vector<std::size_t>> permutations(std::uint64_t round) const;

  SegmentationOptions options_;
  std::vector<Segment> segments_;
  std::vector<Resting> resting_;
  std::vector<Segment> crowded_out_;
  std::int32_t last_label_ = 0;
  std::uint64_t frame_ = 0;
};

}  // namespace sherlog::rgbd
