#include "mln/printer.h"

#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <random>
#include <string>

#include "mln/parser.h"

namespace sherlog {
namespace {

using syntax::Formula;
using syntax::Kind;
using syntax::Term;

// Random trees as a program may build them: brackets only where chance puts them.
class FormulaGenerator {
 public:
  explicit FormulaGenerator(std::uint32_t seed) : random_(seed) {}

  Formula formula(int depth) {
    Formula result = depth == 0 ? leaf() : node(depth);
    result.bracketed = pick(5) == 0;
    return result;
  }

 private:
  std::size_t pick(std::size_t count) { return std::uniform_int_distribution<std::size_t>(0, count - 1)(random_); }

  Term term() {
    static const Term kTerms[] = {
        {Term::Kind::kIdentifier, "x", false, {}},      {Term::Kind::kIdentifier, "Anna", false, {}},
        {Term::Kind::kIdentifier, "ja!_", false, {}},   {Term::Kind::kVariable, "y", false, {}},
        {Term::Kind::kVariable, "z", true, {}},         {Term::Kind::kIdentifier, "w", true, {}},
        {Term::Kind::kQuoted, "a \"b\" \\", false, {}}, {Term::Kind::kNumber, "-5", false, {}},
        {Term::Kind::kNumber, "0.25", false, {}},       {Term::Kind::kIdentifier, "Gr\u00fc\u00dfe", false, {}},
    };
    return kTerms[pick(std::size(kTerms))];
  }

  Formula leaf() {
    static const Kind kKinds[] = {Kind::kAtom, Kind::kAtom,    Kind::kStarAtom,     Kind::kEqual,    Kind::kNotEqual,
                                  Kind::kLess, Kind::kGreater, Kind::kGreaterEqual, Kind::kLessEqual};
    Formula result;
    result.kind = kKinds[pick(std::size(kKinds))];
    const bool atom = result.kind == Kind::kAtom || result.kind == Kind::kStarAtom;
    if (atom) result.name = pick(2) == 0 ? "P" : "knows";
    const std::size_t count = atom ? pick(3) : 2;
    for (std::size_t i = 0; i < count; ++i) result.terms.push_back(term());
    return result;
  }

  Formula node(int depth) {
    static const Kind kKinds[] = {Kind::kNot, Kind::kAnd,    Kind::kOr,    Kind::kImplies,
                                  Kind::kIff, Kind::kExists, Kind::kForall};
    Formula result;
    result.kind = kKinds[pick(std::size(kKinds))];
    const bool quantifier = result.kind == Kind::kExists || result.kind == Kind::kForall;
    const bool chain = result.kind == Kind::kAnd || result.kind == Kind::kOr;
    if (quantifier) result.terms = {{Term::Kind::kIdentifier, "x", false, {}}, {Term::Kind::kVariable, "y", false, {}}};
    const std::size_t count = chain ? 2 + pick(3) : quantifier || result.kind == Kind::kNot ? 1 : 2;
    for (std::size_t i = 0; i < count; ++i) {
      const std::size_t below = pick(static_cast<std::size_t>(depth));
      result.children.push_back(formula(static_cast<int>(below)));
    }
    return result;
  }

  std::mt19937 random_;
};

void forget_brackets(Formula& formula) {
  formula.bracketed = false;
  for (Formula& child : formula.children) forget_brackets(child);
}

TEST(Printer, IsUndoneByTheParserForAnyFormula) {
  FormulaGenerator generator(7);
  for (int i = 0; i < 1000; ++i) {
    Formula formula = generator.formula(5);
    const std::string text = print(formula);
    Diagnostics diagnostics;
    std::optional<Formula> parsed = parse_formula(text, "f", diagnostics);
    ASSERT_TRUE(parsed) << text << '\n' << diagnostics.render();
    EXPECT_EQ(print(*parsed), text);
    forget_brackets(formula);
    forget_brackets(*parsed);
    EXPECT_TRUE(equal(formula, *parsed)) << text << '\n' << print(*parsed);
  }
}

TEST(Printer, KeepsTheReadingOfTheOtherPrecedence) {
  FormulaGenerator generator(8);
  ParseOptions other;
  other.precedence = Precedence::kOrTighter;
  for (int i = 0; i < 300; ++i) {
    const std::string text = print(generator.formula(4));
    Diagnostics diagnostics;
    std::optional<Formula> theirs = parse_formula(text, "f", diagnostics, other);
    ASSERT_TRUE(theirs) << text;
    std::optional<Formula> ours = parse_formula(print(*theirs), "f", diagnostics);
    ASSERT_TRUE(ours) << text;
    forget_brackets(*theirs);
    forget_brackets(*ours);
    EXPECT_TRUE(equal(*theirs, *ours)) << text;
  }
}

void expect_round_trip(const std::string& text, const std::string& name) {
  Diagnostics diagnostics;
  const syntax::Model model = parse_syntax(text, name, diagnostics);
  EXPECT_FALSE(diagnostics.has_errors()) << diagnostics.render();
  const std::string printed = print(model);
  const syntax::Model again = parse_syntax(printed, name, diagnostics);
  EXPECT_FALSE(diagnostics.has_errors()) << diagnostics.render();
  EXPECT_TRUE(equal(model, again)) << name;
  EXPECT_EQ(print(again), printed);
}

TEST(Printer, IsUndoneByTheParserForEveryStatement) {
  expect_round_trip(
      "d = {A, \"B c\", ja!_}\ntime = {0, ..., 551}\ne = {}\n*S(d)\nis(d, time!)\nq(d, e?)\nr(d)\n"
      "1.5 S(x) ^ r(x) => is(x, +t)\n-log(2): r(x)\nlog(0.15/0.85) r(x)\nlogx(0) r(x) v S(x)\nr(x) :- S(x) <=> r(y)\n"
      "r(x) => S(x).\n#fixweight\n#unique{+?a,+b}\n2 r(+?a) ^ r(+b)\n@5 r(x)\n2: -5 < x ^ r(x)\n1.5 *r(x)\n!x = y.\n"
      "EXIST x x = y.\n(1 + // one\n 2) r(x)\n1 r(x) ^ S(x) v r(y)\nr(x)\n",
      "m");
}

TEST(Printer, IsUndoneByTheParserForTheDataFiles) {
  const char* folder = std::getenv("SHERLOG_DATA");
  if (folder == nullptr) GTEST_SKIP() << "SHERLOG_DATA is not set";
  std::size_t files = 0;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder)) {
    if (entry.path().extension() != ".mln") continue;
    Diagnostics diagnostics;
    const auto text = read_text_file(entry.path().string(), diagnostics);
    ASSERT_TRUE(text) << diagnostics.render();
    expect_round_trip(*text, entry.path().string());
    ++files;
  }
  EXPECT_GT(files, 0u);
}

std::string printed(const std::string& text, Dialect dialect) {
  Diagnostics diagnostics;
  const auto formula = parse_formula(text, "f", diagnostics);
  return formula ? print(*formula, dialect) : diagnostics.render();
}

TEST(Printer, SpellsAsTheDialectDoes) {
  EXPECT_EQ(printed("\u00ACP(?x) \u2227 ?x != A \u2192 \u2203 ?y Q(?y)", Dialect::kPracmln),
            "!P(?x) ^ ?x =/= A => EXIST ?y (Q(?y))");
  EXPECT_EQ(printed("P(?x) ^ ?x =/= A", Dialect::kAlchemy), "P(x) ^ x != A");
  EXPECT_EQ(printed("P(x) ^ Q(x) v R(x)", Dialect::kAlchemy), "(P(x) ^ Q(x)) v R(x)");
  EXPECT_EQ(printed("P(x) ^ Q(x) v R(x)", Dialect::kSherlog), "P(x) ^ Q(x) v R(x)");
}

TEST(Equal, SeesEveryDifferenceButPlaces) {
  Diagnostics diagnostics;
  const auto parse = [&](const char* text) { return *parse_formula(text, "f", diagnostics); };
  EXPECT_TRUE(equal(parse("P(x)  ^ Q(x)"), parse("P( x ) & Q(x)")));
  EXPECT_FALSE(equal(parse("P(x) ^ Q(x)"), parse("P(x) v Q(x)")));
  EXPECT_FALSE(equal(parse("P(x)"), parse("P(?x)")));
  EXPECT_FALSE(equal(parse("P(x)"), parse("P(+x)")));
  EXPECT_FALSE(equal(parse("P(x)"), parse("(P(x))")));
  EXPECT_FALSE(equal(parse("P(x) ^ Q(x)"), parse("P(x) ^ Q(x) ^ Q(x)")));
}

}  // namespace
}  // namespace sherlog
