// Taking away what is known: the room's furniture and the robot's own arm.
//
// Idea      The map and the arm are drawn from where the sensor is; a pixel that measures what is drawn there is known.
//           Normalised disparity is linear in the inverse depth, which is linear in the picture: a triangle is drawn
//           with an addition a pixel, nearest wins by a maximum, and one tolerance in steps is a tolerance that grows
//           with the square of the depth, as the sensor's error does. The residual is averaged over the neighbours that
//           agree, so that the tolerance can be about a step: a thing that stands on a table loses only the row of
//           pixels with which it touches it. At the outline of something known, half a pixel decides between two
//           depths: there the neighbours' drawn depths count as well.
// Source    deliverable 3.2 and Fig. 4, which does it in a shader. Here on a processor
// Cost      O(drawn pixels + pixels); see bench/depth_bench
#pragma once

#include <Eigen/Geometry>
#include <array>
#include <span>
#include <vector>

#include "rgbd/depth/disparity.h"

namespace sherlog::rgbd {

// Triangles, counter-clockwise seen from outside; metres.
struct Mesh {
  std::vector<Eigen::Vector3d> points;
  std::vector<std::array<std::uint32_t, 3>> triangles;
};

// Centred on the origin, axes along z. Round ones have the mean of the radii in and around the circle, so that neither
// inside nor outside is preferred.
Mesh box_mesh(const Eigen::Vector3d& size);
Mesh cylinder_mesh(double diameter, double height, std::uint32_t segments = 24);
Mesh capsule_mesh(double diameter, double length,
                  std::uint32_t segments = 24);  // length between the centres of its ends

struct PlacedMesh {
  Mesh mesh;
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();  // to the world
};

// Draws meshes as the sensor would see them; what is not drawn is the farthest there is, kA1. Keeps its memory.
class VirtualView {
 public:
  void clear(cv::Size size);
  // Over what is there: nearer wins. Parts nearer than 5 cm are cut off.
  void draw(std::span<const PlacedMesh> meshes, const Calibration& calibration, const Eigen::Isometry3d& camera);
  const DisparityImage& disparity() const { return disparity_; }

 private:
  void draw_triangle(const Eigen::Vector3d& a, const Eigen::Vector3d& b, const Eigen::Vector3d& c,
                     const Calibration& calibration);

  DisparityImage disparity_;
  std::vector<Eigen::Vector3d> points_;
};

struct KnownStructureOptions {
  float tolerance = 3.0F;  // steps that one measurement may differ
  // Steps that the mean over its neighbours may differ; where it is the tolerance, the mean plays no part.
  float mean_tolerance = 0.7F;
  float inaccuracy = 0.0F;  // metres that map and poses may be off, on top
};

// 255 where `depth` measures what is drawn; gaps are 0. `known` is made where it has another size.
void known_structure(const DepthImage& depth, const DisparityImage& drawn, const KnownStructureOptions& options,
                     MaskImage& known);
// Gaps where it is known.
void remove_known(const MaskImage& known, DepthImage& depth);

}  // namespace sherlog::rgbd
