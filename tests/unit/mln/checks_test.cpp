// Suspicious models are warned about; hard contradictions are refused.
#include "mln/checks.h"

#include <string>

#include <gtest/gtest.h>

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
  EXPECT_NE(diagnostics.render().find("warning: hard formula is always false: no world is possible where it has a grounding [contradiction]"),
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
