#include "rgbd/pipeline/capabilities.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <map>
#include <random>
#include <set>

#include "rgbd/pipeline/declared.h"
#include "rgbd/pipeline/perception.h"
#include "rgbd/pipeline/request.h"

namespace sherlog::rgbd {
namespace {

namespace fs = std::filesystem;
using Names = std::vector<std::string>;

class Capabilities : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::path(testing::TempDir()) / testing::UnitTest::GetInstance()->current_test_info()->name();
    fs::remove_all(folder_);
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }

  std::string write(const std::string& name, const std::string& text) {
    const fs::path file = folder_ / name;
    fs::create_directories(file.parent_path());
    std::ofstream(file) << text;
    return file.string();
  }
  void describe(const std::string& name, const std::string& inputs, const std::string& outputs) {
    write(name + ".yaml", "annotator:\n  name: " + name + "\ncapabilities:\n  inputs: " + inputs +
                              "\n  outputs: " + outputs + "\nparameters:\n  sigma: 0.5\n");
  }
  // A kitchen's, in folders as they may be.
  void describe_a_robot() {
    write("io/CollectionReader.yaml",
          "annotator:\n  name: CollectionReader\n  implementation: a_class\n"
          "parameters:\n  camera: [front.ini]\ncapabilities:\n  outputs: ['rs.cv.Mat']\n");
    describe("Clouds", "[rs.cv.Mat]", "[rs.pcl.PointCloud]");
    describe("Filter", "[rs.pcl.PointCloud]", "[rs.pcl.FilteredPointCloud]");
    describe("OtherFilter", "[rs.pcl.PointCloud]", "[rs.pcl.FilteredPointCloud]");
    describe("Planes", "[rs.pcl.FilteredPointCloud]", "[rs.annotation.Plane]");
    describe("Clusters", "[rs.annotation.Plane, rs.pcl.FilteredPointCloud]", "[rs.scene.Cluster]");
    describe("Merger", "[rs.scene.Cluster]", "[rs.scene.MergedCluster]");
    describe("Closest", "[rs.scene.MergedCluster]", "[rs.scene.MergedCluster]");
    describe("Primitives", "[rs.scene.MergedCluster]", "\n    - rs.annotation.Shape: [box, round, flat]");
    describe("Bottles", "[rs.scene.MergedCluster]", "\n    - rs.annotation.Shape: [bottle]\n    - rs.annotation.Pose");
    describe("Labels", "\n    - rs.annotation.Shape: [bottle]", "[rs.annotation.Detection]");
    write("Sizes.yml",
          "annotator: {name: Sizes}\ncapabilities:\n  inputs: [rs.scene.MergedCluster]\n"
          "  outputs: [rs.annotation.SemanticSize]\n  domain: [small, large]\n");
    write("Writer.yaml", "annotator:\n  name: Writer\ncapabilities:\n");
    write("engines/demo.yaml", "ae:\n  name: demo\nfixedflow:\n  - CollectionReader\n  - Clouds\n#  - Filter\n");
  }
  std::optional<Annotators> read() {
    const auto files = find_capability_files(Names{folder_.string()}, problem_);
    return files ? read_capabilities(*files, warnings_, problem_) : std::nullopt;
  }
  std::optional<Perception> plan(const std::string& query) {
    auto annotators = read();
    if (!annotators) return std::nullopt;
    PerceptionOptions options;
    options.request = parse_request(query, problem_);
    return Perception::make(std::move(*annotators), options, problem_);
  }

  fs::path folder_;
  std::string problem_;
  Names warnings_;
};

TEST_F(Capabilities, OfWhoCanSayWhatIsAskedForAreInThePlan) {
  describe_a_robot();
  const auto box = plan(R"({"detect": {"shape": "box"}})");
  ASSERT_TRUE(box) << problem_;
  EXPECT_EQ(box->annotators(),
            (Names{"CollectionReader", "Clouds", "Filter", "Planes", "Clusters", "Merger", "Closest", "Primitives"}));
  EXPECT_TRUE(box->flow().warnings.empty());
  const auto bottle = plan(R"({"detect": {"shape": ["Bottle", "box"]}})");
  ASSERT_TRUE(bottle) << problem_;
  EXPECT_EQ(bottle->annotators(), (Names{"CollectionReader", "Clouds", "Filter", "Planes", "Clusters", "Merger",
                                         "Closest", "Bottles", "Primitives"}));
}

TEST_F(Capabilities, MayNeedAValueOfWhatTheyRead) {
  describe_a_robot();
  const auto flow = plan(R"({"detect": {"detection": "Fanta"}})");
  ASSERT_TRUE(flow) << problem_;
  const Names names = flow->annotators();
  EXPECT_EQ(names.back(), "Labels");
  EXPECT_EQ(std::ranges::count(names, "Bottles"), 1);
  EXPECT_EQ(std::ranges::count(names, "Primitives"), 0);
}

TEST_F(Capabilities, WithoutTheValueAreNamedWithWhatThereIs) {
  describe_a_robot();
  const auto flow = plan(R"({"detect": {"size": "tiny"}})");
  ASSERT_TRUE(flow) << problem_;
  EXPECT_EQ(flow->annotators().back(), "Sizes");
  EXPECT_EQ(flow->flow().warnings,
            (Names{"nobody finds the rs.annotation.SemanticSize 'tiny', which the request needs; "
                   "what can be found: large, small"}));
}

TEST_F(Capabilities, OfAllAreInThePlanForEverything) {
  describe_a_robot();
  const auto flow = plan(R"({"detect": {}})");
  ASSERT_TRUE(flow) << problem_;
  // All opinions; but of clouds only one writer's, and nobody who writes nothing.
  EXPECT_EQ(flow->annotators().size(), 11U);
}

TEST_F(Capabilities, OnlyDescribeAndCannotRun) {
  describe_a_robot();
  auto flow = plan(R"({"detect": {"size": "small"}})");
  ASSERT_TRUE(flow) << problem_;
  const Calibration calibration = kinect_calibration(64, 48);
  Frame frame;
  frame.depth = DepthImage::zeros(48, 64);
  const Perceived perceived = flow->perceive(frame, calibration, 0);
  ASSERT_FALSE(perceived.runs.empty());
  EXPECT_EQ(perceived.runs[0].problem, "it is only described, and cannot run");
}

TEST_F(Capabilities, InAFixedFlowNeedOneCloudBefore) {
  describe_a_robot();
  auto annotators = read();
  ASSERT_TRUE(annotators) << problem_;
  EXPECT_TRUE(fixed_flow(*annotators, Names{}, Names{"CollectionReader", "Clouds", "OtherFilter", "Planes", "Filter"},
                         {}, problem_))
      << problem_;
  EXPECT_FALSE(fixed_flow(*annotators, Names{}, Names{"CollectionReader", "Clouds", "Planes", "Filter"}, {}, problem_));
  EXPECT_NE(problem_.find("'Planes' runs before 'Filter'"), std::string::npos) << problem_;
  const auto names = read_analysis_engine((folder_ / "engines/demo.yaml").string(), problem_);
  ASSERT_TRUE(names) << problem_;
  EXPECT_EQ(*names, (Names{"CollectionReader", "Clouds"}));
}

TEST_F(Capabilities, InACircleAreNamed) {
  describe("a", "[rs.annotation.Pose]", "[rs.annotation.Shape]");
  describe("b", "[rs.annotation.Shape]", "[rs.annotation.Pose]");
  EXPECT_FALSE(plan(R"({"detect": {"shape": "box"}})"));
  EXPECT_NE(problem_.find("circle"), std::string::npos) << problem_;
}

// V comes from its first writer; the second one, in the flow for what else it writes, needs what the reader of V makes.
TEST_F(Capabilities, ReadOneWriterOfACloudThoughAnotherOneRunsLater) {
  describe("a", "[]", "[rs.pcl.V]");
  describe("b", "[rs.pcl.W]", "[rs.pcl.V, rs.annotation.Shape]");
  describe("r", "[rs.pcl.V]", "[rs.pcl.W]");
  const auto flow = plan(R"({"detect": {"shape": "box"}})");
  ASSERT_TRUE(flow) << problem_;
  EXPECT_EQ(flow->annotators(), (Names{"a", "r", "b"}));
}

// The first writer of V by name would need its reader.
TEST_F(Capabilities, TakeTheWriterOfACloudThatMakesNoCircle) {
  describe("a", "[rs.pcl.W]", "[rs.pcl.V]");
  describe("b", "[]", "[rs.pcl.V]");
  describe("r", "[rs.pcl.V]", "[rs.pcl.W]");
  describe("s", "[rs.pcl.W]", "[rs.annotation.Shape]");
  const auto flow = plan(R"({"detect": {"shape": "box"}})");
  ASSERT_TRUE(flow) << problem_;
  EXPECT_EQ(flow->annotators(), (Names{"b", "r", "s"}));
}

TEST_F(Capabilities, ThatChangeWhatOneWroteRunOneAfterTheOther) {
  describe("filter1", "[rs.scene.C]", "[rs.scene.C]");
  describe("filter2", "[rs.scene.C]", "[rs.scene.C]");
  describe("maker", "[]", "[rs.scene.C]");
  describe("aaa", "[rs.scene.C]", "[rs.annotation.Shape]");
  const auto flow = plan(R"({"detect": {"shape": "box"}})");
  ASSERT_TRUE(flow) << problem_;
  EXPECT_EQ(flow->annotators(), (Names{"maker", "filter1", "filter2", "aaa"}));
  EXPECT_EQ(flow->flow().inputs[1].size(), 1U);
  EXPECT_EQ(flow->flow().inputs[2].size(), 2U);
  EXPECT_EQ(flow->flow().inputs[3].size(), 3U);
}

TEST_F(Capabilities, WaitForValuesAndNotForTypes) {
  describe("maker", "[]", "\n    - rs.annotation.Features: [BVLC]");
  describe("knn", "\n    - rs.annotation.Features: [BVLC]", "[rs.annotation.Classification]");
  describe("late", "[rs.annotation.Classification]", "\n    - rs.annotation.Features: [OTHER]");
  const auto flow = plan(R"({"detect": {}})");
  ASSERT_TRUE(flow) << problem_;
  EXPECT_EQ(flow->annotators(), (Names{"maker", "knn", "late"}));
  auto annotators = read();
  EXPECT_TRUE(fixed_flow(*annotators, Names{}, Names{"maker", "knn", "late"}, {}, problem_)) << problem_;
}

TEST_F(Capabilities, ThatCannotRunAreLeftOutWhereOthersDo) {
  describe("a", "[rs.pcl.Nothing]", "[rs.pcl.V, rs.annotation.Shape]");
  describe("b", "[]", "[rs.pcl.V]");
  describe("s", "[rs.pcl.V]", "[rs.annotation.Shape]");
  const auto flow = plan(R"({"detect": {"shape": "box"}})");
  ASSERT_TRUE(flow) << problem_;
  EXPECT_EQ(flow->annotators(), (Names{"b", "s"}));
  EXPECT_EQ(flow->flow().warnings, Names{"'a' is left out: nobody writes 'rs.pcl.Nothing', which 'a' needs"});
  EXPECT_EQ(plan(R"({"detect": {}})")->annotators(), (Names{"b", "s"}));
  fs::remove(folder_ / "s.yaml");
  EXPECT_FALSE(plan(R"({"detect": {"shape": "box"}})"));
  EXPECT_EQ(problem_, "nobody writes 'rs.pcl.Nothing', which 'a' needs");
}

TEST_F(Capabilities, DoNotCountForWhatTheyNeedThemselves) {
  describe("a", "\n    - rs.annotation.Shape: [x]", "\n    - rs.annotation.Shape: [x]\n    - rs.annotation.Detection");
  describe("b", "[]", "\n    - rs.annotation.Shape: [y]");
  const auto flow = plan(R"({"detect": {"detection": "q"}})");
  ASSERT_TRUE(flow) << problem_;
  EXPECT_EQ(flow->annotators(), (Names{"b", "a"}));
  EXPECT_EQ(flow->flow().warnings,
            Names{"nobody finds the rs.annotation.Shape 'x', which 'a' needs; what can be found: y"});
}

// A circle elsewhere changes nothing.
TEST_F(Capabilities, ReadTheFirstCloudThoughThereIsACircleElsewhere) {
  describe("a", "[rs.pcl.W]", "[rs.pcl.V]");
  describe("b", "[]", "[rs.pcl.V]");
  describe("r", "[rs.pcl.V]", "[rs.pcl.W]");
  describe("s", "[rs.pcl.W]", "[rs.annotation.Shape]");
  describe("c1", "[rs.pcl.X]", "[rs.pcl.U]");
  describe("c2", "[]", "[rs.pcl.U]");
  describe("t", "[rs.pcl.U]", "[rs.annotation.Shape]");
  describe("x", "[]", "[rs.pcl.X]");
  const auto flow = plan(R"({"detect": {"shape": "box"}})");
  ASSERT_TRUE(flow) << problem_;
  EXPECT_EQ(flow->annotators(), (Names{"b", "r", "s", "x", "c1", "t"}));
}

TEST_F(Capabilities, ThatNobodyAskedForDoNotEndThePlan) {
  describe("pose", "[rs.nothing]", "[rs.annotation.PoseAnnotation]");
  describe("shape", "[]", "[rs.annotation.Shape]");
  const auto flow = plan(R"({"detect": {"shape": "box"}})");
  ASSERT_TRUE(flow) << problem_;
  EXPECT_EQ(flow->annotators(), Names{"shape"});
  EXPECT_EQ(flow->flow().warnings,
            Names{"rs.annotation.PoseAnnotation is not found: nobody writes 'rs.nothing', which 'pose' needs"});
}

TEST_F(Capabilities, InAFixedFlowAreHeldAgainstWhatIsAsked) {
  describe_a_robot();
  auto annotators = read();
  ASSERT_TRUE(annotators) << problem_;
  const Wanted bottle{{"rs.annotation.Shape"}, {"bottle"}}, colour{{"rs.annotation.SemanticColor"}};
  const Names order = {"CollectionReader", "Clouds", "Filter", "Planes", "Clusters", "Merger", "Primitives", "Labels"};
  const auto flow = fixed_flow(*annotators, Names{}, order, std::vector{bottle, colour}, problem_);
  ASSERT_TRUE(flow) << problem_;
  ASSERT_EQ(flow->warnings.size(), 3U);
  EXPECT_NE(flow->warnings[0].find("'bottle', which 'Labels' needs"), std::string::npos) << flow->warnings[0];
  EXPECT_NE(flow->warnings[1].find("'bottle', which the request needs"), std::string::npos) << flow->warnings[1];
  EXPECT_NE(flow->warnings[2].find("nobody writes 'rs.annotation.SemanticColor'"), std::string::npos);
}

TEST_F(Capabilities, InAFixedFlowThatComeTooLateAreNamed) {
  describe("early", "[]", "\n    - rs.annotation.Features: [OTHER]");
  describe("knn", "\n    - rs.annotation.Features: [BVLC]", "[rs.annotation.Classification]");
  describe("late", "[]", "\n    - rs.annotation.Features: [BVLC]");
  auto annotators = read();
  ASSERT_TRUE(annotators) << problem_;
  EXPECT_FALSE(fixed_flow(*annotators, Names{}, Names{"early", "knn", "late"}, {}, problem_));
  EXPECT_EQ(problem_, "'knn' runs before 'late', whose results it reads");
  describe("early", "[]", "[rs.annotation.Features]");
  annotators = read();
  const auto flow = fixed_flow(*annotators, Names{}, Names{"early", "knn", "late"}, {}, problem_);
  ASSERT_TRUE(flow) << problem_;
  EXPECT_EQ(flow->warnings, Names{"'knn' runs before 'late', whose rs.annotation.Features it could read"});
}

// Of random names, some with values of their types.
class Random : public Declared {
 public:
  Random(std::mt19937_64& random, std::size_t number)
      : Declared("n" + std::to_string(number), some(random), some(random), static_cast<double>(random() % 3)) {
    for (const std::string& name : writes()) set_written_values(name, values(random, name));
    for (const std::string& name : reads()) read_values_[name] = values(random, name);
  }
  Names read_values(const std::string& type) const override { return find_or_none(read_values_, type); }
  void process(const Analysis& /*in*/, Analysis& /*out*/) override {}

  static std::string any(std::mt19937_64& random) {
    const Names names = {"a", "b", "c", "d", "rs.annotation.Shape", "rs.annotation.Pose", "rs.annotation.Features"};
    return names[random() % names.size()];
  }

 private:
  static Names some(std::mt19937_64& random) {
    Names result;
    for (std::size_t i = random() % 3; i > 0; --i) result.push_back(any(random));
    return result;
  }
  static Names values(std::mt19937_64& random, const std::string& name) {
    const char* kValues[] = {"x", "y", "z"};
    return is_type_name(name) && random() % 2 == 0 ? Names{kValues[random() % 3]} : Names{};
  }
  std::map<std::string, Names> read_values_;
};

// Who may write what the reader needs, by what the words say: those with its value, else all; without itself.
std::set<std::size_t> writers_for(const Annotators& annotators, std::size_t reader, const std::string& name) {
  const Names needed = reader < annotators.size() ? annotators[reader]->read_values(name) : Names();
  std::set<std::size_t> all, able;
  for (std::size_t i = 0; i < annotators.size(); ++i) {
    if (i == reader || !provides(*annotators[i], name)) continue;
    const Names written = annotators[i]->written_values(name);
    all.insert(i);
    if (needed.empty() || written.empty() || written == needed) able.insert(i);
  }
  return able.empty() ? all : able;
}

// Against a slow search: there is a plan where there should be, and everything in it can run and has what it needs from
// before.
TEST_F(Capabilities, AtRandomMakePlansThatHold) {
  std::mt19937_64 random(4);
  std::size_t planned = 0;
  for (int round = 0; round < 6000; ++round) {
    Annotators annotators;
    for (std::size_t i = random() % 8 + 1; i > 0; --i) annotators.push_back(std::make_unique<Random>(random, i));
    const std::string wanted = Random::any(random);
    // Who can run: what is given and written by those who can, until nothing is new.
    std::set<std::size_t> able;
    const auto has_writer = [&](const std::string& name, std::size_t reader) {
      return name == "a" || std::ranges::any_of(writers_for(annotators, reader, name),
                                                [&](std::size_t i) { return able.contains(i); });
    };
    for (bool is_new = true; is_new;) {
      is_new = false;
      for (std::size_t i = 0; i < annotators.size(); ++i) {
        const Names reads = annotators[i]->reads();
        const bool can = std::ranges::all_of(reads, [&](const std::string& name) { return has_writer(name, i); });
        if (can && able.insert(i).second) is_new = true;
      }
    }
    const auto flow = plan_flow(annotators, Names{"a"}, std::vector<Wanted>{{{wanted}}}, problem_);
    ASSERT_EQ(flow.has_value(), has_writer(wanted, annotators.size())) << round << ": " << problem_;
    if (!flow) continue;
    ++planned;
    for (std::size_t step = 0; step < flow->order.size(); ++step) {
      const std::size_t reader = flow->order[step];
      ASSERT_TRUE(able.contains(reader)) << round;
      for (const std::string& name : annotators[reader]->reads()) {
        const auto writers = writers_for(annotators, reader, name);
        std::size_t sources = 0;
        for (const Flow::Input& input : flow->inputs[step]) {
          ASSERT_LT(input.from, step) << round;
          if (std::ranges::count(input.names, name) == 0) continue;
          EXPECT_TRUE(writers.contains(flow->order[input.from])) << round;
          ++sources;
        }
        EXPECT_TRUE(name == "a" ? sources == 0 : sources > 0) << round;
        EXPECT_TRUE(is_type_name(name) || sources <= 1) << round;
      }
    }
    for (const std::size_t i : able) {
      if (!is_type_name(wanted) || !provides(*annotators[i], wanted)) continue;
      EXPECT_EQ(std::ranges::count(flow->order, i), 1) << round << ": an opinion is missing";
    }
  }
  EXPECT_GT(planned, 2000U);
}

TEST_F(Capabilities, ThatAreWrongAreRefusedWithTheirPlace) {
  const struct {
    const char *text, *expected;
  } kCases[] = {
      {"annotator: [", "a.yaml:"},
      {"annotator:\n  name: A\n name: B\n", "a.yaml:3:"},
      {"", "a map was expected"},
      {"- a\n", "a.yaml:1:1: a map was expected"},
      {"x: 1\n", "a.yaml:1:1: 'annotator:' with a name was expected"},
      {"annotator: A\n", "a.yaml:1:12: 'annotator:' with a name was expected"},
      {"annotator:\n  kind: A\n", "a.yaml:2:3: the annotator has no name"},
      {"annotator: {name: }\n", "the annotator's name was expected"},
      {"annotator: {name: A}\ncapabilities: 3\n", "a.yaml:2:15: capabilities are a map"},
      {"annotator: {name: A}\ncapabilities:\n  inputs: x\n", "a.yaml:3:11: a list was expected"},
      {"annotator: {name: A}\ncapabilities:\n  inputs: [[x]]\n", "a.yaml:3:12: a type's name"},
      {"annotator: {name: A}\ncapabilities:\n  outputs:\n    - x: {y: z}\n", "a.yaml:4:10: a list was expected"},
      {"annotator: {name: A}\ncapabilities:\n  outputs: [x: [[1]]]\n", "a value was expected"},
      {"annotator: {name: A}\n---\nannotator: {name: B}\n", "a.yaml:3:1: a second document"},
      {"annotator: {name: A}\ncapabilities: {inputs: [], inputs: [x]}\n", "a.yaml:2:28: 'inputs' is there twice"},
      {"annotator: {name: A, name: B}\n", "a.yaml:1:22: 'name' is there twice"},
      {"annotator: {name: \"A\\eB\"}\n", "a.yaml:1:19: the annotator's name was expected"},
  };
  for (const auto& [text, expected] : kCases) {
    write("a.yaml", text);
    problem_.clear();
    EXPECT_FALSE(read()) << text;
    EXPECT_NE(problem_.find(expected), std::string::npos) << text << "\n" << problem_;
  }
  write("a.yaml", std::string(20000, '['));
  EXPECT_FALSE(read());
  EXPECT_NE(problem_.find("nested too deeply"), std::string::npos) << problem_;
  write("a.yaml", "annotator: {name: A}\ncapabilities:\n  output: [x]\n");
  EXPECT_TRUE(read()) << problem_;
  ASSERT_EQ(warnings_.size(), 1U);
  EXPECT_NE(warnings_[0].find("a.yaml:3:3: 'output' is none of"), std::string::npos) << warnings_[0];
  write("a.yaml", "annotator: {name: A}\n");
  write("b.yaml", "annotator: {name: A}\n");
  EXPECT_FALSE(read());
  EXPECT_NE(problem_.find("the annotator 'A' is in "), std::string::npos) << problem_;
  EXPECT_FALSE(read_capabilities(Names{(folder_ / "none").string()}, warnings_, problem_));
  EXPECT_FALSE(read_capabilities(Names{folder_.string()}, warnings_, problem_));
  fs::create_directories(folder_ / "empty");
  EXPECT_FALSE(find_capability_files(Names{(folder_ / "empty").string()}, problem_));
  const std::string a = (folder_ / "a.yaml").string();
  EXPECT_EQ(find_capability_files(Names{a, a, folder_.string() + "/./a.yaml"}, problem_), Names{a});
  EXPECT_FALSE(read_analysis_engine(write("e.yaml", "fixedflow: []\n"), problem_));
  EXPECT_FALSE(read_analysis_engine(write("e.yaml", "ae: {name: x}\n"), problem_));
}

}  // namespace
}  // namespace sherlog::rgbd
