#include "mln/parser.h"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <string>

#include "mln/printer.h"

namespace sherlog {
namespace {

using syntax::Kind;

struct Parsed {
  syntax::Model model;
  std::string messages;
};

Parsed parse(const std::string& text, const ParseOptions& options = {}) {
  Diagnostics diagnostics;
  syntax::Model model = parse_syntax(text, "m.mln", diagnostics, options);
  return {std::move(model), diagnostics.render()};
}

// "file:line:column: message", the first only.
std::string first_message(const std::string& text) {
  const std::string messages = parse(text).messages;
  return messages.substr(0, messages.find('\n'));
}

syntax::WeightedFormula only_formula(const std::string& text) {
  const Parsed parsed = parse(text);
  EXPECT_EQ(parsed.messages, "") << text;
  EXPECT_FALSE(parsed.model.statements.empty()) << text;
  if (parsed.model.statements.empty()) return {};
  const auto* formula = std::get_if<syntax::WeightedFormula>(&parsed.model.statements.back());
  EXPECT_NE(formula, nullptr) << text;
  return formula == nullptr ? syntax::WeightedFormula{} : *formula;
}

double weight_of(const std::string& text) { return only_formula("P(a)\nQ(a)\n" + text).weight.value_or(-12345); }

TEST(Weight, IsArithmetic) {
  EXPECT_DOUBLE_EQ(weight_of("1.5 P(x)"), 1.5);
  EXPECT_DOUBLE_EQ(weight_of("1.5: P(x)"), 1.5);
  EXPECT_DOUBLE_EQ(weight_of("-log(2) P(x)"), -std::log(2.0));
  EXPECT_DOUBLE_EQ(weight_of("log(0.15/0.85) P(x)"), std::log(0.15 / 0.85));
  EXPECT_DOUBLE_EQ(weight_of("2-1 P(x)"), 1);
  EXPECT_DOUBLE_EQ(weight_of("1 - 2 - 3 P(x)"), -4);
  EXPECT_DOUBLE_EQ(weight_of("(1+2)*-3 P(x)"), -9);
  EXPECT_DOUBLE_EQ(weight_of("-2^2 P(x)"), -4);
  EXPECT_DOUBLE_EQ(weight_of("sqrt(exp(0)) P(x)"), 1);
  EXPECT_DOUBLE_EQ(weight_of("logx(1) P(x)"), 0);
  EXPECT_DOUBLE_EQ(weight_of("logx(0.5) P(x)"), std::log(0.5));
  EXPECT_DOUBLE_EQ(weight_of("0.5!P(x)"), 0.5);
  EXPECT_DOUBLE_EQ(weight_of("1e-3 P(x)"), 1e-3);
  EXPECT_DOUBLE_EQ(weight_of("(1 +\n 2) P(x)"), 3);
}

TEST(Weight, EndsWhereTheFormulaBegins) {
  EXPECT_EQ(only_formula("P(a)\n(1+2) P(x)").formula.kind, Kind::kAtom);
  const auto bracketed = only_formula("P(a)\n(P(x) ^ P(y))");
  EXPECT_FALSE(bracketed.weight);
  EXPECT_EQ(bracketed.formula.kind, Kind::kAnd);
  const auto star = only_formula("P(a)\n1.5 *P(x)");
  EXPECT_EQ(star.weight, 1.5);
  EXPECT_EQ(star.formula.kind, Kind::kStarAtom);
  const auto predicate = only_formula("log(a)\n2 log(x)");
  EXPECT_EQ(predicate.weight, 2);
  EXPECT_EQ(predicate.formula.name, "log");
  EXPECT_FALSE(only_formula("log(a)\nlog(x) v log(y)").weight);
  const auto comparison = only_formula("P(a)\n-5 < x => P(x)");
  EXPECT_FALSE(comparison.weight);
  EXPECT_EQ(comparison.formula.children[0].terms[0].name, "-5");
  EXPECT_EQ(only_formula("P(a)\n2: -5 < x ^ P(x)").weight, 2);
}

TEST(Weight, OfLogxZeroIsAHardNegation) {
  const auto formula = only_formula("P(a)\nlogx(0) P(x)");
  EXPECT_TRUE(formula.hard);
  EXPECT_TRUE(formula.negated);
  EXPECT_FALSE(formula.weight);
}

TEST(Weight, HasToBeFinite) {
  for (const char* weight :
       {"inf", "-inf", "-float('inf')", "1/0", "log(0)", "log(-1)", "2*logx(0)", "1e999", "exp(1e9)"}) {
    EXPECT_EQ(first_message("P(a)\n" + std::string(weight) + " P(x)"),
              "m.mln:2:1: error: weight is not a finite number; end the formula in '.' to make it hard [weight]");
  }
}

TEST(Weight, AndADotAreOneTooMany) {
  EXPECT_EQ(first_message("P(a)\n2 P(x)."),
            "m.mln:2:7: error: both a weight and a '.' are given: leave out one of them (weight '2') [weight]");
  EXPECT_EQ(first_message("P(a)\n1 2 P(x)"),
            "m.mln:2:3: error: expected a formula after the weight, found '2' [syntax]");
}

TEST(Declaration, IsTheFirstPlainAtomOfItsName) {
  const Parsed parsed = parse("P(a)\nP(a)\n*Q(a, b!)\n*Q(a, b)\nis(o, n?)\nis(o, n!)\nR(A, \"b\")");
  ASSERT_EQ(parsed.messages, "");
  ASSERT_EQ(parsed.model.statements.size(), 7u);
  EXPECT_TRUE(std::holds_alternative<syntax::PredicateDeclaration>(parsed.model.statements[0]));
  EXPECT_TRUE(std::holds_alternative<syntax::WeightedFormula>(parsed.model.statements[1]));
  const auto& closed = std::get<syntax::PredicateDeclaration>(parsed.model.statements[2]);
  EXPECT_TRUE(closed.closed);
  EXPECT_EQ(closed.arguments[0].mark, 0);
  EXPECT_EQ(closed.arguments[1].mark, '!');
  EXPECT_EQ(std::get<syntax::WeightedFormula>(parsed.model.statements[3]).formula.kind, Kind::kStarAtom);
  EXPECT_EQ(std::get<syntax::PredicateDeclaration>(parsed.model.statements[4]).arguments[1].mark, '?');
  EXPECT_TRUE(std::holds_alternative<syntax::PredicateDeclaration>(parsed.model.statements[5]));  // a mark decides
  EXPECT_TRUE(std::holds_alternative<syntax::WeightedFormula>(parsed.model.statements[6]));
}

TEST(Declaration, OfADomainListsConstantsOrARange) {
  const Parsed parsed = parse("d = {A,\n \"B c\", ja!_, -5\n}\ntime = {0, ..., 551}\nempty = {}");
  ASSERT_EQ(parsed.messages, "");
  ASSERT_EQ(parsed.model.statements.size(), 3u);
  const auto& domain = std::get<syntax::DomainDeclaration>(parsed.model.statements[0]);
  ASSERT_EQ(domain.constants.size(), 4u);
  EXPECT_EQ(domain.constants[1].name, "B c");
  EXPECT_EQ(domain.constants[1].kind, syntax::Term::Kind::kQuoted);
  EXPECT_EQ(domain.constants[2].name, "ja!_");
  EXPECT_EQ(domain.constants[3].name, "-5");
  const auto& range = std::get<syntax::DomainDeclaration>(parsed.model.statements[1]);
  EXPECT_TRUE(range.range);
  EXPECT_EQ(range.constants.back().name, "551");
  EXPECT_NE(first_message("t = {5, ..., 1}").find("[range]"), std::string::npos);
  EXPECT_NE(first_message("t = {A, ..., B}").find("[range]"), std::string::npos);
}

// Compared by printing with every bracket that the tree has.
std::string shape(const syntax::Formula& formula) {
  std::string result;
  if (formula.children.empty()) return print(formula);
  static const std::string kNames[] = {"",    "",    "",   "",        "",    "",     "",   "",
                                       "not", "and", "or", "implies", "iff", "some", "all"};
  result = kNames[static_cast<std::size_t>(formula.kind)] + "[";
  for (const syntax::Formula& child : formula.children) {
    result += shape(child) + (&child == &formula.children.back() ? "]" : " ");
  }
  return result;
}

std::string shape_of(const std::string& text, Precedence precedence = Precedence::kAndTighter) {
  Diagnostics diagnostics;
  ParseOptions options;
  options.precedence = precedence;
  const auto formula = parse_formula(text, "f", diagnostics, options);
  return formula ? shape(*formula) : diagnostics.render();
}

TEST(Precedence, IsNotAndOrImpliesIffRule) {
  EXPECT_EQ(shape_of("!A() ^ B() v C()"), "or[and[not[A()] B()] C()]");
  EXPECT_EQ(shape_of("A() v B() ^ C()"), "or[A() and[B() C()]]");
  EXPECT_EQ(shape_of("A() => B() => C()"), "implies[A() implies[B() C()]]");
  EXPECT_EQ(shape_of("A() <=> B() => C() v D()"), "iff[A() implies[B() or[C() D()]]]");
  EXPECT_EQ(shape_of("A() :- B() ^ C()"), "implies[and[B() C()] A()]");
  EXPECT_EQ(shape_of("A() ^ B() ^ C()"), "and[A() B() C()]");
  EXPECT_EQ(shape_of("A() ^ (B() ^ C())"), "and[A() and[B() C()]]");
  EXPECT_EQ(shape_of("EXIST x P(x) v Q(x)"), "some[or[P(x) Q(x)]]");
  EXPECT_EQ(shape_of("\u2203 x \u00ACP(x) \u2192 \u2200 ?y (Q(?y))"), "some[implies[not[P(x)] all[Q(?y)]]]");
  EXPECT_EQ(shape_of("exists x, y (P(x) & Q(y) | R())"), "some[or[and[P(x) Q(y)] R()]]");
  EXPECT_EQ(shape_of("P(v) v(Q(v))"), "or[P(v) (Q(v))]");
}

TEST(Precedence, OfOrOverAndIsAnOption) {
  EXPECT_EQ(shape_of("A() ^ B() v C()", Precedence::kOrTighter), "and[A() or[B() C()]]");
  EXPECT_EQ(shape_of("A() v B() ^ C()", Precedence::kOrTighter), "and[or[A() B()] C()]");
}

TEST(Precedence, WarnsOfAMixWithoutBracketsOnly) {
  const std::string text = "P(a)\n1 P(x) ^ P(y) v P(z)";
  EXPECT_EQ(parse(text).messages,
            "m.mln:2:15: warning: '^' binds tighter than 'v' here, not in every system: this is read as "
            "'(P(x) ^ P(y)) v P(z)'; brackets would say so [mixed-connectives]\n"
            "    2 | 1 P(x) ^ P(y) v P(z)\n      |               ^\n");
  EXPECT_EQ(parse("P(a)\n1 (P(x) ^ P(y)) v P(z)\n1 P(x) ^ (P(y) v P(z))").messages, "");
  ParseOptions options;
  options.precedence = Precedence::kOrTighter;
  EXPECT_EQ(parse(text, options).messages, "");
}

TEST(Statement, EndsWithItsLineUnlessAConnectiveOrBracketGoesOn) {
  const Parsed parsed = parse("P(a)\nP(x) =>\n P(y)\nP(x)\n ^ P(y)\n v P(z)\nP(x\n)\nP(x)\n\n=> P(y).");
  EXPECT_EQ(parsed.model.statements.size(), 5u);
  EXPECT_EQ(std::get<syntax::WeightedFormula>(parsed.model.statements[2]).formula.kind, Kind::kOr);
  EXPECT_TRUE(std::get<syntax::WeightedFormula>(parsed.model.statements[4]).hard);
}

TEST(Statement, TakesDirectivesOnTheLineBefore) {
  const auto formula = only_formula("P(a)\n#fixweight\n#unique{+?a,+b}\n2 P(+?a) ^ P(+b)");
  EXPECT_TRUE(formula.fixed);
  EXPECT_EQ(formula.unique, (std::vector<std::string>{"a", "b"}));
  const auto same_line = only_formula("P(a)\n#fixweight 2 P(x)");
  EXPECT_TRUE(same_line.fixed);
  const auto tuffy = only_formula("P(a)\n@5 P(x)");
  EXPECT_TRUE(tuffy.fixed);
  EXPECT_EQ(tuffy.weight, 5);
  EXPECT_EQ(first_message("#fixweight\nP(a)"), "m.mln:1:1: error: '#fixweight' has to stand before a formula [syntax]");
  EXPECT_EQ(first_message("#uniqe{+a}"),
            "m.mln:1:1: error: unknown directive '#uniqe'; did you mean '#unique'? [syntax]");
}

TEST(Statement, KnowsThePlacesOfItsParts) {
  const auto formula = only_formula("P(a)\n  1.5 P(x) => x != Y");
  EXPECT_EQ(formula.place.column, 3u);
  EXPECT_EQ(formula.place.length, 18u);
  EXPECT_EQ(formula.formula.place.column, 12u);  // =>
  EXPECT_EQ(formula.formula.children[0].place.column, 7u);
  EXPECT_EQ(formula.formula.children[0].place.length, 4u);
  EXPECT_EQ(formula.formula.children[1].place.length, 6u);
  EXPECT_EQ(formula.formula.children[0].terms[0].place.column, 9u);
}

struct Case {
  const char* text;
  const char* message;
};

TEST(SyntaxError, SaysWhereWhatWasFoundAndWhatExpected) {
  const Case cases[] = {
      {"P(a, b", "m.mln:1:7: error: expected ',' or ')', found end of file [syntax]"},
      {"P(x => Q(x)", "m.mln:1:5: error: expected ',' or ')', found '=>' [syntax]"},
      {"P(a)\n(P(x) ^ P(y)", "m.mln:2:13: error: expected a connective or ')', found end of file [syntax]"},
      {"P(a)\nP(x) P(y)", "m.mln:2:6: error: expected a connective or end of line, found 'P' [syntax]"},
      {"v = {A, B}\n", "m.mln:1:1: error: 'v' means 'or' and cannot name a domain [syntax]"},
      {"P(v)\nv = {A, B}\n", "m.mln:2:1: error: 'v' means 'or' and cannot name a domain [syntax]"},
      {"P(a)\nP(x) ^", "m.mln:2:7: error: expected a formula, found end of line [syntax]"},
      {"P(a)\n1.5", "m.mln:2:4: error: expected a formula after the weight, found end of line [syntax]"},
      {"P(a)\n!", "m.mln:2:2: error: expected a formula, found end of line [syntax]"},
      {"P(a)\nP(x), P(y)", "m.mln:2:5: error: expected a connective or end of line, found ',' [syntax]"},
      {"P(a)\nP(x.)", "m.mln:2:4: error: expected ',' or ')', found '.' [syntax]"},
      {"P(a)\nP(,)", "m.mln:2:3: error: expected an argument, found ',' [syntax]"},
      {"P(a)\nP(b!) ^ P(c)",
       "m.mln:2:4: error: '!' marks an argument in the declaration of 'P', not in a formula [syntax]"},
      {"P(a)\nx = ", "m.mln:2:4: error: expected a variable or constant, found end of line [syntax]"},
      {"P(a)\nx = y = z.", "m.mln:2:7: error: comparisons do not chain: join two of them by '^' [syntax]"},
      {"Foo", "m.mln:1:4: error: expected '(' or a comparison after 'Foo', found end of line [syntax]"},
      {"\"abc", "m.mln:1:1: error: a string is not closed at the end of its line [syntax]"},
      {"/* abc", "m.mln:1:1: error: a comment is not closed: '*/' is missing [syntax]"},
      {"P(a)\nP(x) $ P(y)", "m.mln:2:6: error: unexpected character '$' [syntax]"},
      {"\x01", "m.mln:1:1: error: unexpected byte 0x01 [syntax]"},
      {"EXIST x, (P(x))", "m.mln:1:10: error: expected a variable, found '(' [syntax]"},
      {"v(a)", "m.mln:1:1: error: 'v' means 'or' and cannot name a predicate [syntax]"},
      {"d = {A B}", "m.mln:1:8: error: expected ',' or '}', found 'B' [syntax]"},
      {"d = {?x}", "m.mln:1:6: error: a domain lists constants, not variables [syntax]"},
      {"#include f", "m.mln:1:10: error: expected a file name in quotes after '#include', found 'f' [syntax]"},
      {"#unique{a}\n1 P(x)", "m.mln:1:9: error: '#unique' lists variables with '+', as in #unique{+?a,+?b} [syntax]"},
      {"0.5P(x)",
       "m.mln:1:1: error: a predicate cannot begin with a digit, found '0.5P': put a blank behind a weight [syntax]"},
      {"A() :- B() :- C()", "m.mln:1:12: error: ':-' can stand only once in a rule [syntax]"},
      {"@P(x)", "m.mln:1:2: error: expected a weight after '@', found 'P' [syntax]"},
  };
  for (const Case& test : cases) EXPECT_EQ(first_message(test.text), test.message) << test.text;
}

TEST(SyntaxError, NamesFunctionsAsNotSupported) {
  for (const char* text :
       {"fluent move(id, id)", "id move(id)", "P(f(x), y)", "t++", "f(A) = B", "P(x+1)", "a = f(x)"}) {
    EXPECT_NE(first_message(text).find("functions are not supported in this release [functions]"), std::string::npos)
        << text;
  }
}

TEST(SyntaxError, DoesNotSwallowTheStatementsAfterIt) {
  const Parsed parsed = parse("P(x => Q(x)\nR(a)\nd = {A,\n  B C,\n  D}\n1 R(x)\n(R(x) ^\nR(y)\n2 R(x)\n");
  EXPECT_EQ(parsed.model.statements.size(), 3u) << parsed.messages;  // R(a), 1 R(x), 2 R(x)
  std::size_t errors = 0;
  for (std::size_t i = parsed.messages.find("error:"); i != std::string::npos;
       i = parsed.messages.find("error:", i + 1)) {
    ++errors;
  }
  EXPECT_EQ(errors, 3u) << parsed.messages;
}

std::string repeated(const std::string& text, int count) {
  std::string result;
  for (int i = 0; i < count; ++i) result += text;
  return result;
}

TEST(Depth, BeyondTheBoundIsAnErrorAndNoOverflow) {
  constexpr int kDeep = 100'000;
  for (const std::string& text :
       {repeated("(", kDeep) + "P(x)", repeated("!", kDeep) + "P(x)", repeated("P(x) => ", kDeep) + "P(x)",
        repeated("P(x) <=> ", kDeep) + "P(x)", repeated("EXIST x ", kDeep) + "P(x)", repeated("!(", kDeep) + "P(x)",
        "1+" + repeated("(", kDeep) + "1", repeated("log(", kDeep) + "1", "2" + repeated("^2", kDeep) + " P(x)",
        repeated("EXIST x (!(P(x) => ", kDeep)}) {
    const Parsed parsed = parse(text);
    EXPECT_NE(parsed.messages.find("nested more than 1000 deep [nesting]"), std::string::npos) << text.substr(0, 20);
    EXPECT_TRUE(parsed.model.statements.empty());
  }
}

TEST(Depth, BelowTheBoundIsNone) {
  EXPECT_EQ(parse("P(a)\n" + repeated("(", 900) + "P(x)" + repeated(")", 900)).messages, "");
  EXPECT_EQ(parse("P(a)\n" + repeated("P(x) ^ ", 20'000) + "P(x)").messages, "");
  EXPECT_EQ(parse("P(a)\n" + repeated("-", 20'000) + "1 P(x)").messages, "");
  const std::string name(10'000, 'n');
  EXPECT_EQ(parse(name + "(a)\n1 " + name + "(x)").messages, "");
}

TEST(Text, MayHaveAByteOrderMarkAndCarriageReturns) {
  const Parsed parsed = parse("\xEF\xBB\xBFP(a)\r\n// ... \r\n1 P(x)\r\nP(x) =>\r\n P(y).\r\n");
  EXPECT_EQ(parsed.messages, "");
  EXPECT_EQ(parsed.model.statements.size(), 3u);
}

TEST(Text, OfAnyBytesIsAnsweredWithErrorsOnly) {
  std::string bytes;
  for (int i = 0; i < 256; ++i) bytes += static_cast<char>(i);
  for (std::size_t shift = 0; shift < 256; ++shift) {
    EXPECT_NE(parse(bytes.substr(shift) + bytes.substr(0, shift)).messages, "");
  }
}

TEST(Formula, AloneHasNoWeightAndNoDot) {
  Diagnostics diagnostics;
  EXPECT_TRUE(parse_formula("Smokes(Anna) ^ Cancer(Anna)", "query", diagnostics));
  EXPECT_FALSE(diagnostics.has_errors());
  EXPECT_FALSE(parse_formula("Smokes(Anna).", "query", diagnostics));
  EXPECT_FALSE(parse_formula("", "query", diagnostics));
  EXPECT_EQ(diagnostics.error_count(), 2u);
}

class IncludeTest : public testing::Test {
 protected:
  void SetUp() override {
    const auto* info = testing::UnitTest::GetInstance()->current_test_info();
    folder_ = std::filesystem::path(testing::TempDir()) / ("sherlog_parser_" + std::string(info->name()));
    std::filesystem::create_directories(folder_ / "sub");
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  std::string write(const std::string& name, const std::string& text) {
    const std::string path = (folder_ / name).string();
    std::ofstream(path) << text;
    return path;
  }
  static Parsed parse_file(const std::string& path) {
    Diagnostics diagnostics;
    const auto text = read_text_file(path, diagnostics);
    syntax::Model model;
    if (text) model = parse_syntax(*text, path, diagnostics);
    return {std::move(model), diagnostics.render()};
  }

  std::filesystem::path folder_;
};

TEST_F(IncludeTest, PutsTheStatementsInTheirPlace) {
  write("sub/a.mln", "#include \"b.mln\"\n1 P(x)\n");
  write("sub/b.mln", "P(a)\n");
  const Parsed parsed = parse_file(write("main.mln", "#include \"sub/a.mln\"\n2 P(x)\n"));
  EXPECT_EQ(parsed.messages, "");
  EXPECT_EQ(parsed.model.depth, (std::vector<int>{0, 1, 2, 1, 0}));
  EXPECT_EQ(print(parsed.model), "#include \"sub/a.mln\"\n2 P(x)\n");
  EXPECT_EQ(print(parsed.model, Dialect::kSherlog, true), "P(a)\n1 P(x)\n2 P(x)\n");
}

TEST_F(IncludeTest, OfItselfIsAnErrorWithTheChain) {
  const std::string a = write("a.mln", "#include \"b.mln\"\nP(a)\n");
  const std::string b = write("b.mln", "#include \"./a.mln\"\n");
  const Parsed parsed = parse_file(a);
  EXPECT_NE(parsed.messages.find(b + ":1:1: error: "), std::string::npos) << parsed.messages;
  EXPECT_NE(parsed.messages.find("includes itself [include]"), std::string::npos) << parsed.messages;
  EXPECT_NE(parsed.messages.find(a + ":1:1: note: '" + b + "' is included here"), std::string::npos);
  EXPECT_TRUE(std::holds_alternative<syntax::PredicateDeclaration>(parsed.model.statements.back()));
}

TEST_F(IncludeTest, OfAMissingFileNamesItsPlace) {
  const std::string a = write("a.mln", "P(a)\n#include \"none.mln\"\n");
  EXPECT_TRUE(parse_file(a).messages.starts_with(a + ":2:1: error: '" + (folder_ / "none.mln").string() +
                                                 "' cannot be read: No such file or directory [include]\n"));
}

TEST_F(IncludeTest, OfFilesThatAreNoTextIsRefused) {
  EXPECT_NE(parse_file(folder_.string()).messages.find("is a directory [file]"), std::string::npos);
  EXPECT_NE(parse_file(write("z", std::string("P\0(", 3))).messages.find("byte 2 is zero"), std::string::npos);
  EXPECT_NE(parse_file(write("u", "P(a)\n\xFF")).messages.find("is not UTF-8: byte 0xFF in line 2"), std::string::npos);
  EXPECT_NE(parse_file((folder_ / "none").string()).messages.find("No such file or directory [file]"),
            std::string::npos);
}

}  // namespace
}  // namespace sherlog
