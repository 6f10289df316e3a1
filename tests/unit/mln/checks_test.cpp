// Suspicious models are warned about; hard contradictions are refused.
#include "mln/checks.h"

#include <gtest/gtest.h>

#include <string>

namespace sherlog {
namespace {

const std::string kHead = "A(d)\nB(d)\nR(d, d)\n1 A(y) v B(y) ^ R(y, y)\n";

std::string warnings(const std::string& text) {
  Diagnostics diagnostics;
  diagnostics.silence("mixed-connectives");
  const std::optional<Model> model = parse_model(text, "m.mln", diagnostics);
  EXPECT_EQ(model.has_value(), !diagnostics.has_errors());
  std::string codes;
  for (const Diagnostic& diagnostic : diagnostics.all()) {
    if (diagnostic.code == "precedence" || diagnostic.code.find("mixed") != std::string::npos) continue;
    codes += diagnostic.code + "@" + std::to_string(diagnostic.place.line) + " ";
  }
  return codes;
}

TEST(Checks, UnusedPredicatesAndDomainsAreNamed) {
  EXPECT_EQ(warnings("e = {X, Y}\nA(d)\nB(d)\n1 A(x)\n"), "unused-predicate@3 unused-domain@1 ");
  EXPECT_EQ(warnings("A(d)\nB(d)\n"), "");  // declarations alone are no model yet
}

TEST(Checks, NumbersAloneAreCompared) {
  for (const char* sign : {"<", "<=", ">", ">="}) {
    const std::string compares = "P(n)\n1 P(x) ^ P(y) ^ x " + std::string(sign) + " y\n";
    EXPECT_EQ(warnings("n = {1, 2.5, -3e2}\n" + compares), "") << sign;
    EXPECT_EQ(warnings(compares), "") << "a domain without constants so far";
    EXPECT_EQ(warnings("n = {1, two}\n" + compares), "not-numeric@3 ") << sign;
    // The constant of another formula is in the domain as well, wherever that stands.
    EXPECT_EQ(warnings(compares + "1 P(Two)\n"), "not-numeric@2 ") << sign;
  }
  EXPECT_EQ(warnings("n = {a, b}\nP(n)\n1 P(x) ^ x < 3\n"), "widened-domain@3 not-numeric@3 ");
  EXPECT_EQ(warnings("n = {a, b}\nP(n)\n1 P(x) ^ x != y ^ P(y)\n"), "");
}

TEST(Checks, TheMessageNamesTheDomainAndTheConstant) {
  Diagnostics diagnostics;
  EXPECT_FALSE(parse_model("age = {7, Old}\nAged(age)\n1 Aged(x) ^ x > 8\n", "m.mln", diagnostics));
  const std::string text = diagnostics.render();
  EXPECT_NE(text.find("m.mln:3:13: error: numbers alone can be compared, and constant 'Old' of domain 'age' is none"),
            std::string::npos)
      << text;
}

TEST(Checks, TautologiesAreFoundByTruthTable) {
  EXPECT_EQ(warnings(kHead + "1 A(x) v !A(x)"), "tautology@5 ");
  EXPECT_EQ(warnings(kHead + "1 (A(x) => B(x)) <=> (!A(x) v B(x))"), "tautology@5 ");
  EXPECT_EQ(warnings(kHead + "1 A(x) v x = x"), "tautology@5 ");
  EXPECT_EQ(warnings(kHead + "1 (EXIST z (R(x, z))) v !(EXIST u (R(x, u)))"), "tautology@5 ");
  EXPECT_EQ(warnings(kHead + "1 A(x) v !A(z)"), "");
}

TEST(Checks, ContradictionsAreWarnedAboutHardOnesToo) {
  EXPECT_EQ(warnings(kHead + "1 A(x) ^ !A(x)"), "contradiction@5 ");
  Diagnostics diagnostics;
  EXPECT_TRUE(parse_model(kHead + "A(x) ^ !A(x).", "m.mln", diagnostics));
  EXPECT_NE(diagnostics.render().find(
                "warning: hard formula is always false: no world is possible where it has a grounding [contradiction]"),
            std::string::npos);
}

TEST(Checks, FormulasThatDifferInVariableNamesAreDuplicates) {
  EXPECT_EQ(warnings(kHead + "1 R(x, z) => A(x)\n2 R(u, v1) => A(u)"), "duplicate-formula@6 ");
  EXPECT_EQ(warnings(kHead + "1 R(x, z) => A(x)\n2 R(u, w) => A(w)"), "");
  EXPECT_EQ(warnings(kHead + "1 R(x, z) => A(x)\n2 R(+u, w) => A(+u)"), "");
}

TEST(Checks, SixteenAtomsAreDecidedAndMoreAreLeftAlone) {
  std::string wide = "1 ";
  for (int i = 0; i < 15; ++i) wide += "A(X" + std::to_string(i) + ") v ";
  EXPECT_EQ(warnings(kHead + wide + "B(x) v !B(x)"), "tautology@5 ");  // 15 + 1 atoms
  EXPECT_EQ(warnings(kHead + wide + "A(Y) v B(x) v !B(x)"), "");       // 17
}

}  // namespace
}  // namespace sherlog
