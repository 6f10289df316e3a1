// Synthetic kitchens from frames to beliefs: what is found, what it is taken for, and who is who in the end.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <map>
#include <set>

#include "mln/parser.h"
#include "perception_bridge/scene_tracker.h"
#include "perception_bridge/shipped_models.h"
#include "rgbd/objects/looks.h"
#include "rgbd/pipeline/frame_source.h"
#include "rgbd/pipeline/perception.h"
#include "rgbd/pipeline/truth.h"

namespace sherlog::rgbd {
namespace {

struct Share {
  std::size_t right = 0, total = 0;
  void add(bool is_right) { right += is_right ? 1U : 0U, ++total; }
  double rate() const { return total == 0 ? 1 : static_cast<double>(right) / static_cast<double>(total); }
};
std::string text_of(const char* name, const Share& share) {
  return fmt::format("{} {}/{} = {:.3f}  ", name, share.right, share.total, share.rate());
}

struct Score {
  Share recall, precision, shapes, colours, classes, belief;
  std::size_t identities = 0, things = 0;
};

// Pixels of each entity in the picture.
std::map<std::size_t, std::size_t> visible(const TrueFrame& truth) {
  std::map<std::size_t, std::size_t> counts;
  for (const std::uint16_t entity : truth.entities) ++counts[entity];
  return counts;
}

// A few pixels beside something nearer are not enough for anybody.
bool is_enough(const std::map<std::size_t, std::size_t>& counts, std::size_t entity) {
  const auto count = counts.find(entity + 1);
  return count != counts.end() && count->second >= 100;
}

std::string first_text(const Cluster& cluster, const char* type, const char* field) {
  const auto found = annotations_of(cluster.annotations, type);
  return found.empty() ? "" : std::string(text_field(*found.front(), field));
}

// Against the truth of one frame at rest; the true name of each cluster.
std::map<std::string, std::string> score_frame(const Perceived& perceived, const TrueFrame& truth, Score& score) {
  std::map<std::string, std::string> names;
  std::set<std::string> found;
  const auto& things = perceived.analysis.view<Hypotheses>("things")->things;
  for (std::size_t i = 0; i < things.size(); ++i) {
    const Entity* entity = entity_of(things[i], truth);
    score.precision.add(entity != nullptr && !found.contains(entity->name));
    if (entity == nullptr) continue;
    const Cluster& cluster = perceived.scene.clusters[i];
    names[cluster.id] = entity->name;
    if (!found.insert(entity->name).second) continue;
    score.shapes.add(first_text(cluster, "rs.annotation.Shape", "shape") == entity->shape);
    score.classes.add(first_text(cluster, "rs.annotation.Classification", "classname") == entity->object_class);
    for (const Body& body : truth.scene.bodies) {
      if (&truth.scene.entities[body.entity - 1U] != entity) continue;
      score.colours.add(first_text(cluster, "rs.annotation.SemanticColor", "color") == colour_name(body.colour));
    }
  }
  const auto counts = visible(truth);
  for (std::size_t i = 0; i < truth.scene.entities.size(); ++i) {
    const Entity& entity = truth.scene.entities[i];
    if (entity.kind == EntityKind::kObject && is_enough(counts, i)) score.recall.add(found.contains(entity.name));
  }
  return names;
}

// Every object that was ever seen: in the end it is seen under the name that it had at first; or nothing of it can be seen, and
// it has not disappeared; or it is gone and has disappeared.
void score_belief(const std::vector<TrackingStep>& steps, const std::vector<std::map<std::string, std::string>>& names,
                  const std::vector<TrackedObject>& objects, const std::map<std::string, bool>& seen_in_the_end,
                  Score& score) {
  std::map<std::string, std::string> first, last;  // true name -> identity
  for (std::size_t i = 0; i < steps.size(); ++i) {
    for (const TrackingStep::ClusterBelief& belief : steps[i].clusters) {
      const auto name = names[i].find(belief.cluster);
      if (name == names[i].end()) continue;
      first.emplace(name->second, belief.object);
      if (i + 1 == steps.size()) last[name->second] = belief.object;
    }
  }
  for (const auto& [name, identity] : first) {
    const auto object = std::ranges::find(objects, identity, [](const TrackedObject& o) { return o.identity.id; });
    const auto there = seen_in_the_end.find(name);
    const bool is_there = there != seen_in_the_end.end();
    const auto now = last.find(name);
    const bool has_disappeared = object != objects.end() && object->identity.disappeared;
    const bool is_right = !is_there                            ? has_disappeared
                          : there->second || now != last.end() ? now != last.end() && now->second == identity
                                                               : !has_disappeared;
    score.belief.add(is_right);
    if (is_right) continue;
    fmt::print("  {}: was {}, is {}; {}\n", name, identity, now == last.end() ? "not seen" : now->second,
               !is_there       ? "it is gone"
               : there->second ? "it can be seen"
                               : "it is covered");
  }
  score.things += first.size();
  score.identities += objects.size();
}

void follow(const SyntheticSequence& sequence, std::size_t every, Score& score) {
  std::string problem;
  PerceptionOptions options;
  options.request = Request{};
  options.threads = 1;
  auto perception = Perception::make(object_annotators(knowledge_of(sequence)), options, problem);
  ASSERT_TRUE(perception) << problem;
  Diagnostics diagnostics;
  auto model = parse_model(scenes_identity_model(), "scenes.mln", diagnostics);
  InferenceOptions inference;
  auto tracker = SceneTracker::make(std::move(*model), *shipped_mapping("perception"), inference, {}, problem);
  ASSERT_TRUE(tracker) << problem;
  Monitor monitor;
  std::vector<TrackingStep> steps;
  std::vector<std::map<std::string, std::string>> names;
  std::map<std::string, bool> there;  // by name: whether enough of it can be seen
  for (std::size_t index = 0; index < sequence.size(); index += every) {
    const TrueFrame truth = sequence.frame(index);
    const Perceived perceived =
        perception->perceive(truth.frame, sequence.calibration(), index, known_bodies(sequence, index));
    for (const AnnotatorRun& run : perceived.runs) ASSERT_EQ(run.problem, "") << run.annotator;
    if (perceived.reaching > 0) continue;
    names.push_back(score_frame(perceived, truth, score));
    steps.push_back(tracker->feed(perceived.scene, monitor));
    ASSERT_EQ(steps.back().termination, Termination::kCompleted) << steps.back().message;
    there.clear();
    const auto counts = visible(truth);
    for (std::size_t i = 0; i < truth.scene.entities.size(); ++i) {
      const Entity& entity = truth.scene.entities[i];
      if (entity.kind == EntityKind::kObject) there[entity.name] = is_enough(counts, i);
    }
  }
  score_belief(steps, names, tracker->objects(), there, score);
  fmt::print("{}: {} scenes at rest\n", sequence.name(), steps.size());
}

void print(const Score& score) {
  fmt::print("{}{}{}{}{}{} identities {} for {} things\n", text_of("recall", score.recall),
             text_of("precision", score.precision), text_of("shape", score.shapes), text_of("colour", score.colours),
             text_of("class", score.classes), text_of("belief", score.belief), score.identities, score.things);
}

void expect_right(const Score& score, double least_shapes = 0.9) {
  EXPECT_GE(score.recall.rate(), 0.95);
  EXPECT_GE(score.precision.rate(), 0.95);
  EXPECT_GE(score.shapes.rate(), least_shapes);
  EXPECT_GE(score.classes.rate(), 0.9);
  EXPECT_GE(score.belief.rate(), 0.95);
}

// No object is invented but one in twenty.
void expect_few_inventions(const Score& score) {
  EXPECT_LE(static_cast<double>(score.identities), 1.05 * static_cast<double>(score.things));
}

TEST(EndToEnd, BeliefsAboutSyntheticKitchensAreTrue) {
  Score score;
  for (const char* name : {"table_moves", "table_removals", "table_occlusion", "robot_table"}) {
    for (const std::uint64_t seed : {1U, 2U}) {
      follow(*make_sequence(name, {.seed = seed}), 10, score);
      if (HasFatalFailure()) return;
    }
  }
  print(score);
  expect_right(score);
  expect_few_inventions(score);
}

TEST(EndToEnd, ThingsOnATableAndOnACounterBehindItAreFollowed) {
  Score score;
  for (const std::uint64_t seed : {1U, 2U}) {
    follow(*make_sequence("table_and_counter", {.seed = seed}), 10, score);
    if (HasFatalFailure()) return;
  }
  print(score);
  // At 2.3 m depth is off by 7 mm: a carton of 7.5 cm may be a can.
  expect_right(score, 0.8);
  EXPECT_LE(score.identities, score.things + 2);
}

TEST(EndToEnd, RandomKitchensAreMostlyUnderstood) {
  Score score;
  for (std::uint64_t seed = 201; seed <= 208; ++seed) {
    follow(*make_sequence("random_kitchen", {.seed = seed}), 1, score);
    if (HasFatalFailure()) return;
  }
  print(score);
  expect_right(score);
  expect_few_inventions(score);
}

}  // namespace
}  // namespace sherlog::rgbd
