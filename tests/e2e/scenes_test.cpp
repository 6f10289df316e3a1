// sherlog scenes, from the command line to the answers on what it wrote.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <string>

#include "tests/e2e/program.h"

namespace sherlog::e2e {
namespace {

using testing::HasSubstr;
using Json = nlohmann::json;

const std::string kFolder = SHERLOG_SOURCE_DIR "/models/information_fusion/";

std::size_t count(const std::string& text, const std::string& part) {
  std::size_t found = 0;
  for (std::size_t at = text.find(part); at != std::string::npos; at = text.find(part, at + 1)) ++found;
  return found;
}

TEST(ScenesGenerate, WritesAsManyScenesAsAskedForAndTheSameForASeed) {
  const Scratch scratch;
  const Outcome one = scratch.sherlog("scenes generate --scenes 12 --seed 4");
  EXPECT_EQ(one.code, 0) << one.err;
  EXPECT_EQ(count(one.out, "---\n"), 11u);
  EXPECT_EQ(count(one.out, "scene("), 12u);
  EXPECT_EQ(one.out, scratch.sherlog("scenes generate --scenes 12 --seed 4 --threads 2").out);
  EXPECT_NE(one.out, scratch.sherlog("scenes generate --scenes 12 --seed 5").out);
}

TEST(ScenesGenerate, WhatItWritesIsGoodEvidenceForTheShippedModels) {
  const Scratch scratch;
  EXPECT_EQ(scratch.sherlog("scenes generate --scenes 40 -o all.db --quiet").code, 0);
  EXPECT_EQ(scratch.sherlog("scenes generate --scenes 40 --annotators paper --unlabelled -o paper.db").code, 0);
  EXPECT_EQ(scratch.sherlog("check -m '" + kFolder + "kitchen_predicates.mln' -e all.db").code, 0);
  const Outcome answer =
      scratch.sherlog("infer -m '" + kFolder + "fusion.mln' -e paper.db -q object --method map --quiet --json -");
  EXPECT_EQ(answer.code, 0) << answer.err;
  EXPECT_EQ(Json::parse(answer.out)["databases"].size(), 40u);
}

TEST(ScenesGenerate, SaysWhatItMade) {
  const Scratch scratch;
  const Outcome outcome = scratch.sherlog("scenes generate --scenes 100 -o scenes.db --json -");
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const Json json = Json::parse(outcome.out);
  EXPECT_EQ(json["schema"], "sherlog.scenes.generate/1");
  EXPECT_EQ(json["scenes"], 100);
  const std::string text = scratch.read("scenes.db");
  EXPECT_EQ(json["objects"], count(text, "object("));
  EXPECT_EQ(json["annotations"]["linemod"], count(text, "linemod("));
  EXPECT_EQ(json["contexts"]["Fridge"], count(text, "scene(Fridge)"));
  EXPECT_FALSE(json.contains("text"));
}

TEST(ScenesGenerate, BadOptionsAreExit2AndWriteNothing) {
  const Scratch scratch;
  EXPECT_EQ(scratch.sherlog("scenes").code, 2);
  EXPECT_EQ(scratch.sherlog("scenes generate --scenes 0 -o x.db").code, 2);
  EXPECT_EQ(scratch.sherlog("scenes generate --scenes -3 -o x.db").code, 2);
  EXPECT_EQ(scratch.sherlog("scenes generate --spelling german -o x.db").code, 2);
  const Outcome nowhere = scratch.sherlog("scenes generate -o missing/x.db");
  EXPECT_EQ(nowhere.code, 2);
  EXPECT_THAT(nowhere.err, HasSubstr("missing/x.db"));
  EXPECT_EQ(scratch.file_count(), 0u);
}

}  // namespace
}  // namespace sherlog::e2e
