#include "mln/diagnostics.h"

#include <gtest/gtest.h>

#include <string>

namespace sherlog {
namespace {

Place place(std::uint32_t line, std::uint32_t column, std::uint32_t length) { return {0, line, column, length}; }

TEST(Diagnostics, RenderLineCaretAndNotes) {
  Diagnostics diagnostics;
  diagnostics.sources().add("kitchen.mln", "on(a, b)\n1.5  on(x, y, z) => supports(y, x)\n");
  diagnostics.error("arity", place(2, 6, 11), "predicate 'on' takes 2 arguments, 3 given",
                    {{place(1, 1, 8), "'on' is declared here"}});
  EXPECT_EQ(diagnostics.render(),
            "kitchen.mln:2:6: error: predicate 'on' takes 2 arguments, 3 given [arity]\n"
            "    2 | 1.5  on(x, y, z) => supports(y, x)\n"
            "      |      ^~~~~~~~~~~\n"
            "kitchen.mln:1:1: note: 'on' is declared here\n");
}

TEST(Diagnostics, CountColumnsInCodePointsAndExpandTabs) {
  Diagnostics diagnostics;
  diagnostics.sources().add("f", "\tGr\u00fc\u00dfe x\r\n");
  diagnostics.warning("w", place(1, 8, 1), "here");
  EXPECT_EQ(diagnostics.render(), "f:1:8: warning: here [w]\n    1 |     Gr\u00fc\u00dfe x\n      |           ^\n");
}

TEST(Diagnostics, DoNotCountTheByteOrderMarkAsAColumn) {
  Diagnostics diagnostics;
  diagnostics.sources().add("f", "\xEF\xBB\xBFPx\n");
  diagnostics.error("e", place(1, 2, 1), "x");
  EXPECT_EQ(diagnostics.render(), "f:1:2: error: x [e]\n    1 | Px\n      |  ^\n");
}

TEST(Diagnostics, CutLongLinesAroundTheCaret) {
  Diagnostics diagnostics;
  const std::string text = std::string(500, 'a') + "X" + std::string(500, 'b');
  diagnostics.sources().add("f", text);
  diagnostics.error("e", place(1, 501, 1), "x");
  // 60 columns before the caret, 120 in all, dots where something is missing.
  EXPECT_EQ(diagnostics.render(), "f:1:501: error: x [e]\n    1 | ..." + std::string(60, 'a') + "X" +
                                      std::string(59, 'b') + "...\n      | " + std::string(63, ' ') + "^\n");
}

TEST(Diagnostics, ShowNoControlCharactersOfTheInput) {
  Diagnostics diagnostics;
  diagnostics.sources().add("f", "\033[31m\xFF P");
  diagnostics.error("e", place(1, 1, 1), "found '\033'");
  EXPECT_EQ(diagnostics.render(), "f:1:1: error: found '\uFFFD' [e]\n    1 | \uFFFD[31m\uFFFD P\n      | ^\n");
}

TEST(Diagnostics, ShowTwentyErrorsAndCountTheRest) {
  Diagnostics diagnostics;
  diagnostics.sources().add("f", "P\n");
  for (int i = 0; i < 23; ++i) diagnostics.error("e", place(1, 1, 1), "x");
  diagnostics.warning("w", place(1, 1, 1), "y");
  EXPECT_EQ(diagnostics.error_count(), 23u);
  EXPECT_EQ(diagnostics.all().size(), 21u);  // 20 errors and the warning
  const std::string text = diagnostics.render();
  EXPECT_TRUE(text.ends_with("\n3 more errors not shown\n")) << text;
}

TEST(Diagnostics, DropSilencedWarningsButNeverErrors) {
  Diagnostics diagnostics;
  diagnostics.silence("a");
  diagnostics.warning("a", {}, "x");
  diagnostics.error("a", {}, "x");
  EXPECT_EQ(diagnostics.warning_count(), 0u);
  EXPECT_EQ(diagnostics.error_count(), 1u);
}

TEST(Diagnostics, RenderWithoutPlaceOrSource) {
  Diagnostics diagnostics;
  diagnostics.error("file", {7, 0, 0, 0}, "no source");
  diagnostics.sources().add("f", "");
  diagnostics.error("file", {0, 0, 0, 0}, "whole file");
  diagnostics.error("file", {0, 9, 3, 1}, "a line that is not there");
  EXPECT_EQ(diagnostics.render(),
            "error: no source [file]\nf: error: whole file [file]\nf:9:3: error: a line that is not there [file]\n"
            "    9 | \n      | ^\n");
}

TEST(Diagnostics, ColourOnlyWhenAsked) {
  Diagnostics diagnostics;
  diagnostics.error("e", {}, "x");
  EXPECT_EQ(diagnostics.render(false).find('\033'), std::string::npos);
  EXPECT_NE(diagnostics.render(true).find('\033'), std::string::npos);
}

TEST(DidYouMean, FindsTheNearestWithinTwoEdits) {
  EXPECT_EQ(did_you_mean("Smoke", {"Cancer", "Smokes", "Smock"}), "Smokes");
  EXPECT_EQ(did_you_mean("Cnacer", {"Smokes", "Cancer"}), "Cancer");  // two substitutions
  EXPECT_EQ(did_you_mean("Cxxxer", {"Cancer"}), "");
  EXPECT_EQ(did_you_mean("ab", {"xy"}), "");  // every name of two letters is within two edits of it
  EXPECT_EQ(did_you_mean("", {"a"}), "");
}

}  // namespace
}  // namespace sherlog
