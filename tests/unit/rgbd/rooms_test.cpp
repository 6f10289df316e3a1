// The pipeline in rooms where not all is a thing on the one table: robots, floors, other tables, people.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <map>
#include <set>

#include "rgbd/objects/walls.h"
#include "rgbd/pipeline/frame_source.h"
#include "rgbd/pipeline/perception.h"
#include "rgbd/pipeline/truth.h"
#include "rgbd/synthetic/kitchen.h"

namespace sherlog::rgbd {
namespace {

using Eigen::Vector3d;

Perception everything(const Knowledge& knowledge) {
  std::string problem;
  auto made = Perception::make(object_annotators(knowledge), {.request = Request{}, .threads = 1}, problem);
  EXPECT_TRUE(made) << problem;
  return std::move(*made);
}

Perception for_people(const SegmentationOptions& options = {}) {
  std::string problem;
  Annotators annotators = object_annotators({});
  for (auto& annotator : people_annotators(options)) annotators.push_back(std::move(annotator));
  auto made = Perception::make(std::move(annotators), {.also = {"sherlog.annotation.Person"}, .threads = 1}, problem);
  EXPECT_TRUE(made) << problem;
  return std::move(*made);
}

void add_block(Scene& scene, const char* name, const Vector3d& low, const Vector3d& high, cv::Vec3b colour) {
  Entity entity{.name = name, .size = high - low};
  entity.pose.translation() = (low + high) / 2;
  const std::uint16_t number = scene.add(entity);
  scene.bodies.push_back(
      {.shape = BodyShape::kBox, .size = high - low, .pose = entity.pose, .colour = colour, .entity = number});
}

// A floor, two tables beside each other with a gap between them, the second one so high; a thing on each.
SyntheticSequence two_tables(double height_of_second, cv::Vec3b colour_of_second = {90, 130, 170}) {
  Scene room;
  add_block(room, "floor", {-4, -2, -0.1}, {4, 5, 0}, {110, 120, 130});
  add_block(room, "left table", {-0.85, 1, 0.7}, {-0.1, 1.6, 0.75}, {90, 130, 170});
  const double top = height_of_second;
  add_block(room, "right table", {0.1, 1, top - 0.05}, {0.85, 1.6, top}, colour_of_second);
  const auto story = [top](double) {
    Scene scene;
    add_thing(scene, things()[1], "left thing", {-0.45, 1.25, 0.75}, 0.2, false);
    add_thing(scene, things()[2], "right thing", {0.45, 1.25, top}, 0.4, false);
    return scene;
  };
  return {"tables", kinect_calibration(320, 240), look_at({0, -0.1, 1.6}, {0, 1.3, 0.7}), 2, room, story, {}, 1};
}

std::multiset<std::string> names_found(Perception& perception, const SyntheticSequence& sequence, std::size_t index) {
  const TrueFrame truth = sequence.frame(index);
  const Perceived perceived =
      perception.perceive(truth.frame, sequence.calibration(), index, known_bodies(sequence, index));
  std::multiset<std::string> names;
  if (const auto* found = perceived.analysis.view<Hypotheses>("things")) {
    for (const Hypothesis& thing : found->things) {
      const Entity* entity = entity_of(thing, truth);
      names.insert(entity == nullptr ? "nothing" : entity->name);
    }
  }
  return names;
}

TEST(Tables, OfOneHeightAreAllLookedAt) {
  const SyntheticSequence sequence = two_tables(0.75);
  Perception perception = everything({});
  EXPECT_EQ(names_found(perception, sequence, 0), (std::multiset<std::string>{"left thing", "right thing"}));
}

TEST(Tables, OfOneHeightMayHaveDifferentColours) {
  for (const cv::Vec3b& colour : {cv::Vec3b(215, 225, 230), cv::Vec3b(60, 50, 50), cv::Vec3b(40, 40, 170)}) {
    SCOPED_TRACE(static_cast<int>(colour[0]));
    Perception perception = everything({});
    EXPECT_EQ(names_found(perception, two_tables(0.75, colour), 0),
              (std::multiset<std::string>{"left thing", "right thing"}));
  }
}

// A level plane cuts it, and so far away errors of depth make a broad strip of the cut.
TEST(Tables, AreNoWallsFarBehind) {
  for (const double wall : {2.5, 3.0, 3.5, 4.0, 5.0}) {
    for (const std::uint64_t seed : {1U, 2U}) {
      SCOPED_TRACE(wall);
      Scene room;
      add_block(room, "floor", {-6, -2, -0.1}, {6, wall + 1, 0}, {110, 120, 130});
      add_block(room, "table", {-0.6, 0.9, 0.71}, {0.6, 1.6, 0.75}, {90, 130, 170});
      add_block(room, "wall", {-6, wall, 0}, {6, wall + 0.1, 3}, {200, 205, 205});
      add_block(room, "cupboard", {-0.8, wall - 0.5, 0}, {0, wall, 0.91}, {60, 70, 90});
      const auto story = [](double) {
        Scene scene;
        add_thing(scene, things()[1], "thing", {-0.2, 1.2, 0.75}, 0.2, false);
        return scene;
      };
      const SyntheticSequence sequence{
          "room", kinect_calibration(), look_at({0, 0, 1.45}, {0, 1.2, 0.85}), 1, room, story, {}, seed};
      Perception perception = everything({});
      EXPECT_EQ(names_found(perception, sequence, 0), std::multiset<std::string>{"thing"});
    }
  }
}

TEST(Tables, OfTwoHeightsAreBothLookedAt) {
  for (const double height : {0.5, 0.65, 0.80, 0.82, 0.9}) {
    SCOPED_TRACE(height);
    const SyntheticSequence sequence = two_tables(height);
    Perception perception = everything({});
    EXPECT_EQ(names_found(perception, sequence, 0), (std::multiset<std::string>{"left thing", "right thing"}));
  }
}

// A counter at a wall, a cupboard and a corner beside it; things at the wall and in front of it.
TEST(Tables, MayStandAgainstWalls) {
  Scene room;
  add_block(room, "floor", {-4, -2, -0.1}, {4, 5, 0}, {110, 120, 130});
  add_block(room, "counter", {-1.2, 1.2, 0}, {1.2, 1.8, 0.9}, {180, 190, 190});
  add_block(room, "wall", {-3, 1.8, 0}, {3, 1.9, 3}, {200, 205, 205});
  add_block(room, "side wall", {1.2, -2, 0}, {1.3, 1.8, 3}, {195, 205, 200});
  const auto story = [](double) {
    Scene scene;
    add_thing(scene, things()[0], "in front", {-0.3, 1.45, 0.9}, 0.2, false);
    add_thing(scene, things()[2], "at the wall", {0.25, 1.755, 0.9}, 0, false);
    add_thing(scene, things()[3], "cup", {0.0, 1.35, 0.9}, 0, false);
    return scene;
  };
  for (const std::uint64_t seed : {1U, 2U, 3U}) {
    const SyntheticSequence sequence{
        "counter", kinect_calibration(640, 480), look_at({0, 0.2, 1.55}, {0.1, 1.5, 0.9}), 2, room, story, {}, seed};
    Perception perception = everything({});
    EXPECT_EQ(names_found(perception, sequence, 0), (std::multiset<std::string>{"in front", "at the wall", "cup"}));
  }
}

// Of two tables of one height, one stands against a wall.
TEST(Tables, MayStandAgainstWallsBesideOthers) {
  for (const bool has_wall : {true, false}) {
    Scene room;
    add_block(room, "floor", {-4, -2, -0.1}, {4, 5, 0}, {110, 120, 130});
    add_block(room, "left table", {-0.95, 1, 0.7}, {-0.05, 1.7, 0.75}, {90, 130, 170});
    add_block(room, "right table", {0.15, 1, 0.7}, {1.05, 1.6, 0.75}, {90, 130, 170});
    // Things in a row at the other one's rim are none.
    add_block(room, "row", {0.2, 1.55, 0.75}, {0.7, 1.6, 1}, {60, 60, 190});
    if (has_wall) add_block(room, "wall", {-0.95, 1.7, 0}, {0.0, 1.8, 2}, {200, 205, 205});
    const SyntheticSequence sequence{"tables",
                                     kinect_calibration(640, 480),
                                     look_at({0, -0.1, 1.6}, {0, 1.3, 0.7}),
                                     2,
                                     room,
                                     [](double) { return Scene(); },
                                     {},
                                     1};
    const TrueFrame truth = sequence.frame(0);
    const Cloud cloud = cloud_of(truth.frame.depth, sequence.calibration());
    std::string problem;
    const std::vector<Table> tables = find_tables(cloud, truth.frame.pose, {}, problem);
    ASSERT_EQ(tables.size(), 1U) << problem;  // of one height
    const int behind = cv::countNonZero(behind_walls(above_table(cloud, tables[0]), tables[0]));
    EXPECT_EQ(behind > 10'000, has_wall) << behind;
    EXPECT_EQ(behind == 0, !has_wall) << behind;
  }
}

// Neither a box at the near rim nor a row of books at the far one is a wall.
TEST(Tables, HaveThingsAtTheirRims) {
  Scene room;
  add_block(room, "floor", {-4, -2, -0.1}, {4, 5, 0}, {110, 120, 130});
  add_block(room, "table", {-0.8, 1.0, 0.7}, {0.8, 1.7, 0.75}, {90, 130, 170});
  const auto story = [](double) {
    Scene scene;
    add_block(scene, "crate", {-0.6, 1.02, 0.75}, {-0.08, 1.14, 0.93}, {60, 60, 190});
    const char* names[] = {"book 1", "book 2", "book 3", "book 4"};
    for (int i = 0; i < 4; ++i) {
      const double x = 0.05 + 0.17 * i;
      const cv::Vec3b colour(i % 2 == 0 ? 200 : 40, i % 2 == 0 ? 40 : 160, 40);
      add_block(scene, names[i], {x, 1.63, 0.75}, {x + 0.15, 1.67, 0.98}, colour);
    }
    for (Entity& entity : scene.entities) entity.kind = EntityKind::kObject;
    return scene;
  };
  const SyntheticSequence sequence{
      "rims", kinect_calibration(640, 480), look_at({0, 0.0, 1.6}, {0, 1.35, 0.75}), 2, room, story, {}, 1};
  Perception perception = everything({});
  EXPECT_EQ(names_found(perception, sequence, 0),
            (std::multiset<std::string>{"crate", "book 1", "book 2", "book 3", "book 4"}));
}

TEST(Tables, AMapSaysWhichOfTwoHeightsIsMeant) {
  const SyntheticSequence sequence = two_tables(0.9);
  for (const auto& [height, name] : {std::pair{0.75, "left thing"}, {0.9, "right thing"}}) {
    Perception perception = everything({.map = {{"mine", {-2, -2}, {2, 3}, height}}, .things = {}});
    EXPECT_EQ(names_found(perception, sequence, 0), std::multiset<std::string>{name});
  }
}

TEST(Tables, TheFloorIsNone) {
  // More floor than anything else.
  const auto sequence = make_sequence("people_crossing", {.width = 320, .height = 240});
  const TrueFrame truth = sequence->frame(0);
  std::string problem;
  const Cloud cloud = cloud_of(truth.frame.depth, sequence->calibration());
  for (const Table& table : find_tables(cloud, sequence->camera(), {}, problem))
    EXPECT_GT(table.in_world.translation().z(), 0.3);
  TableOptions options;
  options.heights = {0.5};
  EXPECT_TRUE(find_tables(cloud, sequence->camera(), options, problem).empty());
  EXPECT_NE(problem.find("there is no table top"), std::string::npos) << problem;
}

TEST(Structure, IsReadFromTheMap) {
  std::string problem;
  const auto bodies = parse_structure(
      R"({"surfaces": [], "structure": [{"shape": "box", "size": [1, 2, 3], "translation": [0, 0, 1]},
          {"shape": "cylinder", "size": [1, 1, 3], "translation": [0, 5, 1], "rotation": [0, 0, 1, 0]}]})",
      problem);
  ASSERT_TRUE(bodies) << problem;
  ASSERT_EQ(bodies->size(), 2u);
  EXPECT_EQ((*bodies)[1].pose.translation(), Vector3d(0, 5, 1));
  EXPECT_EQ(parse_structure(R"({"surfaces": []})", problem)->size(), 0u);
  for (const char* text : {R"({"structure": [{"shape": "ball", "size": [1, 1, 1], "translation": [0, 0, 0]}]})",
                           R"({"structure": [{"shape": "box", "size": [1, 0, 1], "translation": [0, 0, 0]}]})",
                           R"({"structure": [{"shape": "box", "size": [1, 1, 1]}]})",
                           R"({"structure": [{"shape": "box", "size": [1, 1, 1], "translation": [0, 0, 0],
                               "rotation": [1, 1, 1, 1]}]})"}) {
    EXPECT_FALSE(parse_structure(text, problem)) << text;
    EXPECT_NE(problem.find("structure 1"), std::string::npos) << problem;
  }
}

TEST(RobotsArm, IsNoThingAndReachesOverTheTable) {
  const auto sequence = make_sequence("robot_table");
  Perception perception = everything(knowledge_of(*sequence));
  std::size_t reaching = 0;
  for (const std::size_t index : {0U, 30U, 60U, 100U, 130U}) {
    const TrueFrame truth = sequence->frame(index);
    const Perceived perceived =
        perception.perceive(truth.frame, sequence->calibration(), index, known_bodies(*sequence, index));
    for (const Hypothesis& thing : perceived.analysis.view<Hypotheses>("things")->things)
      EXPECT_NE(entity_of(thing, truth), nullptr) << fmt::format("frame {}: at {}, {}, {} x {}", index, thing.roi.x,
                                                                 thing.roi.y, thing.roi.width, thing.roi.height);
    const bool is_over = std::ranges::any_of(truth.scene.bodies, [&](const Body& body) {
      const Vector3d at = body.pose.translation();
      return truth.scene.entities[body.entity - 1U].kind == EntityKind::kRobot && std::abs(at.x()) < 0.4;
    });
    EXPECT_TRUE(!is_over || perceived.reaching > 0) << "frame " << index;
    reaching += perceived.reaching > 0 ? 1U : 0U;
  }
  EXPECT_GT(reaching, 1u);
}

// How far away the nearest true person is, seen from above, and who.
std::pair<double, std::int32_t> nearest_to(const Person& person, const TrueFrame& truth) {
  std::pair<double, std::int32_t> nearest(10, 0);
  for (const Entity& entity : truth.scene.entities) {
    for (const auto& [joint, place] : entity.joints) {
      nearest = std::min(nearest, {(place - person.position).head<2>().norm(), entity.person});
    }
  }
  return nearest;
}

// Depth flickers where a person ends and the room behind begins.
TEST(People, AreNoSpecksOnTheWallBehindThem) {
  std::size_t right = 0, wrong = 0;
  for (const char* name : {"window", "people_crossing"}) {
    const auto sequence = make_sequence(name, {.seed = 2});
    Perception perception = for_people();
    for (std::size_t index = 0; index < 80; ++index) {
      const TrueFrame truth = sequence->frame(index);
      const Perceived perceived = perception.perceive(truth.frame, sequence->calibration(), index);
      for (const Person& person : *perceived.analysis.view<std::vector<Person>>("people")) {
        (nearest_to(person, truth).first < 0.5 ? right : wrong) += 1;
      }
    }
  }
  EXPECT_GT(right, 80U);
  EXPECT_LE(wrong * 40, right) << wrong << " of " << right + wrong;
}

TEST(People, HaveLabelsThatLastAndPlacesInTheWorld) {
  const auto sequence = make_sequence("people_crossing", {.width = 320, .height = 240});
  Perception perception = for_people();
  EXPECT_EQ(perception.annotators(),
            (std::vector<std::string>{"DepthPreprocessing", "RegionFilter", "HumanAnnotator"}));
  std::map<std::int32_t, std::set<std::int32_t>> labels;  // by the true person
  std::size_t seen = 0, postures = 0;
  for (std::size_t index = 0; index < 130; ++index) {
    const TrueFrame truth = sequence->frame(index);
    const Perceived perceived =
        perception.perceive(truth.frame, sequence->calibration(), index, known_bodies(*sequence, index));
    for (const AnnotatorRun& run : perceived.runs) ASSERT_EQ(run.problem, "") << run.annotator;
    const auto* people = perceived.analysis.view<std::vector<Person>>("people");
    ASSERT_NE(people, nullptr);
    EXPECT_EQ(annotations_of(perceived.scene.annotations, "sherlog.annotation.Person").size(), people->size());
    for (const Person& person : *people) {
      const auto [nearest, who] = nearest_to(person, truth);
      EXPECT_LT(nearest, 0.35) << "frame " << index;
      labels[who].insert(person.label);
      postures = std::max(postures, person.posture + 1);
      ++seen;
    }
  }
  EXPECT_GT(seen, 60u);
  EXPECT_GT(postures, 3u);
  std::set<std::int32_t> all;
  for (const auto& [who, its] : labels) {
    EXPECT_EQ(its.size(), 1u) << "person " << who;
    all.insert(its.begin(), its.end());
  }
  EXPECT_EQ(all.size(), labels.size());
}

// A true person in a frame: where it is (x and depth from the camera), and the labels of its keypoints.
struct Sighting {
  Eigen::Vector2d place = Eigen::Vector2d::Zero();
  std::map<std::int32_t, std::size_t> labels;
  std::size_t keypoints = 0;
  std::int32_t label() const {
    return std::ranges::max_element(labels, {}, [](const auto& entry) { return entry.second; })->first;
  }
};

std::map<std::int32_t, Sighting> sightings(const std::vector<Person>& people, const TrueFrame& truth) {
  std::map<std::int32_t, Sighting> seen;
  for (const Person& person : people) {
    for (const Keypoint& point : person.keypoints) {
      const std::uint16_t entity = truth.entities(point.pixel.y, point.pixel.x);
      const std::int32_t who = entity == 0 ? 0 : truth.scene.entities[entity - 1U].person;
      if (who == 0) continue;
      Sighting& sighting = seen[who];
      ++sighting.labels[person.label];
      ++sighting.keypoints;
    }
  }
  for (const Entity& entity : truth.scene.entities) {
    const auto found = entity.person == 0 ? seen.end() : seen.find(entity.person);
    if (found != seen.end()) found->second.place = entity.pose.translation().head<2>();
  }
  std::erase_if(seen, [](const auto& entry) { return entry.second.keypoints < 60; });  // hidden but for a hand
  return seen;
}

// Of those who stand more than 70 cm from all others that can be seen: how many have a label that nobody else has.
struct CrowdResult {
  std::size_t crowded = 0, most = 0, apart = 0, own = 0;
};

void count_people(const Perceived& perceived, const TrueFrame& truth, std::size_t most_people, CrowdResult& result) {
  for (const AnnotatorRun& run : perceived.runs) EXPECT_EQ(run.problem, "") << run.annotator;
  EXPECT_TRUE(validate(perceived.scene).empty());
  const auto crowds = annotations_of(perceived.scene.annotations, "sherlog.annotation.Crowd");
  EXPECT_LE(crowds.size(), 1U);
  for (const Annotation* crowd : crowds) {
    EXPECT_EQ(find(crowd->fields, "most")->number(), static_cast<double>(most_people));
    EXPECT_GE(find(crowd->fields, "groups")->number(), 1.0);
  }
  result.crowded += crowds.size();
  const auto& people = *perceived.analysis.view<std::vector<Person>>("people");
  EXPECT_LE(people.size(), most_people);
  result.most = std::max(result.most, people.size());
  const auto seen = sightings(people, truth);
  for (const auto& [who, its] : seen) {
    const auto counts = [&, who = who, &its = its](const auto& condition) {
      return std::ranges::any_of(seen,
                                 [&](const auto& other) { return other.first != who && condition(other.second); });
    };
    const double radius = 1.4 * static_cast<double>(SegmentationOptions().radius);  // limbs reach that far
    if (counts([&](const Sighting& other) { return (other.place - its.place).norm() <= radius; })) continue;
    ++result.apart;
    result.own += counts([&](const Sighting& other) { return other.label() == its.label(); }) ? 0U : 1U;
  }
}

TEST(People, FiftyAreMoreThanFifteenAndTheSceneSaysSo) {
  const auto sequence = make_sequence("crowd");
  Perception first = for_people(), second = for_people({.most_means = 64});
  CrowdResult few, many;
  for (std::size_t index = 0; index <= 55; ++index) {
    const TrueFrame truth = sequence->frame(index);
    const auto look = [&](Perception& perception) {
      return perception.perceive(truth.frame, sequence->calibration(), index, known_bodies(*sequence, index));
    };
    count_people(look(first), truth, 15, few);
    count_people(look(second), truth, 64, many);
  }
  for (const auto& [limit, result] : {std::pair{15, few}, std::pair{64, many}}) {
    fmt::print("at most {}: {} frames crowded, up to {} people, {} of {} apart have a label of their own\n", limit,
               result.crowded, result.most, result.own, result.apart);
  }
  EXPECT_GT(few.crowded, 10U);
  EXPECT_EQ(many.crowded, 0U);
  EXPECT_GT(many.most, few.most);
  EXPECT_GT(many.apart, 100U);
  EXPECT_GE(many.own * 100, many.apart * 95);
  EXPECT_LT(few.own * many.apart, many.own * few.apart);
}

// Things and people in one flow, side by side.
TEST(Branches, GiveTheSameForAnyNumberOfThreads) {
  const auto sequence = make_sequence("table_moves", {.width = 320, .height = 240});
  const auto both = [&](std::uint32_t threads) {
    std::string problem;
    Annotators annotators = object_annotators(knowledge_of(*sequence));
    for (auto& annotator : people_annotators()) annotators.push_back(std::move(annotator));
    auto made =
        Perception::make(std::move(annotators),
                         {.request = Request{}, .also = {"sherlog.annotation.Person"}, .threads = threads}, problem);
    EXPECT_TRUE(made) << problem;
    return std::move(*made);
  };
  Perception one = both(1), many = both(4);
  std::size_t people = 0;
  for (std::size_t index = 10; index < 40; index += 6) {
    const TrueFrame truth = sequence->frame(index);
    const KnownBodies bodies = known_bodies(*sequence, index);
    const Perceived first = one.perceive(truth.frame, sequence->calibration(), index, bodies);
    const Perceived second = many.perceive(truth.frame, sequence->calibration(), index, bodies);
    EXPECT_EQ(first.scene, second.scene) << "frame " << index;
    EXPECT_FALSE(first.scene.clusters.empty());
    people += annotations_of(first.scene.annotations, "sherlog.annotation.Person").size();
  }
  EXPECT_GT(people, 0U);  // an arm
}

TEST(People, NobodyIsNobody) {
  const auto sequence = make_sequence("empty_room", {.width = 320, .height = 240});
  Perception perception = for_people();
  for (std::size_t index = 0; index < sequence->size(); ++index) {
    const Perceived perceived = perception.perceive(sequence->frame(index).frame, sequence->calibration(), index);
    EXPECT_TRUE(annotations_of(perceived.scene.annotations, "sherlog.annotation.Person").empty());
  }
}

}  // namespace
}  // namespace sherlog::rgbd
