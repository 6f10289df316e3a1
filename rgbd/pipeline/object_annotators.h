// The annotators for things on tables, and what they know of the room.
//
//   reads                                   annotator                     writes
//   depth colour                            DepthPreprocessing            filled disparity foreground
//   depth calibration camera structure      RegionFilter                  known robot
//   depth calibration                       CloudAnnotator                cloud
//   cloud camera                            TableTopAnnotator             tables points
//   points colour tables calibration robot  PointCloudClusterExtractor    things, rs.scene.ImageROI, ClusterPoints
//   things tables                           PrimitiveFitter               forms
//   forms                                   PrimitiveShapeAnnotator       rs.annotation.Shape
//   things forms tables                     Cluster3DGeometryAnnotator    rs.annotation.SemanticSize, Geometry,
//                                                                         PoseAnnotation
//   things colour                           ColorAnnotator                rs.annotation.SemanticColor,
//                                                                         HueSaturationHistogram,
//                                                                         sherlog.annotation.MeanColor
//   things                                  ShapeFeatureAnnotator         rs.annotation.PclFeature
//   things forms tables                     LocationAnnotator             rs.annotation.TFLocation
//   Shape Geometry MeanColor                KnownThingsAnnotator          rs.annotation.Classification
//
// Source    names and thresholds of RoboSherlock's annotators (features in perception_bridge/annotation_types.h)
#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "rgbd/depth/known_structure.h"
#include "rgbd/objects/shape.h"
#include "rgbd/pipeline/flow.h"

namespace sherlog::rgbd {

// A table top, counter or shelf of a semantic map: a level rectangle, metres, in the world.
struct Surface {
  std::string name;
  Eigen::Vector2d low = Eigen::Vector2d::Zero(), high = Eigen::Vector2d::Zero();
  double height = 0;
};
using SemanticMap = std::vector<Surface>;
// {"surfaces": [{"name": "table", "min": [x, y], "max": [x, y], "height": z}]}
std::optional<SemanticMap> parse_map(std::string_view text, std::string& problem);
// The bodies of the same document's "structure", for the region filter: boxes and cylinders by size and pose. No such list:
// none. {"structure": [{"shape": "box", "size": [x, y, z], "translation": [x, y, z], "rotation": [x, y, z, w]}]}
std::optional<std::vector<PlacedMesh>> parse_structure(std::string_view text, std::string& problem);

// A thing that may be there, by its looks.
struct KnownThing {
  std::string name;
  std::string shape;
  Eigen::Vector3d size = Eigen::Vector3d::Zero();  // standing
  std::array<double, 3> colour{};                  // red, green, blue in 0 ... 1
};
// {"things": [{"name": "Milk", "shape": "box", "size": [x, y, z], "color": [r, g, b]}]}
std::optional<std::vector<KnownThing>> parse_known_things(std::string_view text, std::string& problem);

struct Knowledge {
  SemanticMap map;                         // empty: a table is any level plane from 30 cm up
  std::vector<KnownThing> things;          // empty: nothing is classified
  std::vector<PlacedMesh> structure = {};  // of the room, in the world
};

// Views that a frame brings with it.
const std::vector<std::string>& frame_views();

Annotators object_annotators(const Knowledge& knowledge);

}  // namespace sherlog::rgbd
