// sherlog perceive, from frames to answers and beliefs.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <set>
#include <string>

#include "tests/e2e/program.h"

namespace sherlog::e2e {
namespace {

using testing::HasSubstr;
using testing::Not;
using Json = nlohmann::json;
namespace fs = std::filesystem;

// Some frames of a synthetic sequence as a recording in the folder "table".
class Perceive : public testing::Test {
 protected:
  void SetUp() override {
    if (scratch.sherlog("perceive --help").code != 0) GTEST_SKIP() << "built without the RGB-D front end";
  }
  void record() {
    const Outcome outcome = scratch.sherlog("perceive synthetic:table_moves --every 90 --record table");
    ASSERT_EQ(outcome.code, 0) << outcome.err;
  }

  const Scratch scratch;
};

TEST_F(Perceive, AnswersARequestWithDesignators) {
  const Outcome outcome =
      scratch.sherlog("perceive synthetic:table_moves --last 0 --query '{\"detect\": {\"shape\": \"box\"}}' --json -");
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const Json json = Json::parse(outcome.out);
  EXPECT_EQ(json["schema"], "sherlog.perceive/1");
  EXPECT_EQ(json["termination"], "completed");
  ASSERT_EQ(json["scenes"].size(), 1u);
  const Json& answers = json["scenes"][0]["answers"];
  EXPECT_EQ(answers.size(), 3u);  // cereals, milk, tea
  for (const Json& designator : answers) {
    EXPECT_EQ(designator["rs.annotation.Shape"][0]["shape"], "box");
    EXPECT_TRUE(designator.contains("rs.annotation.PoseAnnotation"));
    EXPECT_FALSE(designator.contains("rs.annotation.SemanticColor"));  // nobody asked
  }
}

TEST_F(Perceive, TracksThingsOverTime) {
  const Outcome outcome =
      scratch.sherlog("perceive synthetic:table_moves --every 60 --query '{\"track\": {\"color\": \"red\"}}' --json -");
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  std::set<std::string> ids;
  std::size_t sightings = 0;
  const Json json = Json::parse(outcome.out);
  for (const Json& scene : json["scenes"]) {
    for (const Json& designator : scene["answers"]) {
      if (!designator.contains("rs.annotation.Tracking")) continue;
      ids.insert(designator["rs.annotation.Tracking"][0]["trackingID"].get<std::string>());
      ++sightings;
    }
  }
  EXPECT_GE(sightings, 2u);
  EXPECT_LT(ids.size(), sightings);
}

TEST_F(Perceive, InspectsWithAllThatThereIsAndTakesAFlow) {
  const Outcome outcome =
      scratch.sherlog("perceive synthetic:table_moves --last 0 --query '{\"inspect\": {\"shape\": \"box\"}}' --json -");
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const Json answers = Json::parse(outcome.out)["scenes"][0]["answers"];
  EXPECT_EQ(answers.size(), 3u);
  EXPECT_TRUE(answers[0].contains("rs.annotation.SemanticColor"));
  EXPECT_EQ(scratch.sherlog("perceive synthetic:table_moves --last 0 --query '{\"scan\": {\"shape\": \"box\"}}'").code,
            2);
  const Outcome fixed = scratch.sherlog(
      "perceive synthetic:table_moves --last 0 --query '{\"detect\": {}}' --json - --flow "
      "RegionFilter,CloudAnnotator,TableTopAnnotator,PointCloudClusterExtractor");
  ASSERT_EQ(fixed.code, 0) << fixed.err;
  EXPECT_EQ(Json::parse(fixed.out)["annotators"].size(), 4u);
  const Outcome wrong = scratch.sherlog(
      "perceive synthetic:table_moves --last 0 --query '{\"detect\": {}}' --flow TableTopAnnotator,CloudAnnotator");
  EXPECT_EQ(wrong.code, 2);
  EXPECT_NE(wrong.err, "");
}

TEST_F(Perceive, PlansWithoutFrames) {
  const Outcome own = scratch.sherlog("perceive --plan --query '{\"detect\": {\"shape\": \"box\"}}' --json -");
  ASSERT_EQ(own.code, 0) << own.err;
  const Json steps = Json::parse(own.out)["plan"];
  ASSERT_FALSE(steps.empty());
  EXPECT_EQ(steps.back()["annotator"], "Cluster3DGeometryAnnotator");
  EXPECT_EQ(steps.back()["from"][0]["names"], Json({"tables"}));
  const Outcome unknown = scratch.sherlog("perceive --plan --query '{\"detect\": {\"shape\": \"pyramid\"}}'");
  EXPECT_EQ(unknown.code, 0);
  EXPECT_THAT(unknown.err, HasSubstr("box, cylinder, flat, round"));
  EXPECT_EQ(scratch.sherlog("perceive").code, 2);
  EXPECT_EQ(scratch.sherlog("perceive --plan synthetic:table_moves").code, 2);
  EXPECT_EQ(scratch.sherlog("perceive synthetic:table_moves --annotators robot").code, 2);
}

TEST_F(Perceive, PlansWithAnnotatorsOfARobot) {
  fs::create_directory(scratch.folder() / "robot");
  scratch.write("robot/camera.yaml", "annotator: {name: Camera}\ncapabilities:\n  outputs: [rs.pcl.PointCloud]\n");
  scratch.write("robot/clusters.yaml",
                "annotator: {name: Clusters}\ncapabilities:\n  inputs: [rs.pcl.PointCloud]\n"
                "  outputs: [rs.scene.Cluster]\n");
  scratch.write("robot/shapes.yaml",
                "annotator: {name: Shapes}\ncapabilities:\n  inputs: [rs.scene.Cluster]\n"
                "  outputs:\n    - rs.annotation.Shape: [box, round]\n");
  scratch.write("robot/engine.yaml", "ae: {name: demo}\nfixedflow: [Camera, Shapes]\n");
  const Outcome planned =
      scratch.sherlog("perceive --plan --annotators robot --query '{\"detect\": {\"shape\": \"box\"}}' --json -");
  ASSERT_EQ(planned.code, 0) << planned.err;
  EXPECT_EQ(Json::parse(planned.out)["annotators"], Json({"Camera", "Clusters", "Shapes"}));
  const Outcome fixed = scratch.sherlog("perceive --plan --annotators robot --flow robot/engine.yaml");
  EXPECT_EQ(fixed.code, 2);
  EXPECT_THAT(fixed.err, HasSubstr("nobody in the flow writes 'rs.scene.Cluster', which 'Shapes' needs"));
  scratch.write("robot/shapes.yaml", "annotator:\n  name: Shapes\ncapabilities: [\n");
  const Outcome broken = scratch.sherlog("perceive --plan --annotators robot");
  EXPECT_EQ(broken.code, 2);
  EXPECT_THAT(broken.err, HasSubstr("shapes.yaml:"));
}

TEST_F(Perceive, LooksForNoObjectUnlessAsked) {
  const Outcome outcome = scratch.sherlog("perceive synthetic:table_moves --last 0 --times");
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("nothing was asked for"));
  EXPECT_THAT(outcome.out, HasSubstr("DepthPreprocessing"));
  EXPECT_THAT(outcome.out, Not(HasSubstr("PointCloudClusterExtractor")));
}

TEST_F(Perceive, FillsAStoreFromWhichIdentitiesAreResolved) {
  ASSERT_EQ(scratch.sherlog("perceive synthetic:table_moves --every 50 --store scenes.sqlite").code, 0);
  const Outcome resolved = scratch.sherlog("track resolve scenes.sqlite --json -");
  ASSERT_EQ(resolved.code, 0) << resolved.err;
  const Json json = Json::parse(resolved.out);
  EXPECT_GE(json["steps"].size(), 2u);
  EXPECT_EQ(json["objects"].size(), 8u);
  EXPECT_THAT(scratch.sherlog("scenes times scenes.sqlite").out, HasSubstr("PointCloudClusterExtractor"));
  EXPECT_THAT(scratch.sherlog("scenes where scenes.sqlite Milk").out, HasSubstr("table_moves-"));
  const Outcome again = scratch.sherlog("perceive synthetic:table_moves --every 50 --store scenes.sqlite");
  EXPECT_EQ(again.code, 2);
  EXPECT_THAT(again.err, HasSubstr("--replace"));
  EXPECT_EQ(scratch.sherlog("perceive synthetic:table_moves --every 50 --store scenes.sqlite --replace").code, 0);
}

TEST_F(Perceive, GivesTheSameForAnyNumberOfThreadsAndFromARecording) {
  record();
  const std::string query = " --query '{\"detect\": {\"color\": \"red\"}}'";
  const Outcome one = scratch.sherlog("perceive table --every 1 --threads 1" + query);
  ASSERT_EQ(one.code, 0) << one.err;
  EXPECT_THAT(one.out, HasSubstr("SemanticColor"));
  EXPECT_EQ(one.out, scratch.sherlog("perceive table --every 1 --threads 3" + query).out);
}

TEST_F(Perceive, WritesEvidenceForAModel) {
  const Outcome outcome = scratch.sherlog("perceive synthetic:table_moves --last 0 --evidence -");
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("shape(c0,"));
}

TEST_F(Perceive, SaysWhatIsWrongWithFramesAndGoesOnWithTheOthers) {
  record();
  const std::string query = " --every 1 --query '{\"detect\": {}}'";
  fs::remove(scratch.folder() / "table/depth/000001.png");
  const Outcome missing = scratch.sherlog("perceive table" + query);
  EXPECT_EQ(missing.code, 0);
  EXPECT_THAT(missing.err, HasSubstr("000001.png"));
  EXPECT_THAT(missing.out, HasSubstr("1 could not be read"));
  fs::resize_file(scratch.folder() / "table/depth/000000.png", 2000);
  const Outcome truncated = scratch.sherlog("perceive table" + query);
  EXPECT_EQ(truncated.code, 2);
  EXPECT_THAT(truncated.err, HasSubstr("000000.png"));
  EXPECT_THAT(truncated.err, HasSubstr("no frame could be read"));
  // Nothing is left of what would have got the frames.
  fs::remove_all(scratch.folder() / "table/depth");
  for (const char* output : {"--record again", "--store new.sqlite"}) {
    EXPECT_EQ(scratch.sherlog(std::string("perceive table --every 1 ") + output).code, 2) << output;
  }
  EXPECT_FALSE(fs::exists(scratch.folder() / "again"));
  EXPECT_FALSE(fs::exists(scratch.folder() / "new.sqlite"));
}

TEST_F(Perceive, EndsWithTheMemoryLimitWhereAnAnnotatorMeetsIt) {
  const Outcome outcome =
      scratch.sherlog("perceive synthetic:table_moves --last 20 --max-memory 20M --query '{\"detect\": {}}' --json -");
  EXPECT_EQ(outcome.code, 4) << outcome.err;
  EXPECT_EQ(Json::parse(outcome.out)["termination"], "memory_limit");
}

TEST_F(Perceive, RefusesBadRecordings) {
  record();
  const std::string lines = scratch.read("table/frames.txt"), calibration = scratch.read("table/calibration.txt");
  std::string later = lines;
  later.replace(later.rfind("\n", later.size() - 2) + 1, 1, "-");  // the last time becomes negative
  scratch.write("table/frames.txt", later);
  const Outcome backwards = scratch.sherlog("perceive table");
  EXPECT_EQ(backwards.code, 2);
  EXPECT_THAT(backwards.err, HasSubstr("frames.txt"));
  scratch.write("table/frames.txt", lines);
  scratch.write("table/calibration.txt", calibration + "\nfx -1\n");
  const Outcome focal = scratch.sherlog("perceive table");
  EXPECT_EQ(focal.code, 2);
  EXPECT_THAT(focal.err, HasSubstr("calibration.txt"));
}

TEST_F(Perceive, WritesOverNothingThatItReads) {
  record();
  const std::string list = scratch.read("table/frames.txt");
  scratch.write("known.json", R"({"things": []})");
  for (const char* options : {"--record table", "--every 1 --evidence table/frames.txt", "--json table/frames.txt",
                              "--known known.json --evidence known.json"}) {
    const Outcome outcome = scratch.sherlog(std::string("perceive table ") + options);
    EXPECT_EQ(outcome.code, 2) << options;
    EXPECT_NE(outcome.err, "") << options;
  }
  EXPECT_EQ(scratch.read("table/frames.txt"), list);
  EXPECT_EQ(scratch.read("known.json"), R"({"things": []})");
}

TEST_F(Perceive, LimitsEndRecordingWithWhatThereIs) {
  const Outcome outcome = scratch.sherlog("perceive synthetic:table_moves --every 1 --max-seconds 0.5 --record some");
  EXPECT_EQ(outcome.code, 4);
  EXPECT_THAT(outcome.out, HasSubstr("time_limit"));
  EXPECT_EQ(scratch.sherlog("perceive some --last 0").code, 0);
}

TEST_F(Perceive, RecordsTheFramesThatCanBeRead) {
  record();
  fs::resize_file(scratch.folder() / "table/depth/000001.png", 2000);
  const Outcome outcome = scratch.sherlog("perceive table --every 1 --record again");
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("1 frames recorded, 1 could not be read"));
}

TEST_F(Perceive, LeavesOutFramesWhoseCameraIsNowhere) {
  record();
  std::string list = scratch.read("table/frames.txt");
  const std::size_t line = list.rfind('\n', list.size() - 2) + 1,
                    colour = list.find(".png ", list.find("colour", line));
  list.erase(colour + 4, list.size() - colour - 5);
  scratch.write("table/frames.txt", list);
  const Outcome outcome = scratch.sherlog("perceive table --every 1 --query '{\"detect\": {}}'");
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_THAT(outcome.err, HasSubstr("the camera's pose is not known"));
  EXPECT_THAT(outcome.out, HasSubstr("1 could not be read"));
}

TEST_F(Perceive, SaysThatThereAreMorePeopleThanCanBeFollowed) {
  const std::string frames = "perceive synthetic:crowd --people --first 50 --last 56 --json - ";
  const Outcome few = scratch.sherlog(frames + "--most-people 4");
  ASSERT_EQ(few.code, 0) << few.err;
  EXPECT_THAT(few.err, HasSubstr("parts of people, than 4: "));
  EXPECT_THAT(few.err, HasSubstr("--most-people N"));
  const Json crowded = Json::parse(few.out);
  EXPECT_GT(crowded["crowded"], 0);
  EXPECT_EQ(crowded["scenes"].back()["crowd"]["most"], 4);
  EXPECT_LE(crowded["scenes"].back()["people"].size(), 4u);
  const Outcome many = scratch.sherlog(frames + "--most-people 64");
  ASSERT_EQ(many.code, 0) << many.err;
  EXPECT_THAT(many.err, Not(HasSubstr("more people")));
  const Json all = Json::parse(many.out);
  EXPECT_EQ(all["crowded"], 0);
  EXPECT_FALSE(all["scenes"].back().contains("crowd"));
  EXPECT_GT(all["people"], crowded["people"]);
}

TEST_F(Perceive, TakesTheRobotOutOfARecordingAsOutOfItsSource) {
  ASSERT_EQ(scratch.sherlog("perceive synthetic:robot_table --every 70 --record robot").code, 0);
  const std::string query = " --query '{\"detect\": {}}' --json -";
  const Outcome source = scratch.sherlog("perceive synthetic:robot_table --every 70" + query);
  const Outcome recording =
      scratch.sherlog("perceive robot --every 1 --map robot/map.json --known robot/known.json" + query);
  ASSERT_EQ(source.code, 0) << source.err;
  ASSERT_EQ(recording.code, 0) << recording.err;
  const Json expected = Json::parse(source.out)["scenes"], found = Json::parse(recording.out)["scenes"];
  ASSERT_EQ(found.size(), expected.size());
  int reaching = 0;
  for (std::size_t i = 0; i < found.size(); ++i) {
    EXPECT_EQ(found[i]["reaching"], expected[i]["reaching"]);
    EXPECT_EQ(found[i]["answers"], expected[i]["answers"]);
    reaching += found[i]["reaching"].get<int>();
  }
  EXPECT_GT(reaching, 0);
  // A line that is wrong is named, and nothing of it is lost by recording into the same folder.
  const std::string text = scratch.read("robot/robot.txt");
  scratch.write("robot/robot.txt", text + "pose 1 elbow 0 0 0 0 0 0 1\n");
  const Outcome wrong = scratch.sherlog("perceive robot");
  EXPECT_EQ(wrong.code, 2);
  EXPECT_THAT(wrong.err, HasSubstr("robot.txt:" + std::to_string(std::ranges::count(text, '\n') + 1) + ": "));
  fs::remove(scratch.folder() / "robot/frames.txt");
  EXPECT_EQ(scratch.sherlog("perceive synthetic:table_moves --every 90 --record robot").code, 2);
}

TEST_F(Perceive, BadOptionsAreExit2WithASentence) {
  for (const auto& [options, word] :
       {std::pair{"nowhere", "nowhere"}, std::pair{"synthetic:moon", "table_moves"},
        std::pair{"synthetic:table_moves --query '{\"detect\": {\"shap\": \"box\"}}'", "'shap'"},
        std::pair{"synthetic:table_moves --query '{\"find\": {}}'", "'find'"},
        std::pair{"synthetic:table_moves --first 100000", "--first"},
        std::pair{"synthetic:table_moves --last -5", "--last"},
        std::pair{"synthetic:table_moves --first -18446744073709551614 --last 2", "--first"},
        std::pair{"synthetic:table_moves --every 0", "--every"},
        std::pair{"synthetic:crowd --people --most-people 0", "--most-people"},
        std::pair{"synthetic:crowd --most-people 20", "--people"},
        std::pair{"synthetic:table_moves --query '{\"detect\": {}}' --map nowhere.json", "nowhere.json"},
        std::pair{"synthetic:table_moves --evidence - --mapping nothing", "nothing"}}) {
    const Outcome outcome = scratch.sherlog(std::string("perceive ") + options);
    EXPECT_EQ(outcome.code, 2) << options;
    EXPECT_THAT(outcome.err, HasSubstr(word)) << options;
  }
}

}  // namespace
}  // namespace sherlog::e2e
