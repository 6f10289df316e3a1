// Query texts: items, patterns, formulas, and what is refused.
#include "mln/query.h"

#include <gtest/gtest.h>

#include <string>

namespace sherlog {
namespace {

class QueryTexts : public ::testing::Test {
 protected:
  void SetUp() override {
    Diagnostics diagnostics;
    std::optional<Model> model = parse_model(
        "explanations = {move, stay, not}\nis(old, new, explanations!)\nsimilar(old, new)\nSmokes(person)\n", "m.mln",
        diagnostics);
    ASSERT_TRUE(model) << diagnostics.render();
    model_ = std::move(*model);
    auto databases = parse_evidence(model_, "similar(O1,N1)\nsimilar(O1,door)\nSmokes(Anna)\nSmokes(Dr. Oetker)\n",
                                    "e.db", diagnostics);
    ASSERT_TRUE(databases) << diagnostics.render();
    evidence_ = std::move(databases->front());
  }

  Query good(const std::vector<std::string>& texts) {
    Diagnostics diagnostics;
    const std::optional<Query> query = parse_query(model_, evidence_, texts, diagnostics);
    EXPECT_TRUE(query) << diagnostics.render();
    return query.value_or(Query());
  }

  std::string messages(const std::string& text) {
    Diagnostics diagnostics;
    EXPECT_FALSE(parse_query(model_, evidence_, {text}, diagnostics)) << text;
    return diagnostics.render();
  }

  Model model_;
  Evidence evidence_ = Evidence(Model());
};

TEST_F(QueryTexts, CommasOutsideBracketsSeparateItems) {
  const Query query = good({"is, similar(O1,N1) ,Smokes(\"Dr. Oetker\")", "Smokes"});
  ASSERT_EQ(query.items.size(), 4u);
  EXPECT_EQ(query.items[0].text, "is");
  EXPECT_EQ(query.items[1].text, "similar(O1,N1)");
  EXPECT_EQ(query.items[2].pattern[0], Term::constant(1));
  EXPECT_EQ(query.items[3].pattern_variables, 1u);
}

TEST_F(QueryTexts, AVariableThatRecursMatchesTheSameConstant) {
  const QueryItem item = good({"is(?o, N1, ?e)"}).items.at(0);
  EXPECT_EQ(item.kind, QueryItem::Kind::kAtoms);
  EXPECT_EQ(item.pattern_variables, 2u);
  EXPECT_EQ(item.pattern, (std::vector<Term>{Term::variable(0), Term::constant(0), Term::variable(1)}));
}

TEST_F(QueryTexts, LowerCaseNamesAreConstantsWhereKnownAndVariablesElsewhere) {
  const QueryItem item = good({"is(o, door, move)"}).items.at(0);
  EXPECT_EQ(item.pattern, (std::vector<Term>{Term::variable(0), Term::constant(1), Term::constant(0)}));
}

TEST_F(QueryTexts, AnythingWithAConnectiveIsAFormula) {
  const Query query = good({"Smokes(Anna) ^ similar(O1,door), EXIST o, n (is(o, n, stay)), !Smokes(Anna)"});
  ASSERT_EQ(query.items.size(), 3u);
  EXPECT_EQ(query.items[0].kind, QueryItem::Kind::kFormula);
  EXPECT_EQ(query.items[0].formula.text, "Smokes(Anna) ^ similar(O1, door)");
  EXPECT_EQ(query.items[1].formula.variables.size(), 2u);
  EXPECT_EQ(query.items[1].formula.root.kind, NodeKind::kExists);
  EXPECT_EQ(query.items[2].formula.root.kind, NodeKind::kNot);
}

TEST_F(QueryTexts, UnknownNamesAreErrorsWithSuggestions) {
  EXPECT_EQ(messages("Smoks"),
            "query:1:1: error: predicate 'Smoks' is not declared; did you mean 'Smokes'? [unknown-predicate]\n"
            "    1 | Smoks\n"
            "      | ^~~~~\n");
  EXPECT_EQ(messages("Smokes(Ana)"),
            "query:1:8: error: 'Ana' is no constant of domain 'person'; did you mean 'Anna'? [unknown-constant]\n"
            "    1 | Smokes(Ana)\n"
            "      |        ^~~\n");
  EXPECT_NE(messages("similar(O1)").find("predicate 'similar' takes 2 arguments, 1 given [arity]"), std::string::npos);
}

TEST_F(QueryTexts, FreeVariablesTemplatesAndEmptyItemsAreErrors) {
  EXPECT_NE(
      messages("Smokes(x) ^ Smokes(Anna)").find("variable 'x' is free in a queried formula; bind it: EXIST x (...)"),
      std::string::npos);
  EXPECT_NE(messages("is,,similar").find("a query item is empty"), std::string::npos);
  EXPECT_NE(messages("Smokes(+x)").find("has no meaning in a query"), std::string::npos);
  EXPECT_NE(messages("Smokes(Anna").find("error"), std::string::npos);
}

TEST_F(QueryTexts, ComparisonNeedsNumbersInTheEvidenceToo) {
  EXPECT_NE(messages("EXIST x, y (Smokes(x) ^ Smokes(y) ^ x < y)").find("constant 'Anna' of domain 'person' is none"),
            std::string::npos);
}

class SeveralDatabases : public QueryTexts {
 protected:
  void SetUp() override {
    QueryTexts::SetUp();
    Diagnostics diagnostics;
    auto databases =
        parse_evidence(model_, "Smokes(Anna)\nSmokes(carl)\n---\nSmokes(Bob)\nSmokes(Anna)\n", "e.db", diagnostics);
    ASSERT_TRUE(databases) << diagnostics.render();
    databases_ = std::move(*databases);
  }
  std::vector<Evidence> databases_;
};

TEST_F(SeveralDatabases, EachHasItsOwnNumbers) {
  Diagnostics diagnostics;
  const auto queries = parse_queries(model_, databases_, {"Smokes(Anna), Smokes(Anna) ^ Smokes(Anna)"}, diagnostics);
  ASSERT_TRUE(queries) << diagnostics.render();
  EXPECT_EQ(diagnostics.render(), "");
  EXPECT_EQ((*queries)[0].items[0].pattern[0], Term::constant(0));
  EXPECT_EQ((*queries)[1].items[0].pattern[0], Term::constant(1));
  EXPECT_EQ((*queries)[1].items[1].formula.root.children.at(0).terms.at(0), Term::constant(1));
}

TEST_F(SeveralDatabases, AnItemIsAbsentWhereItsConstantIsUnknown) {
  Diagnostics diagnostics;
  const auto queries = parse_queries(model_, databases_, {"Smokes(Bob), !Smokes(Bob), Smokes"}, diagnostics);
  ASSERT_TRUE(queries) << diagnostics.render();
  const auto absent = [&](std::size_t d) {
    std::string text;
    for (const QueryItem& item : (*queries)[d].items) text += item.absent ? '-' : '+';
    return text;
  };
  EXPECT_EQ(absent(0), "--+");
  EXPECT_EQ(absent(1), "+++");
  EXPECT_NE(
      diagnostics.render().find("warning: 'Bob' is no constant of domain 'person' in database 1: there 'Smokes(Bob)' "
                                "has no answer"),
      std::string::npos)
      << diagnostics.render();
}

// Without that, Smokes(carl) would ask the second database for everybody.
TEST_F(SeveralDatabases, ANameThatOneOfThemKnowsIsAConstantInAll) {
  Diagnostics diagnostics;
  const auto queries = parse_queries(model_, databases_, {"Smokes(carl)"}, diagnostics);
  ASSERT_TRUE(queries) << diagnostics.render();
  EXPECT_EQ((*queries)[0].items[0].pattern_variables, 0u);
  EXPECT_EQ((*queries)[1].items[0].pattern_variables, 0u);
  EXPECT_TRUE((*queries)[1].items[0].absent);
}

TEST_F(SeveralDatabases, AConstantThatNoneKnowsIsAnError) {
  Diagnostics diagnostics;
  EXPECT_FALSE(parse_queries(model_, databases_, {"Smokes(Anne)"}, diagnostics));
  EXPECT_EQ(diagnostics.error_count(), 1u);
  EXPECT_NE(diagnostics.render().find("did you mean 'Anna'?"), std::string::npos) << diagnostics.render();
}

}  // namespace
}  // namespace sherlog
