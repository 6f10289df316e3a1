#include "mln/convert.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "mln/clauses.h"
#include "mln/parser.h"

namespace sherlog {
namespace {

struct Converted {
  std::string text;
  std::size_t warnings = 0;
};

Converted converted(const std::string& text, Dialect dialect, Precedence precedence = Precedence::kAndTighter) {
  ParseOptions options;
  options.precedence = precedence;
  Diagnostics parsing;
  const syntax::Model model = parse_syntax(text, "m", parsing, options);
  EXPECT_FALSE(parsing.has_errors()) << parsing.render();
  Diagnostics diagnostics;
  Converted result{convert(model, dialect, diagnostics), diagnostics.warning_count()};
  EXPECT_FALSE(diagnostics.has_errors());
  return result;
}

const std::string kDeclarations = "S(p)\nF(p, p)\n";

std::string formula(const std::string& text, Dialect dialect) {
  const std::string result = converted(kDeclarations + text, dialect).text;
  return result.substr(result.find("F(p, p)\n") + 8);
}

TEST(Convert, WritesTheOtherPrecedenceWithBrackets) {
  EXPECT_EQ(converted("1 A(x) ^ B(x) v C(x)", Dialect::kSherlog, Precedence::kOrTighter).text,
            "1 A(x) ^ (B(x) v C(x))\n");
  EXPECT_EQ(converted("1 A(x) ^ B(x) v C(x)", Dialect::kSherlog).text, "1 (A(x) ^ B(x)) v C(x)\n");
}

TEST(Convert, TellsVariablesFromConstantsByOurRules) {
  const std::string model = "e = {move, Stay}\nis(o, e!)\n1 is(X1, move) ^ is(x, e)\n1 is(?X, move) ^ is(k, Stay)\n";
  EXPECT_EQ(converted(model, Dialect::kAlchemy).text,
            "e = {\"move\", Stay}\nis(o, e!)\n1 is(X1, \"move\") ^ is(x, e)\n1 is(x, \"move\") ^ is(\"k\", Stay)\n");
  EXPECT_EQ(converted(model, Dialect::kPracmln).text,
            "e = {move, Stay}\nis(o, e!)\n1 is(X1, move) ^ is(?x, ?e)\n1 is(?X, move) ^ is(k, Stay)\n");
}

TEST(Convert, KnowsConstantsInCapitalsThatAreNotAscii) {
  for (const Dialect dialect : {Dialect::kAlchemy, Dialect::kPracmln, Dialect::kTuffy}) {
    EXPECT_THAT(formula("1 S(Ümlaut) v S(Ñu)", dialect), testing::HasSubstr("S(\"Ümlaut\") v S(\"Ñu\")"));
    EXPECT_THAT(formula("1 S(ümlaut)", dialect), testing::Not(testing::HasSubstr("\"")));
  }
}

TEST(Convert, KeepsTwoVariablesOfOneSpellingApart) {
  EXPECT_EQ(formula("1 F(?X, ?x)", Dialect::kAlchemy), "1 F(x, x_1)\n");
}

TEST(Convert, WritesClausesForTuffy) {
  EXPECT_EQ(formula("1.5 S(x) ^ F(x, y) => S(y)", Dialect::kTuffy), "1.5 !S(x) v !F(x, y) v S(y)\n");
  EXPECT_EQ(formula("S(x) <=> S(y).", Dialect::kTuffy), "S(x) v !S(y).\n!S(x) v S(y).\n");
  EXPECT_EQ(formula("@2 S(x)", Dialect::kTuffy), "@2 S(x)\n");
  // n(S ^ F) = number of groundings - n(!S v !F)
  EXPECT_EQ(formula("1.5 S(x) ^ F(x, y)", Dialect::kTuffy), "-1.5 !S(x) v !F(x, y)\n");
  EXPECT_EQ(formula("S(x) => EXIST y (F(x, y)).", Dialect::kTuffy), "EXIST y (!S(x) v F(x, y)).\n");
  EXPECT_EQ(formula("logx(0) S(x) v S(y)", Dialect::kTuffy), "!S(x).\n!S(y).\n");
}

TEST(Convert, NeverDividesAWeightOverClauses) {
  const std::string text = kDeclarations + "2 S(x) ^ (F(x, y) v S(y))\n";
  const Converted result = converted(text, Dialect::kTuffy);
  EXPECT_EQ(result.text, kDeclarations + "// 2 S(x) ^ (F(x, y) v S(y))\n");
  EXPECT_EQ(result.warnings, 1u);
}

TEST(Convert, WritesBlocksAsHardFormulasWhereThereAreNone) {
  EXPECT_EQ(converted("is(o, n!)", Dialect::kTuffy).text,
            "is(o, n)\n!is(a1, a2x) v !is(a1, a2y) v a2x = a2y.\nEXIST a2x (is(a1, a2x)).\n");
  EXPECT_EQ(converted("is(o, n?)", Dialect::kAlchemy).text, "is(o, n)\n!is(a1, a2x) v !is(a1, a2y) v a2x = a2y.\n");
  EXPECT_EQ(converted("is(o, n!)", Dialect::kAlchemy).text, "is(o, n!)\n");
}

TEST(Convert, WritesOutWhatADialectLacks) {
  EXPECT_EQ(converted("t = {0, ..., 2}", Dialect::kTuffy).text, "t = {0, 1, 2}\n");
  EXPECT_EQ(converted("t = {0, ..., 2}", Dialect::kAlchemy).text, "t = {0, ..., 2}\n");
  EXPECT_EQ(formula("log(0.5) S(x)", Dialect::kPracmln), "log(0.5) S(?x)\n");
  EXPECT_EQ(formula("(1+2) S(x)", Dialect::kAlchemy), "3 S(x)\n");
  EXPECT_EQ(formula("1 FORALL y (F(x, y))", Dialect::kPracmln), "1 !(EXIST ?y (!F(?x, ?y)))\n");
  EXPECT_EQ(formula("#unique{+a,+b}\n1 S(+a) ^ S(+b)", Dialect::kAlchemy), "// #unique{+a,+b}\n// 1 S(+a) ^ S(+b)\n");
}

std::size_t clause_count(const std::string& text) {
  Diagnostics diagnostics;
  const auto clauses = to_clauses(*parse_formula(text, "f", diagnostics), false);
  return clauses ? clauses->size() : 0;
}

TEST(Clauses, PullNoQuantifierWhereThatChangesTheMeaning) {
  EXPECT_EQ(clause_count("EXIST x (P(x))"), 1u);
  EXPECT_EQ(clause_count("(EXIST x (P(x))) v (EXIST x (Q(x)))"), 0u);  // two variables of one name
  EXPECT_EQ(clause_count("(FORALL x (P(x))) v (FORALL x (Q(x)))"), 0u);
  EXPECT_EQ(clause_count("(FORALL x (P(x))) ^ (FORALL x (Q(x)))"), 2u);
  EXPECT_EQ(clause_count("(EXIST x (P(x))) v Q(x)"), 0u);
  EXPECT_EQ(clause_count("EXIST x (FORALL y (P(x, y)))"), 0u);
  EXPECT_EQ(clause_count("FORALL y (EXIST x (P(x, y)))"), 0u);
  EXPECT_EQ(clause_count("EXIST x (P(x) ^ Q(x))"), 0u);
  EXPECT_EQ(clause_count("P(x) <=> EXIST y (Q(y))"), 2u);
}

TEST(Clauses, GiveUpBeforeTheyExplode) {
  std::string text = "(A(x) ^ B(x))";
  for (int i = 0; i < 20; ++i) text += " v (A(x) ^ B(x))";
  EXPECT_EQ(clause_count(text), 0u);  // 2^21
}

}  // namespace
}  // namespace sherlog
