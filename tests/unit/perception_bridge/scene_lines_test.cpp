#include "perception_bridge/scene_lines.h"

#include "tests/unit/perception_bridge/scene_store_file.h"

namespace sherlog {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;
using testing::SizeIs;

class SceneLines : public SceneStoreFile {};

TEST_F(SceneLines, ExportAndImportAreTheIdentity) {
  SceneStore store = open();
  ASSERT_EQ(store.add(small_scene("s1", 1, {{"Milk", "table"}})), SceneStore::Added::kNew);
  Scene odd;
  odd.id = "s 2";
  odd.timestamp = 0.1;
  odd.calls_them_clusters = true;
  odd.other = {{"battery", Value(0.5)}};
  ASSERT_EQ(store.add(odd), SceneStore::Added::kNew);
  ASSERT_TRUE(store.add(StoredEvidence{"s1", "fusion", "shape(c0,Box)\n"}));
  ASSERT_TRUE(store.add(StoredBelief{"s1", "fusion", Value(Value::List{Value(0.25)})}));
  Identity milk;
  milk.id = "milk-1";
  milk.last_seen = 1;
  milk.in_view = true;
  milk.other = {{"colour", Value("white")}};
  milk.sightings = {{"s1", "c0", 1, 0.75, "appear"}};
  ASSERT_TRUE(store.add(milk));

  const std::string text = exported(store);
  path_ += ".copy";
  SceneStore copy = open();
  const ImportResult result = import(copy, text);
  EXPECT_EQ(result.termination, Termination::kCompleted);
  EXPECT_EQ(result.added, 2u);
  EXPECT_EQ(result.records, 3u);
  EXPECT_EQ(exported(copy), text);
  const auto again = copy.identity("milk-1");
  ASSERT_TRUE(again);
  EXPECT_EQ(again->sightings.front().probability, 0.75);
  EXPECT_TRUE(again->in_view);
  EXPECT_FALSE(again->disappeared);
}

TEST_F(SceneLines, ABadLineRollsTheWholeImportBack) {
  SceneStore store = open();
  ASSERT_EQ(import(store, line("before")).added, 1u);
  const ImportResult result = import(store, line("a") + "\n{\"id\": 5}\n" + line("b"));
  EXPECT_EQ(result.termination, Termination::kRefused);
  EXPECT_EQ(result.added, 0u);
  ASSERT_FALSE(result.problems.empty());
  EXPECT_EQ(result.problems.front().line, 3u);
  EXPECT_EQ(store.scene_count(), 1u);
  // The store is as good as before.
  EXPECT_EQ(import(store, line("a") + line("b")).added, 2u);
}

TEST_F(SceneLines, SeveralImportsCanBeOneTransaction) {
  SceneStore store = open();
  const ImportOptions options{.limits = {}, .in_transaction = true};
  ASSERT_TRUE(store.begin());
  EXPECT_EQ(import(store, line("a"), options).added, 1u);
  EXPECT_EQ(import(store, "broken\n", options).termination, Termination::kRefused);
  EXPECT_EQ(import(store, line("b"), options).added, 1u) << "the caller says when it ends";
  store.roll_back();
  EXPECT_EQ(store.scene_count(), 0u);
  ASSERT_TRUE(store.begin());
  import(store, line("a"), options);
  import(store, line("b"), options);
  ASSERT_TRUE(store.commit());
  EXPECT_EQ(store.scene_count(), 2u);
}

TEST_F(SceneLines, SkippingKeepsTheGoodLinesAndNamesTheBadOnes) {
  SceneStore store = open();
  const ImportOptions options{.on_error = OnError::kSkip, .limits = {}, .batch = 2};
  const ImportResult result =
      import(store, line("a") + "{broken\n" + line("b") + line("a") + line("c") + "[]\n", options);
  EXPECT_EQ(result.termination, Termination::kCompleted);
  EXPECT_EQ(result.added, 3u);
  EXPECT_THAT(result.skipped, SizeIs(3));
  ASSERT_THAT(result.problems, SizeIs(3));
  EXPECT_EQ(result.problems[0].line, 2u);
  EXPECT_EQ(result.problems[1].line, 4u);
  EXPECT_THAT(result.problems[1].text, HasSubstr("has a scene 'a' already"));
  EXPECT_EQ(result.problems[2].line, 6u);
  EXPECT_EQ(store.scene_count(), 3u);
}

TEST_F(SceneLines, RecordsOfScenesThatAreNotThereAreErrors) {
  SceneStore store = open();
  const std::string evidence = R"({"sherlog.record":"evidence","scene":"s1","mapping":"m","text":""})"
                               "\n";
  EXPECT_THAT(import(store, evidence).problems.at(0).text, HasSubstr("no scene 's1'"));
  const std::string identity = R"({"sherlog.record":"identity","id":"i","sightings":[{"scene":"s1","cluster":"c0"}]})"
                               "\n";
  EXPECT_THAT(import(store, identity).problems.at(0).text, HasSubstr("a cluster that the store has not"));
  EXPECT_THAT(store.identities(), IsEmpty());
  EXPECT_THAT(import(store, R"({"sherlog.record":"dream"})").problems.at(0).text, HasSubstr("none of"));
}

// --- imports that are ended, and what is there already ---

// Interrupts at the n-th question.
class Impatient : public Monitor {
 public:
  explicit Impatient(int patience) : patience_(patience) {}
  bool interrupted() const override { return --patience_ < 0; }

 private:
  mutable int patience_;
};

TEST_F(SceneLines, AnInterruptedImportKeepsNothingOrWholeLines) {
  const std::string text = line("a", 1) + line("b", 2) + line("c", 3) + line("d", 4);
  SceneStore store = open();
  for (const OnError on_error : {OnError::kStop, OnError::kSkip}) {
    std::istringstream in(text);
    Impatient monitor(2);
    const ImportResult result = import_lines(store, in, {.on_error = on_error, .limits = {}}, monitor);
    EXPECT_EQ(result.termination, Termination::kInterrupted);
    const std::uint64_t kept = on_error == OnError::kSkip ? 2 : 0;
    EXPECT_EQ(result.lines, 2u);
    EXPECT_EQ(result.added, kept);
    EXPECT_EQ(store.scene_count(), kept);
  }
}

TEST_F(SceneLines, AnImportHeedsItsTime) {
  SceneStore store = open();
  const ImportResult result = import(store, line("a") + line("b"), {.limits = {}, .max_seconds = 0});
  EXPECT_EQ(result.termination, Termination::kTimeLimit);
  EXPECT_EQ(store.scene_count(), 0u);
}

const std::string kSeen =
    R"({"sherlog.record":"identity","id":"object-1","lastSeen":1,"sightings":[{"scene":"s","cluster":"c0"}]})";

TEST_F(SceneLines, ARecordThatIsThereIsNotOverwritten) {
  SceneStore store = open();
  ASSERT_EQ(store.add(small_scene("s", 1, {{"Milk", "table"}, {"Cup", "table"}})), SceneStore::Added::kNew);
  const std::string evidence = R"({"sherlog.record":"evidence","scene":"s","mapping":"m","text":"x"})";
  const std::string belief = R"({"sherlog.record":"belief","scene":"s","kind":"k","document":{"x":1}})";
  const std::string all = kSeen + "\n" + evidence + "\n" + belief + "\n";
  ASSERT_EQ(import(store, all).records, 3u);
  const ImportResult same = import(store, all);
  EXPECT_EQ(same.termination, Termination::kCompleted);
  EXPECT_EQ(same.unchanged, 3u);
  EXPECT_EQ(same.records, 0u);
  const std::string other_identity =
      R"({"sherlog.record":"identity","id":"object-1","sightings":[{"scene":"s","cluster":"c1"}]})";
  for (const std::string& other :
       {other_identity, std::string(R"({"sherlog.record":"evidence","scene":"s","mapping":"m","text":"y"})"),
        std::string(R"({"sherlog.record":"belief","scene":"s","kind":"k","document":{"x":2}})")}) {
    EXPECT_THAT(import(store, other).problems.at(0).text, HasSubstr("already")) << other;
  }
  EXPECT_EQ(store.identity("object-1")->sightings.at(0).cluster, "c0");
  const ImportResult replaced = import(store, other_identity, {.replace = true, .limits = {}});
  EXPECT_EQ(replaced.records, 1u);
  EXPECT_EQ(replaced.dropped.sightings, 1u);
  EXPECT_EQ(store.identity("object-1")->sightings.at(0).cluster, "c1");
}

TEST_F(SceneLines, IdentitiesDifferInMoreThanTheirCase) {
  SceneStore store = open();
  ASSERT_EQ(store.add(small_scene("s", 1, {{"Milk", "table"}})), SceneStore::Added::kNew);
  ASSERT_EQ(import(store, kSeen).records, 1u);
  const std::string other = R"({"sherlog.record":"identity","id":"OBJECT-1","sightings":[]})";
  EXPECT_THAT(import(store, other, {.replace = true, .limits = {}}).problems.at(0).text, HasSubstr("case only"));
  EXPECT_FALSE(store.add(Identity{.id = "Object-1"}));
  EXPECT_THAT(store.problem(), HasSubstr("case only"));
  EXPECT_TRUE(store.remove_identity("OBJECT-1")) << "there is none of that name";
  EXPECT_THAT(store.identities(), ElementsAre("object-1"));
  EXPECT_EQ(store.identity("Object-1")->sightings.size(), 1u) << "and it is found all the same";
}

TEST_F(SceneLines, AnUnchangedSceneKeepsWhatWasConcludedFromIt) {
  SceneStore store = open();
  const Scene scene = small_scene("s", 1, {{"Milk", "table"}});
  ASSERT_EQ(store.add(scene), SceneStore::Added::kNew);
  ASSERT_EQ(import(store, kSeen).records, 1u);
  ASSERT_TRUE(store.add(StoredEvidence{"s", "fusion", "x"}));
  const std::string before = exported(store);
  const ImportOptions replacing{.replace = true, .limits = {}};
  const ImportResult same = import(store, json_text(scene_to_json(scene)), replacing);
  EXPECT_EQ(same.unchanged, 1u);
  EXPECT_EQ(same.replaced, 0u);
  EXPECT_FALSE(same.dropped.any());
  EXPECT_EQ(exported(store), before);
  const ImportResult other = import(store, line("s", 2), replacing);
  EXPECT_EQ(other.replaced, 1u);
  EXPECT_EQ(other.dropped.evidence, 1u);
  EXPECT_EQ(other.dropped.sightings, 1u);
}

TEST_F(SceneLines, WhatIsExportedInPartCanBeImported) {
  SceneStore store = open();
  for (const int time : {1, 2}) store.add(small_scene("s" + std::to_string(time), time, {{"Milk", "table"}}));
  ASSERT_TRUE(store.add(Identity{.id = "both", .last_seen = 2, .sightings = {{"s1", "c0"}, {"s2", "c0"}}}));
  ASSERT_TRUE(store.add(Identity{.id = "first", .last_seen = 1, .sightings = {{"s1", "c0"}}}));
  ASSERT_TRUE(store.add(Identity{.id = "never"}));
  std::string text;
  const ExportOptions options{.filter = {.from = 1.5}};
  ASSERT_TRUE(export_lines(store, options, [&](std::string_view part) { return text += part, true; }));
  std::string problem;
  auto other = SceneStore::open((folder_ / "other.db").string(), {}, problem);
  ASSERT_TRUE(other) << problem;
  const ImportResult result = import(*other, text);
  EXPECT_EQ(result.termination, Termination::kCompleted) << text;
  EXPECT_THAT(other->identities(), ElementsAre("both"));
  EXPECT_THAT(other->identity("both")->sightings, SizeIs(1));
  text = exported(store);
  EXPECT_THAT(text, HasSubstr("\"never\"")) << "all of them with all scenes";
}

TEST_F(SceneLines, IdentitiesHaveFieldsOfTheirKinds) {
  SceneStore store = open();
  for (const char* field : {R"("lastSeen":"yesterday")", R"("lastSeen":-1)", R"("wasSeen":1)", R"("inView":"no")",
                            R"("disappeared":null)", R"("sightings":{})", R"("sightings":[7])"}) {
    const ImportResult result = import(store, line("a") + R"({"sherlog.record":"identity","id":"i",)" + field + "}\n");
    EXPECT_EQ(result.termination, Termination::kRefused) << field;
    ASSERT_THAT(result.problems, Not(IsEmpty())) << field;
    EXPECT_EQ(result.problems[0].line, 2u);
  }
}

TEST_F(SceneLines, DesignatorsOfOneTimeAreAScene) {
  const auto designator = [](const std::string& id, const std::string& time) {
    return R"({"id":")" + id + R"(","timestamp":)" + time +
           R"(,"rs.annotation.Shape":[{"shape":"box","confidence":0.9}]})"
           "\n";
  };
  SceneStore store = open();
  const ImportResult result =
      import(store, designator("o1", "12.5") + designator("o2", "12.5") + designator("o1", "13") + line("s", 14));
  EXPECT_EQ(result.termination, Termination::kCompleted);
  EXPECT_EQ(result.designators, 3u);
  EXPECT_EQ(result.added, 3u);
  EXPECT_THAT(result.warnings, SizeIs(1));
  const auto scene = store.scene("scene-12.5");
  ASSERT_TRUE(scene);
  ASSERT_THAT(scene->clusters, SizeIs(2));
  EXPECT_EQ(scene->clusters[1].id, "o2");
  EXPECT_EQ(scene->clusters[1].annotations.at(0).type, "rs.annotation.Shape");
  EXPECT_TRUE(store.has("scene-13"));
  // Mistakes have their line.
  const ImportOptions skipping{.on_error = OnError::kSkip, .limits = {}};
  const ImportResult bad = import(store,
                                  designator("x", "12.5") + designator("y", "20") + designator("y", "20") +
                                      R"({"id":"z","rs.annotation.Shape":[{"shape":"box"}]})",
                                  skipping);
  EXPECT_THAT(bad.skipped, ElementsAre(1, 3, 4));
  EXPECT_THAT(bad.problems.at(0).text, HasSubstr("has a scene 'scene-12.5' already"));
  EXPECT_THAT(bad.problems.at(1).text, HasSubstr("have the id 'y'"));
  EXPECT_THAT(bad.problems.at(2).text, HasSubstr("no 'timestamp'"));
  EXPECT_EQ(bad.designators, 1u);
}

}  // namespace
}  // namespace sherlog
