#include "learning/learned_model.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <string>
#include <vector>

#include "mln/evidence.h"
#include "mln/model.h"

namespace sherlog {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;
using testing::StartsWith;

std::string written(const std::string& text, const std::vector<double>& weights, const std::string& heading = "h") {
  Diagnostics diagnostics;
  const auto model = parse_model(text, "m.mln", diagnostics);
  EXPECT_TRUE(model) << diagnostics.render();
  const WeightTable table(*model);
  EXPECT_EQ(table.size(), weights.size());
  return learned_model_text(*model, table, weights, heading);
}

// The weights that the text reads back as; the text must read without a warning.
std::vector<double> read_back(const std::string& text) {
  Diagnostics diagnostics;
  const auto model = parse_model(text, "learned.mln", diagnostics);
  EXPECT_TRUE(model) << diagnostics.render() << text;
  std::vector<double> weights;
  if (!model) return weights;
  for (const Formula& formula : model->formulas()) {
    if (!formula.hard) weights.push_back(formula.weight);
  }
  return weights;
}

TEST(LearnedModel, HeadingIsACommentHoweverManyLinesItHas) {
  const std::string text = written("P(t)\n0 P(x)\n", {1.5}, "one\ntwo");
  EXPECT_THAT(text, StartsWith("// one\n// two\n\n"));
  EXPECT_EQ(read_back(text), std::vector<double>{1.5});
}

TEST(LearnedModel, KeepsTheBitsOfEveryWeight) {
  const std::vector<double> weights = {0.1, 1.0 / 3, -1e-300, 1e300, std::numeric_limits<double>::denorm_min(), -0.0};
  std::string model = "P(t)\nR(t)\n";
  for (const char* formula : {"P(x)", "R(x)", "P(x) v R(x)", "P(x) ^ R(x)", "P(x) => R(x)", "!P(x)"}) {
    model += std::string("0 ") + formula + "\n";
  }
  EXPECT_EQ(read_back(written(model, weights)), weights);
}

TEST(LearnedModel, WritesTemplatesOutAndSaysWhatTheyWere) {
  const std::string text = written("kind = {A, B}\nk(thing, kind!)\n0 k(x, +y)\n", {1, 2});
  EXPECT_THAT(text, AllOf(HasSubstr("kind = {A, B}\n"), HasSubstr("k(thing, kind!)\n"), HasSubstr("// k(x, +y)\n"),
                          HasSubstr("\n1 k(x, A)\n2 k(x, B)\n")));
  EXPECT_EQ(read_back(text), (std::vector<double>{1, 2}));
}

TEST(LearnedModel, KeepsHardFormulasBlocksClosedPredicatesAndFixedWeights) {
  const std::string text = written(
      "*wrote(person, paper)\nm(thing, mark?)\nP(thing)\nP(x) => !m(x, A).\n#fixweight\n0.7 P(x)\n0 m(x, y)\n"
      "0 wrote(p, q)\n",
      {0.7, 2, 3});
  EXPECT_THAT(text, AllOf(HasSubstr("*wrote(person, paper)\n"), HasSubstr("m(thing, mark?)\n"),
                          HasSubstr("P(x) => !m(x, A).\n"), HasSubstr("#fixweight\n0.7 P(x)\n")));
  EXPECT_EQ(read_back(text), (std::vector<double>{0.7, 2, 3}));
}

// A variable that has the name of a constant, constants with blanks and quotes, and a constant that begins with a digit.
TEST(LearnedModel, NamesThatNeedCareReadBackAsWhatTheyWere) {
  const std::string text =
      written("kind = {x, \"Dr Oetker\", \"Kellogg's\", 7up}\nk(thing, kind!)\n0 k(?x, +?y) ^ k(?x, x)\n0 k(a, x)\n",
              {1, 2, 3, 4, 5});
  EXPECT_EQ(read_back(text), (std::vector<double>{1, 2, 3, 4, 5}));
  EXPECT_THAT(text, AllOf(HasSubstr("1 k(?x, x) ^ k(?x, x)\n"), HasSubstr("\"Dr Oetker\"")));
}

TEST(LearnedModel, WeightDoesNotRunIntoTheFormula) {
  // "2 (..." could be read on as arithmetic, as could "2 1 < y".
  const std::string text =
      written("n(num)\nnum = {1, 2, 3}\n0 (EXIST x (n(x))) => n(y)\n0 : 1 < y ^ n(y)\n0 !n(y)\n", {2, -1, 4});
  EXPECT_EQ(read_back(text), (std::vector<double>{2, -1, 4}));
  Diagnostics diagnostics;
  const auto model = parse_model(text, "learned.mln", diagnostics);
  ASSERT_TRUE(model);
  EXPECT_EQ(model->formulas().size(), 3u);
}

}  // namespace
}  // namespace sherlog
