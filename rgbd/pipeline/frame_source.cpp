#include "rgbd/pipeline/frame_source.h"

#include <fmt/format.h>

#include <algorithm>
#include <iterator>
#include <memory>

#include "rgbd/frames/sequence.h"
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
                     .bodies = [sequence](std::size_t index) { return known_bodies(*sequence, index); },
                     .knowledge = knowledge_of(*sequence)};
  return source;
}

}  // namespace

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
                     .read = [sequence, has_poses](std::size_t index, std::string& what) -> std::optional<Frame> {
                       // Places in the camera's frame cannot be compared with places in the world.
                       if (has_poses && !sequence->frames[index].pose) {
                         what = "the camera's pose is not known, as it is of other frames";
                         return std::nullopt;
                       }
                       return read_frame(*sequence, index, what);
                     },
                     .knowledge = {}};
  return source;
}

KnownBodies known_bodies(const SyntheticSequence& sequence, std::size_t index) {
  const Scene movers = sequence.movers(index);
  std::vector<Body> robot;
  std::ranges::copy_if(movers.bodies, std::back_inserter(robot),
                       [&](const Body& body) { return movers.entities[body.entity - 1U].kind == EntityKind::kRobot; });
  return {meshes_of(sequence.scenery().bodies), meshes_of(robot)};
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
