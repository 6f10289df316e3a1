// Where a recorded robot was: the file, moments between its lines, and a recording that is perceived like its source.
#include "rgbd/pipeline/robot_poses.h"

#include <gtest/gtest.h>

#include <fstream>
#include <iterator>
#include <numbers>

#include "rgbd/pipeline/perception.h"
#include "rgbd/pipeline/recorder.h"

namespace sherlog::rgbd {
namespace {

namespace fs = std::filesystem;
using Eigen::Vector3d;

std::string text_of(const fs::path& file) {
  std::ifstream in(file);
  return {std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
}

class RobotFile : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::path(testing::TempDir()) / testing::UnitTest::GetInstance()->current_test_info()->name();
    fs::remove_all(folder_);
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }

  std::optional<RobotPoses> read(const std::string& text) {
    std::ofstream(folder_ / "robot.txt") << text;
    problem_.clear();
    return RobotPoses::read(folder_ / "robot.txt", problem_);
  }

  fs::path folder_;
  std::string problem_;
};

TEST_F(RobotFile, SaysWhereEachLinkIs) {
  const auto robot = read(
      "# an arm\n"
      "link upper capsule 0.1 0.1 0.3\n"
      "link hand box 0.05 0.1 0.15\n"
      "pose 1.0 upper 1 2 3 0 0 0 1\n"
      "pose 1.0 hand 0 0 1 1 0 0 0\n"
      "pose 1.1 hand 0 0 2 1 0 0 0\n"
      "pose 1.1 upper 2 2 3 0 0 0.70710678 0.70710678\n");
  ASSERT_TRUE(robot) << problem_;
  const auto first = robot->at(1.0, problem_);
  ASSERT_TRUE(first) << problem_;
  ASSERT_EQ(first->size(), 2U);
  EXPECT_EQ((*first)[0].shape, BodyShape::kCapsule);
  EXPECT_EQ((*first)[0].size, Vector3d(0.1, 0.1, 0.3));
  EXPECT_EQ((*first)[0].pose.translation(), Vector3d(1, 2, 3));
  EXPECT_EQ((*first)[1].shape, BodyShape::kBox);
  EXPECT_EQ((*first)[1].pose.linear() * Vector3d::UnitY(), Vector3d(0, -1, 0));
  // A fifth of the way, and of the quarter turn.
  const auto later = robot->at(1.02, problem_);
  ASSERT_TRUE(later) << problem_;
  EXPECT_NEAR((*later)[0].pose.translation().x(), 1.2, 1e-9);
  EXPECT_NEAR(Eigen::AngleAxisd((*later)[0].pose.linear()).angle(), 0.1 * std::numbers::pi, 1e-6);
  EXPECT_NEAR((*later)[1].pose.translation().z(), 1.2, 1e-9);
}

TEST_F(RobotFile, KnowsNothingOfMomentsFarFromItsPoses) {
  const auto robot = read("link hand box 1 1 1\npose 1 hand 0 0 1 0 0 0 1\npose 2 hand 0 0 5 0 0 0 1\n");
  ASSERT_TRUE(robot) << problem_;
  for (const double time : {0.99, 1.0, 1.015})
    EXPECT_EQ(robot->at(time, problem_).value().front().pose.translation().z(), 1);
  for (const double time : {1.985, 2.0, 2.01})
    EXPECT_EQ(robot->at(time, problem_).value().front().pose.translation().z(), 5);
  for (const double time : {0.0, 0.97, 1.03, 1.5, 1.97, 2.03}) {
    EXPECT_FALSE(robot->at(time, problem_)) << time;
    EXPECT_NE(problem_.find("'hand'"), std::string::npos) << problem_;
  }
}

TEST_F(RobotFile, WithABadLineNamesIt) {
  for (const auto& [text, line, word] : {
           std::tuple{"hand box 1 1 1\n", 1, "'hand'"},
           std::tuple{"link hand ball 1 1 1\n", 1, "a link has"},
           std::tuple{"link hand box 1 1\n", 1, "a link has"},
           std::tuple{"link\n", 1, "a link has"},
           std::tuple{"link hand box 1 0 1\n", 1, "a link has"},
           std::tuple{"link hand box 1 nan 1\n", 1, "a link has"},
           std::tuple{"link hand capsule 1 2 1\n", 1, "a link has"},
           std::tuple{"link hand box 1 1 1\nlink hand box 1 1 1\n", 2, "a second time"},
           std::tuple{"link hand box 1 1 1\n# no pose\n", 1, "has no pose"},
           std::tuple{"link hand box 1 1 1\n\npose 1 arm 0 0 0 0 0 0 1\n", 3, "'arm'"},
           std::tuple{"link hand box 1 1 1\npose 1 hand 0 0 0 0 0 0 2\n", 2, "a pose is"},
           std::tuple{"link hand box 1 1 1\npose 1 hand 0 0 0 0 0 1\n", 2, "a pose is"},
           std::tuple{"link hand box 1 1 1\npose hand 1 0 0 0 0 0 0 1\n", 2, "a pose is"},
           std::tuple{"link hand box 1 1 1\npose\n", 2, "a pose is"},
           std::tuple{"link hand box 1 1 1\npose 2 hand 0 0 0 0 0 0 1\npose 2 hand 0 0 0 0 0 0 1\n", 3, "after"},
       }) {
    EXPECT_FALSE(read(text)) << text;
    const std::string place = (folder_ / "robot.txt").string() + ":" + std::to_string(line) + ": ";
    EXPECT_EQ(problem_.find(place), 0U) << problem_;
    EXPECT_NE(problem_.find(word), std::string::npos) << problem_;
  }
}

// A few frames of a synthetic sequence in a folder, with all that is known.
void record(const FrameSource& source, const std::vector<std::size_t>& frames, const fs::path& folder) {
  Recorder recorder(folder, source);
  std::string problem;
  for (const std::size_t index : frames) {
    const auto frame = source.read(index, problem);
    ASSERT_TRUE(frame && recorder.add(*frame, index)) << problem << recorder.problem();
  }
  ASSERT_TRUE(recorder.finish()) << recorder.problem();
}

std::optional<Perception> everything(const Knowledge& knowledge) {
  std::string problem;
  auto made =
      Perception::make(object_annotators(knowledge), {.request = Request{}, .also = {"known"}, .threads = 1}, problem);
  EXPECT_TRUE(made) << problem;
  return made;
}

bool same(const MaskImage& a, const MaskImage& b) { return a.size() == b.size() && cv::norm(a, b, cv::NORM_INF) == 0; }

TEST_F(RobotFile, OfARecordingTakesTheArmOutAsInTheSource) {
  std::string problem;
  const auto source = open_frames("synthetic:robot_table", 1, problem);
  ASSERT_TRUE(source) << problem;
  const std::vector<std::size_t> frames = {30, 70};
  ASSERT_NO_FATAL_FAILURE(record(*source, frames, folder_ / "table"));
  auto recording = open_frames((folder_ / "table").string(), 1, problem);
  ASSERT_TRUE(recording) << problem;
  const auto map = parse_map(text_of(folder_ / "table/map.json"), problem);
  const auto structure = parse_structure(text_of(folder_ / "table/map.json"), problem);
  const auto things = parse_known_things(text_of(folder_ / "table/known.json"), problem);
  ASSERT_TRUE(map && structure && things) << problem;
  recording->knowledge = {*map, *things, *structure};

  auto of_source = everything(source->knowledge), of_recording = everything(recording->knowledge);
  ASSERT_TRUE(of_source && of_recording);
  int robot_pixels = 0;
  for (std::size_t i = 0; i < frames.size(); ++i) {
    const auto expected = of_source->perceive(*source->read(frames[i], problem), source->calibration, frames[i],
                                              source->bodies_at(frames[i]));
    const auto found = of_recording->perceive(*recording->read(i, problem), recording->calibration, frames[i],
                                              recording->bodies_at(i));
    for (const char* view : {"robot", "known"}) {
      const auto *a = expected.analysis.view<MaskImage>(view), *b = found.analysis.view<MaskImage>(view);
      ASSERT_TRUE(a != nullptr && b != nullptr);
      EXPECT_TRUE(same(*a, *b)) << view << " of frame " << frames[i];
    }
    robot_pixels += cv::countNonZero(*expected.analysis.view<MaskImage>("robot"));
    EXPECT_EQ(found.reaching, expected.reaching);
    EXPECT_EQ(found.scene.clusters, expected.scene.clusters) << "frame " << frames[i];
  }
  EXPECT_GT(robot_pixels, 5000);
}

TEST_F(RobotFile, LeavesOutFramesInWhichTheArmIsNowhere) {
  std::string problem;
  const auto source = open_frames("synthetic:robot_table", 1, problem);
  ASSERT_NO_FATAL_FAILURE(record(*source, {0, 30}, folder_ / "table"));
  const fs::path file = folder_ / "table/robot.txt";
  std::string text = text_of(file);
  text.erase(text.rfind("pose"));
  std::ofstream(file) << text;
  const auto recording = open_frames((folder_ / "table").string(), 1, problem);
  ASSERT_TRUE(recording) << problem;
  EXPECT_TRUE(recording->read(0, problem)) << problem;
  EXPECT_FALSE(recording->read(1, problem));
  EXPECT_NE(problem.find("'link_8'"), std::string::npos) << problem;
  EXPECT_TRUE(recording->bodies_at(1).robot.empty());
}

TEST_F(RobotFile, WantsToKnowWhereTheCameraIs) {
  SequenceWriter writer(folder_, kinect_calibration(16, 12));
  ASSERT_TRUE(writer.add({.time = 1,
                          .depth = DepthImage(12, 16, std::uint16_t{500}),
                          .colour = ColourImage(12, 16, cv::Vec3b()),
                          .pose = {}}));
  ASSERT_TRUE(writer.finish());
  std::ofstream(folder_ / "robot.txt") << "link hand box 1 1 1\npose 1 hand 0 0 1 0 0 0 1\n";
  EXPECT_FALSE(open_frames(folder_.string(), 1, problem_));
  EXPECT_NE(problem_.find("where the camera is"), std::string::npos) << problem_;
}

}  // namespace
}  // namespace sherlog::rgbd
