#include "rgbd/frames/sequence.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <functional>
#include <random>

#include "rgbd/frames/png.h"

namespace sherlog::rgbd {
namespace {

using testing::HasSubstr;

namespace fs = std::filesystem;

Frame random_frame(std::uint64_t seed, double time, std::int32_t width = 24, std::int32_t height = 16) {
  std::mt19937_64 random(seed);
  Frame frame{.time = time, .depth = DepthImage(height, width), .colour = ColourImage(height, width), .pose = {}};
  for (std::uint16_t& value : frame.depth)
    value = random() % 4 == 0 ? std::uint16_t{0} : static_cast<std::uint16_t>(random() % 9000);
  for (cv::Vec3b& value : frame.colour) {
    for (int c = 0; c < 3; ++c) value[c] = static_cast<std::uint8_t>(random());
  }
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.linear() = Eigen::AngleAxisd(0.3 + time, Eigen::Vector3d(1, 2, 3).normalized()).toRotationMatrix();
  pose.translation() = Eigen::Vector3d(0.5, -1.25, time);
  frame.pose = pose;
  return frame;
}

bool same(const cv::Mat& a, const cv::Mat& b) {
  return a.size() == b.size() && a.type() == b.type() && cv::norm(a, b, cv::NORM_INF) == 0;
}

class SequenceFolder : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::path(testing::TempDir()) / testing::UnitTest::GetInstance()->current_test_info()->name();
    fs::remove_all(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }

  void write(SequenceLayout layout, std::size_t count = 3) {
    SequenceWriter writer(folder_, kinect_calibration(24, 16), layout);
    for (std::size_t i = 0; i < count; ++i)
      ASSERT_TRUE(writer.add(random_frame(i, 1.5 + 0.1 * static_cast<double>(i)))) << writer.problem();
    ASSERT_TRUE(writer.finish()) << writer.problem();
  }
  void put(const char* name, const std::string& text) { std::ofstream(folder_ / name) << text; }
  std::string text(const char* name) {
    std::ifstream in(folder_ / name);
    return {std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
  }
  std::string problem_of_opening() {
    std::string problem;
    return open_sequence(folder_, problem) ? "" : problem;
  }
  std::string problem_of_frame(std::size_t index) {
    std::string problem;
    const auto sequence = open_sequence(folder_, problem);
    if (!sequence) return "cannot be opened: " + problem;
    return read_frame(*sequence, index, problem) ? "" : problem;
  }
  std::string path(const char* name) { return (folder_ / name).string(); }

  fs::path folder_;
};

TEST_F(SequenceFolder, ComesBackAsWrittenInBothLayouts) {
  for (const SequenceLayout layout : {SequenceLayout::kPlain, SequenceLayout::kTum}) {
    fs::remove_all(folder_);
    write(layout);
    std::string problem;
    const auto sequence = open_sequence(folder_, problem);
    ASSERT_TRUE(sequence) << problem;
    EXPECT_EQ(sequence->layout, layout);
    EXPECT_EQ(sequence->calibration.units_per_metre, layout == SequenceLayout::kTum ? 5000 : 1000);
    EXPECT_DOUBLE_EQ(sequence->calibration.fx, kinect_calibration(24, 16).fx);
    ASSERT_EQ(sequence->frames.size(), 3U);
    for (std::size_t i = 0; i < 3; ++i) {
      const auto frame = read_frame(*sequence, i, problem);
      ASSERT_TRUE(frame) << problem;
      const Frame expected = random_frame(i, 1.5 + 0.1 * static_cast<double>(i));
      EXPECT_NEAR(frame->time, expected.time, 1e-6);
      EXPECT_TRUE(same(frame->depth, expected.depth));
      EXPECT_TRUE(same(frame->colour, expected.colour));
      ASSERT_TRUE(frame->pose);
      EXPECT_TRUE(frame->pose->isApprox(*expected.pose, 1e-9));
    }
  }
}

TEST_F(SequenceFolder, OfTumPairsByNearestTimesAndCountsTheRest) {
  write(SequenceLayout::kTum);  // depth at 1.5, 1.6, 1.7
  put("rgb.txt",
      "# comment\n1.49 rgb/1.500000.png\n1.515 rgb/1.600000.png\n1.601 rgb/1.600000.png\n1.75 rgb/1.700000.png\n");
  std::string problem;
  const auto sequence = open_sequence(folder_, problem);
  ASSERT_TRUE(sequence) << problem;
  ASSERT_EQ(sequence->frames.size(), 2U);                     // 1.7 is 50 ms from 1.75
  EXPECT_EQ(sequence->frames[0].colour, "rgb/1.500000.png");  // 10 ms, not 15
  EXPECT_EQ(sequence->frames[1].colour, "rgb/1.600000.png");
  EXPECT_EQ(sequence->unpaired, 1U);

  put("associations.txt", "1.75 rgb/1.700000.png 1.7 depth/1.700000.png\n");
  const auto associated = open_sequence(folder_, problem);
  ASSERT_TRUE(associated) << problem;
  ASSERT_EQ(associated->frames.size(), 1U);
  EXPECT_EQ(associated->frames[0].depth, "depth/1.700000.png");
  EXPECT_DOUBLE_EQ(associated->frames[0].time, 1.7);
}

TEST_F(SequenceFolder, OfTumHasTheUsualCalibrationWhereThereIsNone) {
  write(SequenceLayout::kTum);
  fs::remove(folder_ / "calibration.txt");
  std::string problem;
  const auto sequence = open_sequence(folder_, problem);
  ASSERT_TRUE(sequence) << problem;
  EXPECT_EQ(sequence->calibration.fx, 525);
  EXPECT_EQ(sequence->calibration.units_per_metre, 5000);
  EXPECT_EQ(problem_of_frame(0),
            path("depth/1.500000.png") + ": the image has 24 x 16 pixels, the calibration 640 x 480");
}

TEST_F(SequenceFolder, ThatIsNoSequenceIsSaidSo) {
  EXPECT_EQ(problem_of_opening(), folder_.string() + ": there is no such folder");
  fs::create_directories(folder_);
  EXPECT_EQ(problem_of_opening(),
            folder_.string() + ": neither frames.txt nor depth.txt is there, so this is no recorded sequence");
  put("frames.txt", "# nothing\n");
  EXPECT_EQ(problem_of_opening(), path("calibration.txt") + ": the file cannot be opened");
  put("calibration.txt", "width 4\nheight 4\nfx 1\nfy 1\ncx 1\ncy 1\n");
  EXPECT_EQ(problem_of_opening(), folder_.string() + ": there is no frame");
}

TEST_F(SequenceFolder, ThatCannotBeLookedAtIsSaidSo) {
  fs::create_symlink(folder_, folder_);
  EXPECT_THAT(problem_of_opening(), HasSubstr(folder_.string() + ": "));
  fs::remove(folder_);
  std::ofstream(folder_) << "a file";
  EXPECT_THAT(problem_of_opening(), HasSubstr("no folder"));
  fs::remove(folder_);
  write(SequenceLayout::kPlain);
  fs::remove(folder_ / "frames.txt");
  fs::create_symlink("frames.txt", folder_ / "frames.txt");
  EXPECT_THAT(problem_of_opening(), HasSubstr("frames.txt"));
}

TEST_F(SequenceFolder, OfTumSaysWhatIsNearInTimeToNothing) {
  write(SequenceLayout::kTum);
  put("groundtruth.txt", "900 0 0 0 0 0 0 1\n");
  std::string problem;
  const auto sequence = open_sequence(folder_, problem);
  ASSERT_TRUE(sequence) << problem;
  EXPECT_TRUE(sequence->poses_missed);
  put("rgb.txt", "900.0 rgb/1.500000.png\n");
  EXPECT_THAT(problem_of_opening(), HasSubstr("rgb.txt"));
}

TEST_F(SequenceFolder, WithAWrongCalibrationNamesTheLine) {
  write(SequenceLayout::kPlain);
  const std::string good = text("calibration.txt");
  const auto replaced = [&](const std::string& from, const std::string& to) {
    std::string changed = good;
    changed.replace(changed.find(from), from.size(), to);
    put("calibration.txt", changed);
    return problem_of_opening();
  };
  const std::string file = path("calibration.txt");
  EXPECT_EQ(replaced("width 24", "width many"), file + ":1: 'width' takes one number");
  EXPECT_EQ(replaced("width 24", "breadth 24"), file + ":1: unknown name 'breadth'");
  EXPECT_EQ(replaced("height 16", ""), file + ": 'height' is missing");
  EXPECT_EQ(replaced("width 24", "width 2.5"), file + ": 2.5 x 16 is not the size of an image");
  EXPECT_EQ(replaced("width 24", "width -24"),
            file + ": an image of -24 x 16 pixels; each side has to be in 1 ... 16384");
  EXPECT_EQ(replaced("cx 11.5", "cx 1e9"), file + ": the optical axis at pixel 1000000000, 7.5 of an image of 24 x 16");
  EXPECT_EQ(replaced("units_per_metre 1000", "units_per_metre 0"),
            file + ": 0 units per metre, which has to be positive");
  EXPECT_NE(replaced("fx 21", "fx -21").find("has to be positive"), std::string::npos);
  EXPECT_NE(replaced("fx 21", "fx nan").find("takes one number"), std::string::npos);
}

TEST_F(SequenceFolder, WhoseTimeGoesBackwardsNamesTheLine) {
  write(SequenceLayout::kPlain);
  const std::string frames = "2 depth/000000.png colour/000000.png\n1.5 depth/000001.png colour/000001.png\n";
  put("frames.txt", frames);
  EXPECT_EQ(problem_of_opening(), path("frames.txt") + ":2: time 1.5 after 2");
  fs::remove_all(folder_);
  write(SequenceLayout::kTum);
  put("depth.txt", "1.5 depth/1.500000.png\n1.5 depth/1.600000.png\n");
  EXPECT_EQ(problem_of_opening(), path("depth.txt") + ":2: time 1.5 after 1.5");
}

TEST_F(SequenceFolder, WithADamagedImageGoesOnBehindIt) {
  write(SequenceLayout::kPlain, 4);
  const fs::path depth = folder_ / "depth/000001.png";
  const auto whole = fs::file_size(depth);
  fs::resize_file(depth, whole / 2);
  EXPECT_EQ(problem_of_frame(1),
            depth.string() + ": the PNG file is cut off after " + std::to_string(whole / 2) + " bytes");
  fs::remove(folder_ / "colour/000002.png");
  EXPECT_EQ(problem_of_frame(2), path("colour/000002.png") + ": the file cannot be opened");
  EXPECT_EQ(problem_of_frame(3), "");
  EXPECT_EQ(problem_of_frame(4), folder_.string() + ": there is no frame 4 of 4");

  std::fstream damaged(folder_ / "depth/000003.png", std::ios::in | std::ios::out | std::ios::binary);
  damaged.seekp(60);
  damaged.put('x');
  damaged.close();
  EXPECT_NE(problem_of_frame(3).find("wrong check sum"), std::string::npos);
  put("depth/000000.png", "P5 1 1 255 x");
  EXPECT_EQ(problem_of_frame(0), path("depth/000000.png") + ": this is not a PNG file");
}

TEST_F(SequenceFolder, CutAnywhereIsAnErrorAndNoImage) {
  write(SequenceLayout::kPlain, 1);
  const fs::path depth = folder_ / "depth/000000.png";
  for (auto size = fs::file_size(depth); size-- > 0;) {
    fs::resize_file(depth, size);
    EXPECT_NE(problem_of_frame(0), "") << size;
  }
}

TEST_F(SequenceFolder, WithImagesOfOtherSizesOrBitsIsRefused) {
  write(SequenceLayout::kPlain);
  std::string problem;
  ASSERT_TRUE(write_png(folder_ / "colour/000000.png", random_frame(0, 0, 25, 16).colour, problem));
  EXPECT_EQ(problem_of_frame(0), path("colour/000000.png") + ": the image has 25 x 16 pixels, the calibration 24 x 16");
  ASSERT_TRUE(write_png(folder_ / "depth/000001.png", cv::Mat1b(16, 24, std::uint8_t{7}), problem));
  EXPECT_EQ(problem_of_frame(1),
            path("depth/000001.png") + ": a depth image has 16 bits and one channel, this one 8 bits");
  ASSERT_TRUE(write_png(folder_ / "colour/000002.png", random_frame(0, 0).depth, problem));
  EXPECT_EQ(problem_of_frame(2), path("colour/000002.png") + ": a colour image has 8 bits a channel, this one has 16");
}

TEST_F(SequenceFolder, WriterRefusesWhatCannotBeRead) {
  SequenceWriter writer(folder_, kinect_calibration(24, 16));
  EXPECT_TRUE(writer.add(random_frame(0, 1)));
  EXPECT_FALSE(writer.add(random_frame(0, 1)));
  EXPECT_EQ(writer.problem(), folder_.string() + ": frame 1 has time 1 after 1");
  SequenceWriter other(folder_, kinect_calibration(24, 16));
  EXPECT_FALSE(other.add(random_frame(0, 1, 16, 24)));
  EXPECT_FALSE(other.finish());
  SequenceWriter nowhere("/proc/no/folder", kinect_calibration(24, 16));
  EXPECT_FALSE(nowhere.add(random_frame(0, 1)));
  EXPECT_NE(nowhere.problem().find("/proc/no/folder"), std::string::npos);
}

TEST(Crc32, IsThatOfPngAndZip) {
  const std::string text = "123456789";  // the usual check value of this polynomial
  EXPECT_EQ(crc32({reinterpret_cast<const std::uint8_t*>(text.data()), text.size()}), 0xCBF43926U);
}

TEST(Calibration, OfTheKinectIsThatOfItsFieldOfView) {
  const Calibration c = kinect_calibration();
  EXPECT_EQ(problem_of(c), "");
  const double pi = std::acos(-1.0);
  EXPECT_NEAR(2 * std::atan(320 / c.fx) * 180 / pi, 57, 2);  // 57 x 43 degrees
  EXPECT_NEAR(2 * std::atan(240 / c.fy) * 180 / pi, 43, 3);
  const Eigen::Vector3d p = c.point(100, 50, 2);
  EXPECT_NEAR((c.pixel(p) - Eigen::Vector2d(100, 50)).norm(), 0, 1e-12);
}

}  // namespace
}  // namespace sherlog::rgbd
