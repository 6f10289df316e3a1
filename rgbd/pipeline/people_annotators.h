// The annotators for people, and for what is known to be there.
//
//   reads                                       annotator          writes
//   depth calibration camera structure          RegionFilter       known robot
//   disparity foreground calibration camera     HumanAnnotator     people, sherlog.annotation.Person
//   known robot                                                    sherlog.annotation.Crowd
//
// Idea      RegionFilter draws the room and the robot as the sensor would see them; what measures them is known. Things are not
//           looked for in the robot, nor people in either. HumanAnnotator is the whole pose chain: foreground to keypoints,
//           keypoints to people with labels that last, people to postures; a posture like one that was seen has its number.
//           Where there are more people than there may be segments (`most_means`), a Crowd says so.
// Source    deliverable 3.2 (region filter); Stommel, Beetz, Xu on poses (rgbd/pose)
// State     labels and postures last from frame to frame; frames have to come in the order of time, and all of them
#pragma once

#include <vector>

#include "rgbd/depth/known_structure.h"
#include "rgbd/pipeline/flow.h"
#include "rgbd/pose/descriptor.h"
#include "rgbd/pose/keypoints.h"
#include "rgbd/pose/segmentation.h"

namespace sherlog::rgbd {

// What the robot knows of a moment: the room's furniture and its own body, in the world. The view "structure".
struct KnownBodies {
  std::vector<PlacedMesh> map, robot;
};

struct Person {
  std::int32_t label = 0;
  std::vector<Keypoint> keypoints;
  Eigen::Vector3d position =
      Eigen::Vector3d::Zero();  // median of the keypoints: in the world, else in the camera's frame
  PoseDescriptor pose{};
  std::size_t posture = 0;  // number in the library of those that were seen
  double similarity = 0;    // to it, 0 ... 100
};

// `options`: how many there may be, and how near to each other.
Annotators people_annotators(const SegmentationOptions& options = {});
// RegionFilter alone, which things on tables need as well.
std::unique_ptr<Annotator> region_filter();

}  // namespace sherlog::rgbd
