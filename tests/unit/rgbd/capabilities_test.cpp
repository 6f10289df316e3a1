#include "rgbd/pipeline/capabilities.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

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
  std::optional<Annotators> read() { return read_capabilities(Names{folder_.string()}, problem_); }
  std::optional<Perception> plan(const std::string& query) {
    auto annotators = read();
    if (!annotators) return std::nullopt;
    PerceptionOptions options;
    options.request = parse_request(query, problem_);
    return Perception::make(std::move(*annotators), options, problem_);
  }

  fs::path folder_;
  std::string problem_;
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
            (Names{"nobody finds the rs.annotation.SemanticSize 'tiny', which the request needs: "
                   "there are large, small"}));
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
                         problem_))
      << problem_;
  EXPECT_FALSE(fixed_flow(*annotators, Names{}, Names{"CollectionReader", "Clouds", "Planes", "Filter"}, problem_));
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
TEST_F(Capabilities, InACircleThroughTheOtherWriterOfACloudAreNamed) {
  describe("a", "[]", "[rs.pcl.V]");
  describe("b", "[rs.pcl.W]", "[rs.pcl.V, rs.annotation.Shape]");
  describe("r", "[rs.pcl.V]", "[rs.pcl.W]");
  EXPECT_FALSE(plan(R"({"detect": {"shape": "box"}})"));
  EXPECT_NE(problem_.find("circle among b, r"), std::string::npos) << problem_;
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
  };
  for (const auto& [text, expected] : kCases) {
    write("a.yaml", text);
    problem_.clear();
    EXPECT_FALSE(read()) << text;
    EXPECT_NE(problem_.find(expected), std::string::npos) << text << "\n" << problem_;
  }
  write("a.yaml", std::string(20000, '['));
  EXPECT_FALSE(read());
  write("a.yaml", "annotator: {name: A}\n");
  write("b.yaml", "annotator: {name: A}\n");
  EXPECT_FALSE(read());
  EXPECT_NE(problem_.find("the annotator 'A' is in "), std::string::npos) << problem_;
  EXPECT_FALSE(read_capabilities(Names{(folder_ / "none").string()}, problem_));
  fs::create_directories(folder_ / "empty");
  EXPECT_FALSE(read_capabilities(Names{(folder_ / "empty").string()}, problem_));
  EXPECT_FALSE(read_analysis_engine(write("e.yaml", "fixedflow: []\n"), problem_));
  EXPECT_FALSE(read_analysis_engine(write("e.yaml", "ae: {name: x}\n"), problem_));
}

}  // namespace
}  // namespace sherlog::rgbd
