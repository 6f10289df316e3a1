// An annotator of one's own in a pipeline: it reads what others found and says which things a small hand can lift.
#include <fmt/format.h>

#include "rgbd/pipeline/frame_source.h"
#include "rgbd/pipeline/perception.h"

using namespace sherlog;

class GraspAnnotator : public rgbd::Annotator {
 public:
  std::string name() const override { return "GraspAnnotator"; }
  std::vector<std::string> reads() const override { return {"rs.annotation.Geometry"}; }
  std::vector<std::string> writes() const override { return {"rs.annotation.Detection"}; }
  void process(const rgbd::Analysis& in, rgbd::Analysis& out) override {
    for (std::size_t thing = 0; thing < in.clusters(); ++thing) {
      for (const Annotation* geometry : in.annotations_of(thing, "rs.annotation.Geometry")) {
        const auto size = numbers_of(*find(geometry->fields, "size"));
        if (!size || std::min((*size)[0], (*size)[1]) > 0.08) continue;  // metres
        out.annotate(thing, rgbd::make_annotation("rs.annotation.Detection", name(), {{"name", Value("graspable")}}));
      }
    }
  }
};

int main() {
  std::string problem;
  auto frames = rgbd::open_frames("synthetic:table_moves", 1, problem);
  auto annotators = rgbd::object_annotators(frames->knowledge);
  annotators.push_back(std::make_unique<GraspAnnotator>());
  const auto request = rgbd::parse_request(R"({"detect": {"detection": "graspable"}})", problem);
  auto perception = rgbd::Perception::make(std::move(annotators), {.request = request}, problem);
  if (!perception) return fmt::print(stderr, "{}\n", problem), 1;
  const auto seen = perception->perceive(*frames->read(0, problem), frames->calibration, 0);
  const std::size_t count = rgbd::answer_to(*request, seen.scene).list()->size();
  fmt::print("{}\n{} of {} things can be lifted\n", fmt::join(perception->annotators(), " -> "), count,
             seen.scene.clusters.size());
  return count > 0 ? 0 : 1;
}
