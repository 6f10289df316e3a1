#include "rgbd/pipeline/frame_source.h"

#include <fmt/format.h>

#include <algorithm>
#include <iterator>
#include <memory>

#include "rgbd/frames/sequence.h"
#include "rgbd/pipeline/robot_poses.h"
#include "rgbd/synthetic/kitchen.h"

namespace sherlog::rgbd {
namespace {

constexpr std::string_view kSynthetic = "synthetic:";

std::optional<FrameSource> open_synthetic(const std::string& name, std::uint64_t seed, std::string& problem) {
  auto made = make_sequence(name, {.seed = seed});
  if (!made) {
    problem = fmt::format("there is no synthetic sequence '{}'; there are {}", name, fmt::join(sequence_names(), ", "));
    return std::nullopt;
  }
  auto sequence = std::make_shared<const SyntheticSequence>(std::move(*made));
  FrameSource source{.name = name,
                     .calibration = sequence->calibration(),
                     .frames = sequence->size(),
                     .unpaired = 0,
                     .read = [sequence](std::size_t index, std::string&) { return sequence->frame(index).frame; },
                     .truth = [sequence](std::size_t index) { return sequence->frame(index); },
                     .robot = {},
                     .structure = sequence->scenery().bodies,
                     .knowledge = knowledge_of(*sequence)};
  const auto is_robot = [](const Entity& entity) { return entity.kind == EntityKind::kRobot; };
  if (std::ranges::any_of(sequence->movers(0).entities, is_robot)) {
    source.robot = [sequence](std::size_t index) { return robot_bodies(*sequence, index); };
  }
  return source;
}

// False: there is a robot.txt, and it cannot be used.
bool add_robot(FrameSource& source, const std::shared_ptr<const Sequence>& sequence, bool has_poses,
               std::string& problem) {
  const auto file = sequence->folder / "robot.txt";
  std::error_code error;
  // A link that leads nowhere is no robot that is not there.
  if (std::filesystem::symlink_status(file, error).type() == std::filesystem::file_type::not_found) return true;
  auto read = RobotPoses::read(file, problem);
  if (!read) return false;
  if (!has_poses) {
    problem =
        file.string() + ": it says where a robot is in the world, and of no frame it is known where the camera is";
    return false;
  }
  const auto robot = std::make_shared<const RobotPoses>(std::move(*read));
  source.read = [sequence, robot, read_image = std::move(source.read)](std::size_t index,
                                                                       std::string& what) -> std::optional<Frame> {
    if (index < sequence->frames.size() && !robot->at(sequence->frames[index].time, what)) return std::nullopt;
    return read_image(index, what);
  };
  source.robot = [sequence, robot](std::size_t index) {
    std::string what;
    return robot->at(sequence->frames[index].time, what).value_or(std::vector<Body>());
  };
  return true;
}

}  // namespace

KnownBodies FrameSource::bodies_at(std::size_t index) const {
  KnownBodies bodies{meshes_of(structure), robot ? meshes_of(robot(index)) : std::vector<PlacedMesh>()};
  bodies.map.insert(bodies.map.end(), knowledge.structure.begin(), knowledge.structure.end());
  return bodies;
}

std::optional<FrameSource> open_frames(const std::string& frames, std::uint64_t seed, std::string& problem) {
  if (frames.starts_with(kSynthetic)) return open_synthetic(frames.substr(kSynthetic.size()), seed, problem);
  auto opened = open_sequence(frames, problem);
  if (!opened) return std::nullopt;
  auto sequence = std::make_shared<const Sequence>(std::move(*opened));
  const bool has_poses =
      std::ranges::any_of(sequence->frames, [](const FrameEntry& frame) { return frame.pose.has_value(); });
  const auto folder = std::filesystem::path(frames).lexically_normal();
  FrameSource source{.name = (folder.has_filename() ? folder : folder.parent_path()).filename().string(),
                     .calibration = sequence->calibration,
                     .frames = sequence->frames.size(),
                     .unpaired = sequence->unpaired,
                     .poses_missed = sequence->poses_missed,
                     .read = [sequence, has_poses](std::size_t index, std::string& what) -> std::optional<Frame> {
                       // Places in the camera's frame cannot be compared with places in the world.
                       if (has_poses && !sequence->frames[index].pose) {
                         what = "the camera's pose is not known, as it is of other frames";
                         return std::nullopt;
                       }
                       return read_frame(*sequence, index, what);
                     },
                     .knowledge = {}};
  if (!add_robot(source, sequence, has_poses, problem)) return std::nullopt;
  return source;
}

std::vector<Body> robot_bodies(const SyntheticSequence& sequence, std::size_t index) {
  const Scene movers = sequence.movers(index);
  std::vector<Body> robot;
  std::ranges::copy_if(movers.bodies, std::back_inserter(robot),
                       [&](const Body& body) { return movers.entities[body.entity - 1U].kind == EntityKind::kRobot; });
  return robot;
}

KnownBodies known_bodies(const SyntheticSequence& sequence, std::size_t index) {
  return {meshes_of(sequence.scenery().bodies), meshes_of(robot_bodies(sequence, index))};
}

Knowledge knowledge_of(const SyntheticSequence& sequence) {
  Knowledge knowledge;
  for (const Entity& entity : sequence.scenery().entities) {
    if (entity.name != "table" && entity.name != "counter" && entity.name != "sideboard") continue;
    const Eigen::Vector3d low = entity.pose.translation() - entity.size / 2, high = low + entity.size;
    knowledge.map.push_back({entity.name, low.head<2>(), high.head<2>(), high.z()});
  }
  for (const Thing& thing : things()) {
    knowledge.things.push_back({thing.object_class,
                                thing.shape,
                                thing.size,
                                {thing.colour[2] / 255.0, thing.colour[1] / 255.0, thing.colour[0] / 255.0}});
  }
  return knowledge;
}

}  // namespace sherlog::rgbd
