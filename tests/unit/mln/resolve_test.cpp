// Typing of models: what names mean, which domain variables have, and what is refused.
#include <gtest/gtest.h>

#include <cstdlib>
#include <string>

#include "mln/model.h"

namespace sherlog {
namespace {

const std::string kTable1 =
    "explanations = {move, stay, newview, not}\n"
    "is(oldCluster, newCluster, explanations!)\n"
    "outOfView(oldCluster)\n";

std::optional<Model> read(const std::string& text, Diagnostics& diagnostics) {
  return parse_model(text, "m.mln", diagnostics);
}

Model good(const std::string& text) {
  Diagnostics diagnostics;
  std::optional<Model> model = read(text, diagnostics);
  EXPECT_TRUE(model.has_value()) << diagnostics.render();
  return model ? *model : Model();
}

// All messages about a model, rendered; the model is refused exactly where there is an error.
std::string messages(const std::string& text) {
  Diagnostics diagnostics;
  const std::optional<Model> model = read(text, diagnostics);
  EXPECT_EQ(model.has_value(), !diagnostics.has_errors());
  return diagnostics.render();
}

TEST(Resolve, MembersOfTheDeclaredDomainAreConstantsAndOtherLowerCaseNamesVariables) {
  const Model model = good(kTable1 + "1 is(o, n, move) ^ outOfView(o) ^ !is(Door, n, \"not\")");
  const Formula& formula = model.formulas().at(0);
  ASSERT_EQ(formula.variables.size(), 2u);
  EXPECT_EQ(formula.variables[0].name, "o");
  EXPECT_EQ(model.domain(formula.variables[0].domain).name, "oldCluster");
  EXPECT_EQ(formula.variables[1].name, "n");
  ASSERT_EQ(formula.root.children.size(), 3u);  // a ^ b ^ c is one conjunction
  EXPECT_EQ(formula.root.children[0].terms[2], Term::constant(0));
  const DomainId clusters = *model.find_domain("oldCluster");
  EXPECT_EQ(model.domain(clusters).constants, std::vector<std::string>{"Door"});
  EXPECT_FALSE(model.domain(clusters).declared);
  EXPECT_EQ(model.domain(*model.find_domain("explanations")).declared_count, 4u);
}

TEST(Resolve, PlainNamesAreConstantsWhereVariablesCarryQuestionMarks) {
  const Model model = good("color(thing, color)\n1 color(?x, red) v color(?y, Blue)");
  EXPECT_EQ(model.formulas()[0].variables.size(), 2u);
  EXPECT_EQ(model.domain(*model.find_domain("color")).constants, (std::vector<std::string>{"red", "Blue"}));
}

TEST(Resolve, EqualityTakesItsDomainFromTheOtherSide) {
  const Model model = good(kTable1 + "1 is(a, c, e) ^ !(e = not) ^ f = e => is(a, d, f) ^ g = f");
  const Formula& formula = model.formulas()[0];
  ASSERT_EQ(formula.variables.size(), 6u);  // a c e d f g
  EXPECT_EQ(formula.variables[5].name, "g");
  EXPECT_EQ(model.domain(formula.variables[5].domain).name, "explanations");
  const FormulaNode& equality = formula.root.children[0].children[1].children[0];
  EXPECT_EQ(equality.kind, NodeKind::kEqual);
  EXPECT_EQ(equality.terms[1], Term::constant(3));
}

TEST(Resolve, QuantifiedVariablesHaveAScopeOfTheirOwn) {
  const Model model = good(kTable1 + "1 is(o, n, move) ^ (EXIST n (is(o, n, stay)))");
  const Formula& formula = model.formulas()[0];
  ASSERT_EQ(formula.variables.size(), 3u);
  EXPECT_EQ(formula.variables[2].name, "n");
  EXPECT_TRUE(formula.variables[2].quantified);
  EXPECT_FALSE(formula.variables[1].quantified);
  const FormulaNode& exists = formula.root.children[1];
  EXPECT_EQ(exists.bound, std::vector<std::uint32_t>{2});
  EXPECT_EQ(exists.children[0].terms[1], Term::variable(2));
}

TEST(Resolve, ComparisonsAreNormalised) {
  const Model model = good("year(person, number)\n1 year(p, y) ^ year(p, z) ^ y > z ^ y >= 5 ^ y != z");
  const std::vector<FormulaNode>& parts = model.formulas()[0].root.children;
  EXPECT_EQ(parts[2].kind, NodeKind::kLess);
  EXPECT_EQ(parts[2].terms[0], Term::variable(2));  // z < y
  EXPECT_EQ(parts[3].kind, NodeKind::kLessEqual);
  EXPECT_FALSE(parts[3].terms[0].is_variable);
  EXPECT_EQ(parts[4].kind, NodeKind::kNot);
  EXPECT_EQ(parts[4].children[0].kind, NodeKind::kEqual);
}

TEST(Resolve, StarAtomsExpandToBothSigns) {
  const Model model = good("A(d)\nB(d)\n1 *A(x) v *B(x)");
  ASSERT_EQ(model.formulas().size(), 4u);
  EXPECT_EQ(model.formulas()[0].text, "A(x) v B(x)");
  EXPECT_EQ(model.formulas()[1].text, "A(x) v !B(x)");
  EXPECT_EQ(model.formulas()[2].text, "!A(x) v B(x)");
  EXPECT_EQ(model.formulas()[2].root.children[0].kind, NodeKind::kNot);
  EXPECT_EQ(model.formulas()[2].root.children[1].kind, NodeKind::kAtom);
}

TEST(Resolve, LogxOfZeroIsAHardNegation) {
  const Model model = good("A(d)\nB(d)\nlogx(0) A(x) ^ B(x)");
  const Formula& formula = model.formulas()[0];
  EXPECT_TRUE(formula.hard);
  EXPECT_EQ(formula.root.kind, NodeKind::kNot);
  EXPECT_EQ(formula.text, "!(A(x) ^ B(x))");
}

TEST(Resolve, UniqueGroupsNameTemplateVariables) {
  const Model model = good("object(c, o!)\n#unique{+?a,+?b}\n0 object(?x, +?a) ^ object(?y, +?b) ^ ?x =/= ?y");
  const Formula& formula = model.formulas()[0];
  EXPECT_TRUE(formula.variables[1].plus);
  ASSERT_EQ(formula.unique.size(), 1u);
  EXPECT_EQ(formula.unique[0], (std::vector<std::uint32_t>{1, 3}));
  EXPECT_EQ(model.predicates()[0].block, BlockKind::kExactlyOne);
  EXPECT_EQ(model.predicates()[0].marked, (std::vector<bool>{false, true}));
  EXPECT_NE(messages("object(c, o)\n#unique{+a,+b}\n0 object(+a, +b)").find("have different domains, 'c' and 'o'"),
            std::string::npos);
}

TEST(Resolve, RangesAreExpanded) {
  const Model model = good("time = {0, ..., 551}\nat(thing, time)");
  EXPECT_EQ(model.domains()[0].constants.size(), 552u);
  EXPECT_EQ(model.domains()[0].constants.back(), "551");
  EXPECT_NE(messages("t = {1, ..., 20000000}\nat(t)").find("more than 10000000 constants"), std::string::npos);
}

TEST(Resolve, ArityIsReportedWithTheDeclaration) {
  EXPECT_EQ(messages("on(thing, thing)\n1.5  on(x, y, z) => on(y, x)\n"),
            "m.mln:2:6: error: predicate 'on' takes 2 arguments, 3 given [arity]\n"
            "    2 | 1.5  on(x, y, z) => on(y, x)\n"
            "      |      ^~~~~~~~~~~\n"
            "m.mln:1:1: note: 'on' is declared here\n");
}

TEST(Resolve, UnknownPredicateSuggestsTheNearest) {
  EXPECT_EQ(messages("Smokes(person)\nCancer(person)\n1 Smoks(x) => Cancer(x)\n"),
            "m.mln:3:3: error: predicate 'Smoks' is not declared; did you mean 'Smokes'? [unknown-predicate]\n"
            "    3 | 1 Smoks(x) => Cancer(x)\n"
            "      |   ^~~~~~~~\n");
}

TEST(Resolve, AVariableOfTwoDomainsIsAnErrorNamingBoth) {
  EXPECT_EQ(messages("at(thing, room)\n1 at(x, y) => at(y, x)\n"),
            "m.mln:2:18: error: variable 'y' stands for 'thing' here, but for 'room' elsewhere in the formula [type]\n"
            "    2 | 1 at(x, y) => at(y, x)\n"
            "      |                  ^\n"
            "m.mln:2:9: note: here 'y' stands for 'room'\n"
            "m.mln:2:21: error: variable 'x' stands for 'room' here, but for 'thing' elsewhere in the formula [type]\n"
            "    2 | 1 at(x, y) => at(y, x)\n"
            "      |                     ^\n"
            "m.mln:2:6: note: here 'x' stands for 'thing'\n");
}

TEST(Resolve, AVariableWithoutDomainIsAnError) {
  EXPECT_NE(messages("A(d)\n1 A(x) ^ y = z").find("variable 'y' has no domain: no predicate gives it one [no-domain]"),
            std::string::npos);
  EXPECT_NE(messages("A(d)\n1 A(x) ^ (EXIST y (A(x)))").find("variable 'y' has no domain"), std::string::npos);
}

TEST(Resolve, PlusOnAConstantIsAnError) {
  EXPECT_NE(
      messages("A(d)\n1 A(+Anna)").find("m.mln:2:5: error: '+' needs a variable, 'Anna' is a constant [template]"),
      std::string::npos);
}

TEST(Resolve, ANameThatIsVariableAndConstantIsWarnedAbout) {
  const std::string text = messages("d = {a, b}\nA(d)\nB(e)\n1 A(a) ^ B(a)\n");
  EXPECT_NE(
      text.find("m.mln:4:5: warning: 'a' is a constant of domain 'd' here, but a variable elsewhere in the formula "
                "[variable-and-constant]"),
      std::string::npos)
      << text;
}

TEST(Resolve, AConstantOutsideItsDeclaredDomainWidensItWithAWarning) {
  EXPECT_NE(
      messages(kTable1 + "1 is(o, n, Stay) ^ outOfView(o)")
          .find("warning: 'Stay' is not among the declared constants of domain 'explanations' and is added; did you "
                "mean 'stay'? [widened-domain]"),
      std::string::npos);
}

TEST(Resolve, DeclarationsMayBeRepeatedButNotContradicted) {
  EXPECT_EQ(messages("d = {A, B}\nd = {B, A}\nP(d)\n"), "");
  EXPECT_NE(messages("d = {A, B}\nd = {A}\nP(d)").find("m.mln:1:1: note: 'd' is declared here"), std::string::npos);
  EXPECT_NE(messages("P(d!, e)\nP(d, e!)").find("[redeclared]"), std::string::npos);
  EXPECT_NE(messages("P(d!, e?)").find("marks arguments with both '!' and '?'"), std::string::npos);
}

TEST(Resolve, AFormulaWithoutWeightIsKeptWithAWarning) {
  Diagnostics diagnostics;
  const std::optional<Model> model = read("A(d)\nA(x) => A(x) v A(y)\n!A(x)\n", diagnostics);
  ASSERT_TRUE(model);
  EXPECT_FALSE(model->formulas()[1].has_weight);
  EXPECT_NE(diagnostics.render().find("m.mln:3:1: warning: formula has neither a weight nor a final '.': its weight is "
                                      "taken to be 0 [no-weight]"),
            std::string::npos)
      << diagnostics.render();
}

TEST(Resolve, ASyntaxErrorDoesNotMakePredicatesUnknown) {
  EXPECT_EQ(messages("A(d\n1 B(x)\n").find("unknown-predicate"), std::string::npos);
}

TEST(Resolve, NonNumericConstantsCannotBeCompared) {
  EXPECT_NE(messages("year(p, n)\n1 year(p, y) ^ y < Many").find("'Many' is not a number and cannot be compared"),
            std::string::npos);
}

TEST(Resolve, PublishedModelsLoad) {
  const char* const folder = std::getenv("SHERLOG_DATA");
  if (folder == nullptr) GTEST_SKIP() << "SHERLOG_DATA is not set";
  for (const char* name : {"kitchen_fusion.mln",
                           "kitchen_fusion.learnt.mln",
                           "pracmln/smokers/smoking.mln",
                           "pracmln/smokers/wts.pybpll.smoking-train-smoking.mln",
                           "pracmln/alarm/alarm-kreator.mln",
                           "pracmln/alarm/alarm-noisyor.mln",
                           "pracmln/vegetarians/vegetarian-motivation.mln",
                           "pracmln/tweety/tweety-noisyor.mln",
                           "pracmln/tweety/tweety-kreator.mln",
                           "bench/rc/rc1000.mln",
                           "bench/rc/rc1000.tuffy.mln",
                           "bench/rc/rc_soft.mln",
                           "bench/smokers/smokers.mln",
                           "bench/smokers/smokers_formula.mln",
                           "bench/smokers/smokers_learn.mln",
                           "bench/smokers/smokers_soft.mln",
                           "bench/table1/er_cl.mln",
                           "bench/table1/er_cl_nofun.mln",
                           "bench/table1/er_formula.mln",
                           "bench/table1/er_formula_dom10.mln",
                           "bench/uwcse/uwcse.mln",
                           "bench/uwcse/uwcse.tuffy.mln"}) {
    Diagnostics diagnostics;
    EXPECT_TRUE(parse_model_file(std::string(folder) + "/" + name, diagnostics)) << diagnostics.render();
  }
}

}  // namespace
}  // namespace sherlog
