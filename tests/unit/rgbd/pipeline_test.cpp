#include <gtest/gtest.h>

#include <condition_variable>
#include <functional>
#include <mutex>
#include <new>
#include <random>
#include <set>
#include <thread>

#include "perception_bridge/evidence_mapping.h"
#include "perception_bridge/observe.h"
#include "rgbd/pipeline/frame_source.h"
#include "rgbd/pipeline/perception.h"

namespace sherlog::rgbd {
namespace {

using Names = std::vector<std::string>;

std::vector<Wanted> wants(const Names& names) {
  std::vector<Wanted> wanted;
  for (const std::string& name : names) wanted.push_back({{name}});
  return wanted;
}

// An annotator made of a function.
class Simple : public Annotator {
 public:
  using Body = std::function<void(const Analysis&, Analysis&)>;
  Simple(std::string name, Names reads, Names writes, Body body = {}, double cost = 1)
      : name_(std::move(name)),
        reads_(std::move(reads)),
        writes_(std::move(writes)),
        body_(std::move(body)),
        cost_(cost) {}
  std::string name() const override { return name_; }
  Names reads() const override { return reads_; }
  Names writes() const override { return writes_; }
  double cost() const override { return cost_; }
  void process(const Analysis& in, Analysis& out) override {
    if (body_) return body_(in, out);
    for (const std::string& name : writes_) {
      if (is_type_name(name)) {
        out.annotate(0, make(name, name_));
      } else {
        out.set(name, name_);
      }
    }
  }
  static Annotation make(const std::string& type, const std::string& source) {
    Annotation annotation;
    annotation.type = type;
    annotation.source = source;
    return annotation;
  }

 private:
  std::string name_;
  Names reads_, writes_;
  Body body_;
  double cost_;
};

template <class... Rest>
Annotators list(Rest... annotators) {
  Annotators result;
  (result.push_back(std::make_unique<Simple>(std::move(annotators))), ...);
  return result;
}

Names order_of(const Annotators& annotators, const std::optional<Flow>& flow) {
  Names names;
  if (!flow) return names;
  for (const std::size_t position : flow->order) names.push_back(annotators[position]->name());
  return names;
}

Names sources(const Analysis& analysis, std::size_t cluster) {
  Names result;
  for (const Annotation* annotation : analysis.annotations(cluster)) result.push_back(*annotation->source);
  return result;
}

TEST(Plan, HasOnlyWhoIsNeededInAnOrderThatWorks) {
  const Annotators annotators =
      list(Simple("shape", {"things"}, {"rs.annotation.Shape"}), Simple("things", {"cloud"}, {"things"}),
           Simple("people", {"depth"}, {"people"}), Simple("cloud", {"depth"}, {"cloud"}));
  std::string problem;
  const auto flow = plan_flow(annotators, Names{"depth"}, wants({"rs.annotation.Shape"}), problem);
  EXPECT_EQ(order_of(annotators, flow), (Names{"cloud", "things", "shape"})) << problem;
}

TEST(Plan, TakesTheCheaperWriterOfAViewAndAllOfAnAnnotation) {
  const Annotators annotators =
      list(Simple("slow", {"depth"}, {"cloud"}, {}, 9), Simple("quick", {"depth"}, {"cloud"}, {}, 2),
           Simple("one", {"cloud"}, {"rs.annotation.Shape"}), Simple("two", {"cloud"}, {"rs.annotation.Shape"}));
  std::string problem;
  const auto flow = plan_flow(annotators, Names{"depth"}, wants({"rs.annotation.Shape"}), problem);
  EXPECT_EQ(order_of(annotators, flow), (Names{"quick", "one", "two"})) << problem;
}

TEST(Plan, NamesTheMembersOfACircle) {
  const Annotators annotators = list(Simple("a", {"y"}, {"x"}), Simple("b", {"x"}, {"y"}));
  std::string problem;
  EXPECT_FALSE(plan_flow(annotators, Names{"depth"}, wants({"x"}), problem));
  EXPECT_NE(problem.find("a -> b -> a"), std::string::npos) << problem;
  EXPECT_FALSE(fixed_flow(annotators, Names{"depth"}, Names{"a", "b"}, {}, problem));
  EXPECT_NE(problem.find("'a' runs before 'b'"), std::string::npos) << problem;
}

TEST(Plan, NamesWhatNobodyWritesAndWhoNeedsIt) {
  const Annotators annotators = list(Simple("a", {"rs.annotation.Barcode"}, {"x"}));
  std::string problem;
  EXPECT_FALSE(plan_flow(annotators, Names{"depth"}, wants({"x"}), problem));
  EXPECT_NE(problem.find("'rs.annotation.Barcode', which 'a' needs"), std::string::npos) << problem;
  EXPECT_FALSE(fixed_flow(annotators, Names{"depth"}, Names{"a"}, {}, problem));
  EXPECT_NE(problem.find("'rs.annotation.Barcode'"), std::string::npos) << problem;
  EXPECT_FALSE(fixed_flow(annotators, Names{"depth"}, Names{"nobody"}, {}, problem));
  EXPECT_NE(problem.find("no annotator 'nobody'"), std::string::npos) << problem;
}

// Random flows: whatever the number of threads, nobody runs before what it reads is there, and the results are the
// same.
TEST(Run, GivesTheSameForAnyNumberOfThreads) {
  std::mt19937_64 random(3);
  for (int round = 0; round < 20; ++round) {
    Annotators annotators;
    const std::size_t count = 4 + random() % 12;
    for (std::size_t i = 0; i < count; ++i) {
      Names reads;
      for (std::size_t j = 0; j < i; ++j) {
        if (random() % 3 == 0) reads.push_back("v" + std::to_string(j));
      }
      const std::string view = "v" + std::to_string(i);
      annotators.push_back(std::make_unique<Simple>("a" + std::to_string(i), reads, Names{view, "rs.annotation.Shape"},
                                                    [reads, view, i](const Analysis& in, Analysis& out) {
                                                      std::string text = view;
                                                      for (const std::string& name : reads)
                                                        text += in.need<std::string>(name);
                                                      std::this_thread::sleep_for(
                                                          std::chrono::microseconds(i * 37 % 200));
                                                      out.set(view, text);
                                                      for (std::size_t k = 0; k < 50; ++k)
                                                        out.annotate(k % 7, Simple::make("rs.annotation.Shape", view));
                                                    }));
    }
    std::string problem;
    const auto flow = plan_flow(annotators, Names{}, wants({"rs.annotation.Shape"}), problem);
    ASSERT_TRUE(flow) << problem;
    Analysis one;
    run_flow(annotators, *flow, one, 1);
    EXPECT_EQ(sources(one, 0).size(), count * 8);  // 0, 7, ..., 49: nothing is lost
    for (const std::uint32_t threads : {2U, 5U}) {
      Analysis many;
      for (const AnnotatorRun& run : run_flow(annotators, *flow, many, threads)) EXPECT_EQ(run.problem, "");
      for (std::size_t k = 0; k < 7; ++k) EXPECT_EQ(sources(many, k), sources(one, k));
      const std::string last = "v" + std::to_string(count - 1);
      EXPECT_EQ(many.need<std::string>(last), one.need<std::string>(last));
    }
  }
}

TEST(Run, IndependentBranchesRunAtOnce) {
  // Each waits until the other one has begun, so one thread alone could not do it.
  std::mutex mutex;
  std::condition_variable changed;
  int begun = 0;
  const auto meet = [&](const Analysis&, Analysis& out) {
    std::unique_lock lock(mutex);
    ++begun;
    changed.notify_all();
    const bool both = changed.wait_for(lock, std::chrono::seconds(20), [&] { return begun == 2; });
    out.annotate(0, Simple::make("rs.annotation.Shape", both ? "met" : "alone"));
  };
  const Annotators annotators = list(Simple("objects", {"depth"}, {"rs.annotation.Shape"}, meet),
                                     Simple("people", {"depth"}, {"rs.annotation.Shape"}, meet));
  std::string problem;
  const auto flow = plan_flow(annotators, Names{"depth"}, wants({"rs.annotation.Shape"}), problem);
  Analysis analysis;
  analysis.set("depth", 1);
  run_flow(annotators, *flow, analysis, 2);
  EXPECT_EQ(sources(analysis, 0), (Names{"met", "met"}));
}

TEST(Run, GoesOnWithoutTheResultOfOneThatThrows) {
  const auto fail = [](const Analysis&, Analysis& out) {
    out.annotate(0, Simple::make("rs.annotation.Shape", "half"));
    throw std::runtime_error("the lamp is off");
  };
  const Annotators annotators = list(Simple("bad", {"depth"}, {"forms", "rs.annotation.Shape"}, fail),
                                     Simple("needs", {"forms"}, {"rs.annotation.Geometry"}),
                                     Simple("good", {"depth"}, {"rs.annotation.SemanticColor"}));
  std::string problem;
  const auto flow =
      plan_flow(annotators, Names{"depth"},
                wants({"rs.annotation.Shape", "rs.annotation.Geometry", "rs.annotation.SemanticColor"}), problem);
  ASSERT_TRUE(flow) << problem;
  for (const std::uint32_t threads : {1U, 3U}) {
    Analysis analysis;
    analysis.set("depth", 1);
    const auto runs = run_flow(annotators, *flow, analysis, threads);
    EXPECT_EQ(sources(analysis, 0), Names{"good"});
    ASSERT_EQ(runs.size(), 3U);
    EXPECT_EQ(runs[0].problem, "the lamp is off");
    EXPECT_TRUE(runs[0].ran);
    EXPECT_NE(runs[1].problem.find("'forms' is missing, which 'bad'"), std::string::npos) << runs[1].problem;
    EXPECT_FALSE(runs[1].ran);
    EXPECT_EQ(runs[2].problem, "");
  }
}

TEST(Run, EndsWhereMemoryDoes) {
  const auto greedy = [](const Analysis&, Analysis&) { throw std::bad_alloc(); };
  const auto by_opencv = [](const Analysis&, Analysis&) {
    throw cv::Exception(cv::Error::StsNoMem, "failed to allocate", "process", "here", 1);
  };
  for (const Simple::Body& process : {Simple::Body(greedy), Simple::Body(by_opencv)}) {
    const Annotators annotators = list(Simple("greedy", {"depth"}, {"rs.annotation.Shape"}, process),
                                       Simple("good", {"depth"}, {"rs.annotation.SemanticColor"}));
    std::string problem;
    const auto flow =
        plan_flow(annotators, Names{"depth"}, wants({"rs.annotation.Shape", "rs.annotation.SemanticColor"}), problem);
    ASSERT_TRUE(flow) << problem;
    for (const std::uint32_t threads : {1U, 3U}) {
      Analysis analysis;
      analysis.set("depth", 1);
      EXPECT_THROW(run_flow(annotators, *flow, analysis, threads), std::bad_alloc);
    }
  }
}

TEST(Run, ShowsNobodyMoreThanItDeclaresAndRefusesWhatItDoesNot) {
  bool saw_colour = true;
  const auto peek = [&](const Analysis& in, Analysis& out) {
    saw_colour = in.has("colour");
    out.set("secret", 1);
  };
  const Annotators annotators = list(Simple("peek", {"depth"}, {"forms"}, peek));
  std::string problem;
  const auto flow = plan_flow(annotators, Names{"depth", "colour"}, wants({"forms"}), problem);
  Analysis analysis;
  analysis.set("depth", 1);
  analysis.set("colour", 1);
  const auto runs = run_flow(annotators, *flow, analysis, 1);
  EXPECT_FALSE(saw_colour);
  EXPECT_NE(runs[0].problem.find("'secret'"), std::string::npos) << runs[0].problem;
  EXPECT_FALSE(analysis.has("secret"));
}

TEST(Times, AreMeansAndSampleDeviationsAndTheirMeansAddUpToTheTotal) {
  RunTimes times;
  times.add({{"a", 1, "", true}, {"b", 10, "", true}});
  times.add({{"a", 3, "", true}, {"b", 20, "", true}});
  times.add({{"a", 5, "no", true}, {"b", 30, "", true}});
  const auto rows = times.rows();
  ASSERT_EQ(rows.size(), 2U);
  EXPECT_DOUBLE_EQ(rows[0].mean, 3);
  EXPECT_DOUBLE_EQ(rows[0].deviation, 2);
  EXPECT_EQ(rows[0].failures, 1U);
  EXPECT_DOUBLE_EQ(rows[1].deviation, 10);
  EXPECT_DOUBLE_EQ(times.total().mean, rows[0].mean + rows[1].mean);
  EXPECT_DOUBLE_EQ(times.total().deviation, 12);
}

TEST(Request, AsksForTypesAndFiltersThings) {
  std::string problem;
  const auto request = parse_request(R"({"detect": {"shape": "Box", "color": ["red", "blue"]}})", problem);
  ASSERT_TRUE(request) << problem;
  const std::vector<Wanted> wanted = request->wanted();
  ASSERT_EQ(wanted.size(), 2U);
  EXPECT_EQ(wanted[0].names, Names{"rs.annotation.Shape"});
  EXPECT_EQ(wanted[0].values, (Names{"box"}));
  EXPECT_EQ(wanted[1].names, Names{"rs.annotation.SemanticColor"});
  EXPECT_EQ(wanted[1].values, (Names{"red", "blue"}));
  Cluster cluster;
  cluster.annotations.push_back(Simple::make("rs.annotation.Shape", ""));
  cluster.annotations.back().fields = {{"shape", Value("box")}};
  EXPECT_FALSE(request->accepts(cluster));
  cluster.annotations.push_back(Simple::make("rs.annotation.SemanticColor", ""));
  cluster.annotations.back().fields = {{"color", Value("Blue")}};
  EXPECT_TRUE(request->accepts(cluster));
  cluster.annotations.back().fields = {{"color", Value("green")}};
  EXPECT_FALSE(request->accepts(cluster));
}

TEST(Request, SaysWhatIsWrong) {
  std::string problem;
  for (const auto& [text, word] :
       {std::pair{R"({"detect": {"shap": "box"}})", "'shap'"}, std::pair{R"({"find": {}})", "'find'"},
        std::pair{R"({"detect": {"shape": 5}})", "'shape'"}, std::pair{R"({"detect": []})", "'detect'"},
        std::pair{R"({"detect": {"shape": []}})", "'shape'"}, std::pair{R"([1])", "one verb"},
        std::pair{R"({"detect")", "line 1"}}) {
    EXPECT_FALSE(parse_request(text, problem)) << text;
    EXPECT_NE(problem.find(word), std::string::npos) << text << ": " << problem;
  }
}

TEST(Knowledge, IsReadOrRefusedWithASentence) {
  std::string problem;
  const auto map =
      parse_map(R"({"surfaces": [{"name": "sink", "min": [0, 1], "max": [2, 3], "height": 0.9}]})", problem);
  ASSERT_TRUE(map) << problem;
  EXPECT_EQ(map->front().name, "sink");
  EXPECT_FALSE(parse_map(R"({"surfaces": [{"name": "sink", "min": [5, 1], "max": [2, 3], "height": 0.9}]})", problem));
  EXPECT_NE(problem.find("surface 1"), std::string::npos) << problem;
  EXPECT_FALSE(parse_map("{}", problem));
  EXPECT_FALSE(parse_known_things(
      R"({"things": [{"name": "a", "shape": "box", "size": [0, 1, 1], "color": [0, 0, 0]}]})", problem));
  EXPECT_NE(problem.find("thing 1"), std::string::npos) << problem;
}

TEST(RequestKeys, AreReadFromAnIniFile) {
  std::string problem;
  const auto keys = parse_request_keys(
      "[keys]\nshape=rs.annotation.Shape\n\n[form]\nlocation=/rs.annotation.Shape/*/shape\n"
      "[kind]\nlocation=/rs.annotation.Classification/*/classname | /rs.annotation.Detection/*/name\n",
      problem);
  ASSERT_TRUE(keys) << problem;
  ASSERT_EQ(keys->size(), 3u);
  EXPECT_EQ((*keys)[2].key, "kind");
  EXPECT_EQ((*keys)[2].type, "rs.annotation.Detection");
  EXPECT_EQ((*keys)[2].pointer, "/name");
  const auto request = parse_request(R"({"detect": {"form": "box"}})", problem, *keys);
  ASSERT_TRUE(request) << problem;
  ASSERT_EQ(request->wanted().size(), 1U);
  EXPECT_EQ(request->wanted()[0].names, Names{"rs.annotation.Shape"});
  EXPECT_FALSE(parse_request(R"({"detect": {"shape": "box"}})", problem, *keys));
  EXPECT_NE(problem.find("form, kind"), std::string::npos) << problem;
  for (const char* text : {"", "[a]\nb=c\n", "[a]\nlocation=shape\n", "no section\n"}) {
    EXPECT_FALSE(parse_request_keys(text, problem)) << text;
    EXPECT_NE(problem, "");
  }
}

// --- the object annotators on synthetic frames

class KitchenTable : public testing::Test {
 protected:
  static const SyntheticSequence& sequence() {
    static const SyntheticSequence made = *make_sequence("table_moves", {.width = 320, .height = 240});
    return made;
  }
  static Perception perception(const char* query, std::uint32_t threads = 1) {
    std::string problem;
    PerceptionOptions options;
    options.threads = threads;
    if (query != nullptr) options.request = parse_request(query, problem);
    auto made = Perception::make(object_annotators(knowledge_of(sequence())), options, problem);
    EXPECT_TRUE(made) << problem;
    return std::move(*made);
  }
  static Perceived look(Perception& perception, const Frame& frame) {
    return perception.perceive(frame, sequence().calibration(), 0);
  }
};

TEST_F(KitchenTable, LooksForObjectsOnlyWhenAsked) {
  EXPECT_EQ(perception(nullptr).annotators(), Names{"DepthPreprocessing"});
  const Names names = perception(R"({"detect": {"shape": "box"}})").annotators();
  EXPECT_NE(std::ranges::find(names, "PrimitiveShapeAnnotator"), names.end());
  for (const char* unneeded : {"DepthPreprocessing", "ColorAnnotator", "KnownThingsAnnotator"}) {
    EXPECT_EQ(std::ranges::find(names, unneeded), names.end()) << unneeded;
  }
}

TEST_F(KitchenTable, AnswersWithTheBoxes) {
  Perception boxes = perception(R"({"detect": {"shape": "box"}})");
  const TrueFrame truth = sequence().frame(0);
  const Perceived perceived = look(boxes, truth.frame);
  std::string problem;
  const auto request = parse_request(R"({"detect": {"shape": "box"}})", problem);
  const Value answer = answer_to(*request, perceived.scene);
  const auto count = std::ranges::count(truth.scene.entities, std::string("box"), &Entity::shape);
  ASSERT_EQ(static_cast<std::ptrdiff_t>(answer.list()->size()), count);
  for (const Value& designator : *answer.list()) {
    SceneMessages messages;
    EXPECT_TRUE(designator_from_json(designator, messages));
    EXPECT_TRUE(messages.errors.empty());
  }
}

TEST_F(KitchenTable, GivesTheSameSceneForAnyNumberOfThreads) {
  const TrueFrame truth = sequence().frame(0);
  Perception one = perception(R"({"detect": {}})", 1), many = perception(R"({"detect": {}})", 4);
  const Perceived first = look(one, truth.frame), second = look(many, truth.frame);
  EXPECT_GE(first.scene.clusters.size(), 7U);
  EXPECT_EQ(first.scene, second.scene);
}

TEST_F(KitchenTable, ScenesAreValidAndBecomeEvidence) {
  Perception all = perception(R"({"detect": {}})");
  const Perceived perceived = look(all, sequence().frame(0).frame);
  EXPECT_TRUE(validate(perceived.scene).empty()) << validate(perceived.scene).front();
  const std::string text = evidence_text(observe(*shipped_mapping("robosherlock"), perceived.scene));
  for (const char* atom : {"shape(c0,", "size(c0,", "color(c0,", "class(c0,"}) {
    EXPECT_NE(text.find(atom), std::string::npos) << atom << "\n" << text;
  }
}

TEST_F(KitchenTable, PlacesAreWithinACentimetreAndNamedByTheMap) {
  Perception all = perception(R"({"detect": {"location": "table"}})");
  const TrueFrame truth = sequence().frame(0);
  const Perceived perceived = look(all, truth.frame);
  ASSERT_FALSE(perceived.scene.clusters.empty());
  for (const Cluster& cluster : perceived.scene.clusters) {
    EXPECT_EQ(place_of(cluster.annotations), "table");
    const auto position = position_of(cluster);
    ASSERT_TRUE(position);
    EXPECT_EQ(position->frame, "map");
    double nearest = 1;
    for (const Entity& entity : truth.scene.entities) {
      if (entity.kind != EntityKind::kObject) continue;
      const Eigen::Vector3d p(position->coordinates[0], position->coordinates[1], position->coordinates[2]);
      nearest = std::min(nearest, (p - entity.pose.translation()).norm());
    }
    EXPECT_LT(nearest, 0.02);
  }
}

// From the cluster to its pixels and its pose and back to the picture (D5).
TEST_F(KitchenTable, ClustersPixelsAndPosesAreOneThing) {
  Perception all = perception(R"({"detect": {}})");
  const TrueFrame truth = sequence().frame(0);
  const Perceived perceived = look(all, truth.frame);
  const auto& things = perceived.analysis.view<Hypotheses>("things")->things;
  const Table* table = &perceived.analysis.view<std::vector<Table>>("tables")->at(0);
  const Calibration& calibration = sequence().calibration();
  const Eigen::Isometry3d to_camera = sequence().camera().inverse();
  for (std::size_t i = 0; i < things.size(); ++i) {
    const Hypothesis& thing = things[i];
    const Cluster& cluster = perceived.scene.clusters[i];
    const Annotation& roi = *annotations_of(cluster.hypotheses, "rs.scene.ImageROI").front();
    EXPECT_EQ(find(roi.fields, "x")->number(), thing.roi.x);
    std::size_t points = 0;
    for (int y = 0; y < thing.roi.height; ++y) {
      for (int x = 0; x < thing.roi.width; ++x) points += thing.mask(y, x) != 0 ? 1U : 0U;
    }
    EXPECT_LE(thing.points.size(), points);
    // Each point is seen at a pixel of the mask, to less than a pixel.
    for (const Eigen::Vector3f& point : thing.points) {
      const Eigen::Vector2d pixel = calibration.pixel(table->pose * Eigen::Vector3d(point.cast<double>()));
      const cv::Point at(static_cast<int>(std::lround(pixel.x())), static_cast<int>(std::lround(pixel.y())));
      ASSERT_TRUE(thing.roi.contains(at));
      EXPECT_NE(thing.mask(at - thing.roi.tl()), 0);
      EXPECT_LT(std::abs(pixel.x() - at.x) + std::abs(pixel.y() - at.y), 0.1);
    }
    const auto position = position_of(cluster);
    if (!position) continue;
    const Eigen::Vector3d middle(position->coordinates[0], position->coordinates[1], position->coordinates[2]);
    const Eigen::Vector2d pixel = calibration.pixel(to_camera * middle);
    EXPECT_TRUE(thing.roi.contains(cv::Point(static_cast<int>(pixel.x()), static_cast<int>(pixel.y()))));
  }
}

TEST_F(KitchenTable, SaysThatThereIsNoTableInFramesOfNothing) {
  Perception all = perception(R"({"detect": {}})");
  Frame empty;
  empty.depth = DepthImage::zeros(240, 320);
  empty.colour = ColourImage::zeros(240, 320);
  const Perceived perceived = look(all, empty);
  EXPECT_TRUE(perceived.scene.clusters.empty());
  const auto table = std::ranges::find(perceived.runs, "TableTopAnnotator", &AnnotatorRun::annotator);
  ASSERT_NE(table, perceived.runs.end());
  EXPECT_NE(table->problem.find("there is no table top"), std::string::npos) << table->problem;
}

TEST_F(KitchenTable, FramesWithoutColourHaveTheShapesOfThings) {
  Perception all = perception(R"({"detect": {}})");
  Frame frame = sequence().frame(0).frame;
  const std::size_t with_colour = look(all, frame).scene.clusters.size();
  frame.colour = ColourImage();
  const Perceived perceived = look(all, frame);
  for (const AnnotatorRun& run : perceived.runs) EXPECT_EQ(run.problem, "") << run.annotator;
  EXPECT_GE(perceived.scene.clusters.size() + 2, with_colour);  // what is flat has only colour
  for (const Cluster& cluster : perceived.scene.clusters) {
    EXPECT_FALSE(annotations_of(cluster.annotations, "rs.annotation.Shape").empty());
    EXPECT_TRUE(annotations_of(cluster.annotations, "rs.annotation.SemanticColor").empty());
  }
}

TEST_F(KitchenTable, ImagesOfOtherSizesAreRefusedByName) {
  Perception all = perception(R"({"detect": {}})");
  Frame frame = sequence().frame(0).frame;
  frame.colour = ColourImage::zeros(10, 10);
  Perceived perceived = look(all, frame);
  ASSERT_EQ(perceived.runs.size(), 1u);
  EXPECT_EQ(perceived.runs[0].problem, "the colour image has 10 x 10 pixels, the calibration 320 x 240");
  frame.depth = DepthImage::zeros(5, 7);
  EXPECT_NE(look(all, frame).runs[0].problem.find("depth image has 7 x 5"), std::string::npos);
}

TEST(OnePixel, IsTooFewForATable) {
  std::string problem;
  auto perception = Perception::make(object_annotators({}), {.request = Request{}}, problem);
  ASSERT_TRUE(perception) << problem;
  Frame frame;
  frame.depth = DepthImage(1, 1, std::uint16_t{1000});
  frame.colour = ColourImage(1, 1, cv::Vec3b(1, 2, 3));
  const Perceived perceived = perception->perceive(frame, kinect_calibration(1, 1), 0);
  EXPECT_TRUE(perceived.scene.clusters.empty());
  EXPECT_FALSE(std::ranges::all_of(perceived.runs, [](const auto& run) { return run.problem.empty(); }));
}

}  // namespace
}  // namespace sherlog::rgbd
