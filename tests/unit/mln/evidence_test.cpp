// Reading of databases: forms of atoms, constants, separators, and the rules that evidence must keep.
#include "mln/evidence.h"

#include <gtest/gtest.h>

#include <cstdlib>
#include <fstream>
#include <map>
#include <string>

namespace sherlog {
namespace {

const std::string kModel =
    "explanations = {Move, Stay, Not}\n"
    "Smokes(person)\n"
    "Friends(person, person)\n"
    "is(cluster, explanations!)\n"
    "at(person, room?)\n";

Model model_of(const std::string& text) {
  Diagnostics diagnostics;
  std::optional<Model> model = parse_model(text, "m.mln", diagnostics);
  EXPECT_TRUE(model.has_value()) << diagnostics.render();
  return model ? *model : Model();
}

std::vector<Evidence> good(const Model& model, const std::string& text) {
  Diagnostics diagnostics;
  std::optional<std::vector<Evidence>> databases = parse_evidence(model, text, "e.db", diagnostics);
  EXPECT_TRUE(databases.has_value()) << diagnostics.render();
  EXPECT_EQ(diagnostics.render(), "");
  return databases ? *databases : std::vector<Evidence>{Evidence(model)};
}

std::string messages(const std::string& text, const EvidenceOptions& options = {}) {
  Diagnostics diagnostics;
  const std::optional<Model> model = parse_model(kModel, "m.mln", diagnostics);
  if (!model) return diagnostics.render();
  const bool read = parse_evidence(*model, text, "e.db", diagnostics, options).has_value();
  EXPECT_EQ(read, !diagnostics.has_errors());
  return diagnostics.render();
}

bool complains(const std::string& text, const std::string& message) {
  const std::string all = messages(text);
  EXPECT_NE(all.find(message), std::string::npos) << all;
  return all.find(message) != std::string::npos;
}

std::string atoms_of(const Model& model, const Evidence& evidence, const std::string& name) {
  const PredicateId id = *model.find_predicate(name);
  const PredicateEvidence& atoms = evidence.of(id);
  const std::size_t arity = model.predicate(id).arity();
  std::string text;
  for (std::size_t i = 0; i < atoms.size(); ++i) {
    text += "!+?~"[static_cast<std::size_t>(atoms.kinds[i])];
    text += atom_text(model, evidence, id, std::span(atoms.arguments).subspan(i * arity, arity)) + " ";
  }
  return text;
}

TEST(Evidence, AtomsAreTrueFalseUnknownOrSoft) {
  const Model model = model_of(kModel);
  const Evidence evidence = good(model,
                                 "Smokes(Anna)\n!Smokes(Bob) // why\n? Smokes(Carl)\n0.7 Smokes(Dora)\n1 Smokes(E)\n"
                                 "0.0 Smokes(F) /* no */\n  Smokes( Gil )\r\n")[0];
  EXPECT_EQ(atoms_of(model, evidence, "Smokes"),
            "+Smokes(Anna) !Smokes(Bob) ?Smokes(Carl) ~Smokes(Dora) +Smokes(E) !Smokes(F) +Smokes(Gil) ");
  EXPECT_DOUBLE_EQ(evidence.of(*model.find_predicate("Smokes")).degrees[3], 0.7);
  EXPECT_EQ(evidence.of(*model.find_predicate("Smokes")).places[1].line, 2u);
  EXPECT_EQ(evidence.of(*model.find_predicate("Smokes")).places[1].length, 12u);
}

TEST(Evidence, ConstantsAreWhateverStandsBetweenCommasAndBrackets) {
  const Model model = model_of(kModel);
  const Evidence evidence = good(model,
                                 "Friends(Dr. Oetker ,http://x.de/y)\nFriends(\"a,(b)\", \"q\\\"\\\\\")\n"
                                 "Friends(Kellogg's, anna)\nFriends(6\" pipe, \xC3\x84nne)\n")[0];
  const DomainId person = *model.find_domain("person");
  EXPECT_EQ(evidence.added_constants(person),
            (std::vector<std::string>{"Dr. Oetker", "http://x.de/y", "a,(b)", "q\"\\", "Kellogg's", "anna", "6\" pipe",
                                      "\xC3\x84nne"}));
  EXPECT_EQ(atoms_of(model, evidence, "Friends"),
            "+Friends(\"Dr. Oetker\",\"http://x.de/y\") +Friends(\"a,(b)\",\"q\\\"\\\\\") +Friends(Kellogg's,anna) "
            "+Friends(\"6\\\" pipe\",\xC3\x84nne) ");
}

TEST(Evidence, WhatAtomTextWritesReadsBackTheSame) {
  const Model model = model_of(kModel);
  const Evidence first = good(model, "Friends(Dr. Oetker,\"a,b\")\nFriends(-1.5,2x)\nFriends(v,\"\")\n")[0];
  std::string text;
  const PredicateId id = *model.find_predicate("Friends");
  for (std::size_t i = 0; i < first.of(id).size(); ++i) {
    text += atom_text(model, first, id, std::span(first.of(id).arguments).subspan(2 * i, 2)) + "\n";
  }
  EXPECT_EQ(good(model, text)[0].added_constants(*model.find_domain("person")),
            first.added_constants(*model.find_domain("person")));
}

TEST(Evidence, DomainsMayListConstantsOverSeveralLines) {
  const Model model = model_of(kModel);
  const Evidence evidence =
      good(model, "person = {Anna, // first\n  Bob,\n  /* no */ New York\n}\nroom={}\nSmokes(Bob)\n")[0];
  const DomainId person = *model.find_domain("person");
  EXPECT_EQ(evidence.added_constants(person), (std::vector<std::string>{"Anna", "Bob", "New York"}));
  EXPECT_EQ(evidence.find_constant(model, person, "Bob"), 1u);
  EXPECT_EQ(evidence.domain_size(model, person), 3u);
  EXPECT_TRUE(complains("planet = {A}", "no predicate has an argument of domain 'planet' [unknown-domain]"));
  EXPECT_TRUE(complains("person = {A, B\nSmokes(A)", "expected ',' or '}'"));
  EXPECT_TRUE(complains("person = {A,\n", "e.db:1:10: error: brace is never closed"));
}

TEST(Evidence, DashesSeparateDatabasesWithConstantsOfTheirOwn) {
  const Model model = model_of(kModel);
  const std::vector<Evidence> databases =
      good(model, "// top\n---\nSmokes(Anna)\n-----\nSmokes(Bob)\nSmokes(Anna)\n---\n\n");
  ASSERT_EQ(databases.size(), 2u);
  const DomainId person = *model.find_domain("person");
  EXPECT_EQ(databases[0].added_constants(person), std::vector<std::string>{"Anna"});
  EXPECT_EQ(databases[1].added_constants(person), (std::vector<std::string>{"Bob", "Anna"}));
  EXPECT_EQ(databases[1].of(*model.find_predicate("Smokes")).places[0].line, 5u);
}

TEST(Evidence, EmptyTextIsOneEmptyDatabase) {
  const Model model = model_of(kModel);
  EXPECT_EQ(good(model, "").size(), 1u);
  EXPECT_EQ(good(model, "---\n").size(), 1u);
  EXPECT_EQ(good(model, "Smokes(A)\n---\n---\nSmokes(B)").size(), 3u);
  EXPECT_EQ(good(model, "Smokes(A)\n/* \n---\n */\nSmokes(B)").size(), 1u);
}

TEST(Evidence, DuplicatesAreHarmlessAndContradictionsNameBothLines) {
  const Model model = model_of(kModel);
  EXPECT_EQ(
      good(model, "Smokes(A)\nSmokes(A)\n0.3 Smokes(B)\n.3 Smokes(B)")[0].of(*model.find_predicate("Smokes")).size(),
      2u);
  EXPECT_EQ(messages("Smokes(A)\n\n !Smokes(A)\n"),
            "e.db:3:2: error: 'Smokes(A)' is stated false here, but true elsewhere [contradiction]\n"
            "    3 |  !Smokes(A)\n"
            "      |  ^~~~~~~~~~\n"
            "e.db:1:1: note: it is stated true here\n");
  EXPECT_TRUE(complains("0.3 Smokes(A)\nSmokes(A)", "stated true here, but true to degree 0.3 elsewhere"));
  EXPECT_TRUE(complains("?Smokes(A)\nSmokes(A)", "stated true here, but unknown elsewhere"));
}

TEST(Evidence, BlocksHaveAtMostOneTrueValue) {
  EXPECT_EQ(
      messages("is(C1,Move)\nis(C2,Move)\nis(C1,Stay)\n"),
      "e.db:3:1: error: 'is(C1,Stay)' and 'is(C1,Move)' are both stated true, but exactly one of them can be [block]\n"
      "    3 | is(C1,Stay)\n"
      "      | ^~~~~~~~~~~\n"
      "e.db:1:1: note: 'is(C1,Move)' is stated true here\n"
      "m.mln:4:1: note: 'is' is declared here\n");
  EXPECT_TRUE(complains("at(A,R1)\nat(A,R2)", "at most one of them can be"));
}

TEST(Evidence, ABlockNeedsAValueThatIsNotDenied) {
  EXPECT_TRUE(complains("!is(C1,Move)\n!is(C1,Stay)\n!is(C1,Not)\n",
                        "e.db:3:1: error: every value of 'is(C1,_)' is denied, but exactly one must be true [block]"));
  EXPECT_EQ(messages("!is(C1,Move)\n!is(C1,Stay)\n"), "");
  EXPECT_EQ(messages("!at(A,R1)\n"), "");
}

TEST(Evidence, WidenedDomainsAreWarnedAboutOnce) {
  EXPECT_EQ(messages("is(C1,Mov)\nis(C2,Mov)\n---\nis(C1,Mov)\n"),
            "e.db:1:7: warning: 'Mov' is not among the declared constants of domain 'explanations' and is added; did "
            "you mean "
            "'Move'? [widened-domain]\n"
            "    1 | is(C1,Mov)\n"
            "      |       ^~~\n"
            "m.mln:1:1: note: 'explanations' is declared here\n");
}

TEST(Evidence, MistakesAreReportedWhereTheyStand) {
  EXPECT_EQ(
      messages("Smoks(A)\n"),
      "e.db:1:1: error: predicate 'Smoks' is not declared in the model; did you mean 'Smokes'? [unknown-predicate]\n"
      "    1 | Smoks(A)\n"
      "      | ^~~~~\n");
  EXPECT_TRUE(complains("Smokes(A,B)", "e.db:1:1: error: predicate 'Smokes' takes 1 argument, 2 given [arity]"));
  EXPECT_TRUE(complains("Smokes(A).", "e.db:1:10: error: an atom of the evidence does not end in '.'"));
  EXPECT_TRUE(complains("Smokes(A) Smokes(B)", "e.db:1:11: error: expected the end of the line"));
  EXPECT_TRUE(complains("Smokes(A", "e.db:1:7: error: bracket is not closed on its line"));
  EXPECT_TRUE(complains("Smokes()", "takes 1 argument, 0 given"));
  EXPECT_TRUE(complains("Friends(A,)", "e.db:1:11: error: expected a constant"));
  EXPECT_TRUE(complains("Smokes(\"A)", "e.db:1:8: error: quote is not closed on its line"));
  EXPECT_TRUE(complains("Smokes(f(A))", "functions are not supported"));
  EXPECT_TRUE(complains("Smokes Anna", "expected '(' after 'Smokes'"));
  EXPECT_TRUE(complains("Smokes(A)\n/* open\n---\nSmokes(B)", "e.db:2:1: error: comment is never closed"));
  EXPECT_TRUE(complains("((((", "expected an atom"));
}

TEST(Evidence, DegreesLieBetweenZeroAndOne) {
  for (const char* degree : {"1.2", "-0.1", "nan", "inf", "1e999", "+7"}) {
    EXPECT_TRUE(complains(std::string(degree) + " Smokes(A)",
                          std::string("degree '") + degree + "' is not a number from 0 to 1"));
  }
  EXPECT_TRUE(complains("0.7 !Smokes(A)", "write '0.3 P(A)' for '0.7 !P(A)'"));
}

TEST(Evidence, NotesIntoTheModelNeedItsSources) {
  Diagnostics others;
  EXPECT_FALSE(parse_evidence(model_of(kModel), "Smokes(A,B)", "e.db", others));
  EXPECT_TRUE(others.all().at(0).notes.empty());
}

TEST(Evidence, UnknownPredicatesCanBeIgnored) {
  EvidenceOptions options;
  options.ignore_unknown_predicates = true;
  EXPECT_EQ(messages("Likes(A,B)\nplanet = {A}\nSmokes(A)\n", options), "");
}

TEST(Evidence, OnlyTheFirstErrorsAreShownAndAllAreCounted) {
  Diagnostics diagnostics;
  const Model model = model_of(kModel);
  std::string text;
  for (int i = 0; i < 1000; ++i) text += "Likes(A)\n";
  EXPECT_FALSE(parse_evidence(model, text, "e.db", diagnostics));
  EXPECT_EQ(diagnostics.all().size(), Diagnostics::kMaxShown);
  EXPECT_EQ(diagnostics.error_count(), 1000u);
}

class EvidenceFiles : public ::testing::Test {
 protected:
  std::string write(const std::string& name, const std::string& text) {
    const std::string path = ::testing::TempDir() + "sherlog_evidence_" + name;
    std::ofstream(path) << text;
    return path;
  }
};

TEST_F(EvidenceFiles, OneDatabaseEachBecomeOneDatabase) {
  const Model model = model_of(kModel);
  Diagnostics diagnostics;
  const auto databases =
      parse_evidence_files(model, {write("a.db", "Smokes(A)"), write("b.db", "!Smokes(B)")}, diagnostics);
  ASSERT_TRUE(databases) << diagnostics.render();
  ASSERT_EQ(databases->size(), 1u);
  EXPECT_EQ(atoms_of(model, (*databases)[0], "Smokes"), "+Smokes(A) !Smokes(B) ");
}

TEST_F(EvidenceFiles, ASingleDatabaseIsAddedToEveryOneOfAnotherFile) {
  const Model model = model_of(kModel);
  Diagnostics diagnostics;
  const std::string several = write("several.db", "Smokes(A)\n---\nSmokes(B)");
  const std::string single = write("single.db", "Smokes(C)");
  const auto databases = parse_evidence_files(model, {several, single}, diagnostics);
  ASSERT_TRUE(databases) << diagnostics.render();
  ASSERT_EQ(databases->size(), 2u);
  EXPECT_EQ(atoms_of(model, (*databases)[0], "Smokes"), "+Smokes(C) +Smokes(A) ");
  EXPECT_EQ(atoms_of(model, (*databases)[1], "Smokes"), "+Smokes(C) +Smokes(B) ");
  EXPECT_FALSE(parse_evidence_files(model, {several, several}, diagnostics));
  EXPECT_NE(diagnostics.render().find("has several too; one file at most can [databases]"), std::string::npos);
}

TEST_F(EvidenceFiles, MissingFilesAndFoldersAreErrors) {
  const Model model = model_of(kModel);
  Diagnostics diagnostics;
  EXPECT_FALSE(parse_evidence_files(model, {::testing::TempDir() + "sherlog_no_such_file.db"}, diagnostics));
  EXPECT_FALSE(parse_evidence_files(model, {::testing::TempDir()}, diagnostics));
  EXPECT_EQ(diagnostics.error_count(), 2u);
}

std::optional<std::vector<Evidence>> published(const std::string& model_name, const std::string& evidence_name,
                                               Model& model) {
  const std::string folder = std::string(std::getenv("SHERLOG_DATA")) + "/";
  Diagnostics diagnostics;
  std::optional<Model> read = parse_model_file(folder + model_name, diagnostics);
  EXPECT_TRUE(read) << diagnostics.render();
  if (!read) return std::nullopt;
  model = std::move(*read);
  auto databases = parse_evidence_files(model, {folder + evidence_name}, diagnostics);
  EXPECT_TRUE(databases) << diagnostics.render();
  return databases;
}

// Counted in the file: 1401 stated atoms, 53 of which repeat one of their own scene.
TEST(PublishedEvidence, KitchenScenesHoldFiftyDatabases) {
  if (std::getenv("SHERLOG_DATA") == nullptr) GTEST_SKIP() << "SHERLOG_DATA is not set";
  Model model;
  const auto databases = published("kitchen_fusion.mln", "kitchen_scenes.db", model);
  ASSERT_TRUE(databases);
  EXPECT_EQ(databases->size(), 50u);
  std::map<std::string, std::size_t> counts;
  std::size_t total = 0;
  for (const Evidence& evidence : *databases) {
    for (std::size_t i = 0; i < model.predicates().size(); ++i) {
      counts[model.predicates()[i].name] += evidence.of(PredicateId(i)).size();
      total += evidence.of(PredicateId(i)).size();
    }
  }
  EXPECT_EQ(total, 1401u - 53u);
  EXPECT_EQ(counts["object"], 245u);
  EXPECT_EQ(counts["scene"], 50u);
  EXPECT_EQ(counts["goggles_Logo"], 6u);
}

TEST(PublishedEvidence, AllFilesLoad) {
  if (std::getenv("SHERLOG_DATA") == nullptr) GTEST_SKIP() << "SHERLOG_DATA is not set";
  const std::vector<std::pair<std::string, std::string>> pairs = {
      {"kitchen_fusion.mln", "kitchen_test.db"},
      {"bench/rc/rc1000.mln", "bench/rc/rc1000.db"},
      {"bench/rc/rc_soft.mln", "bench/rc/rc_soft.db"},
      {"bench/smokers/smokers.mln", "bench/smokers/smokers_1000.db"},
      {"bench/smokers/smokers_learn.mln", "bench/smokers/smokers_1000_train.db"},
      {"bench/table1/er_cl.mln", "bench/table1/er_20.db"},
      {"bench/table1/er_formula.mln", "bench/table1/er_20_f.db"},
      {"bench/uwcse/uwcse.mln", "bench/uwcse/uwcse.db"},
      {"pracmln/smokers/smoking.mln", "pracmln/smokers/smoking-train.db"},
      {"pracmln/smokers/smoking.mln", "pracmln/smokers/smoking-test.db"},
      {"pracmln/smokers/smoking.mln", "pracmln/smokers/smoking-test-smaller.db"},
      {"pracmln/alarm/alarm-kreator.mln", "pracmln/alarm/query1.db"},
      {"pracmln/alarm/alarm-noisyor.mln", "pracmln/alarm/query1.db"},
      {"pracmln/tweety/tweety-noisyor.mln", "pracmln/tweety/query1.db"},
      {"pracmln/vegetarians/vegetarian-motivation.mln", "pracmln/vegetarians/2-people-2-dishes.db"},
      {"pracmln/vegetarians/vegetarian-motivation.mln", "pracmln/vegetarians/learning.db"},
      {"pracmln/vegetarians/vegetarian-motivation.mln", "pracmln/vegetarians/vegetarian-1-2.db"},
      {"pracmln/vegetarians/vegetarian-motivation.mln", "pracmln/vegetarians/vegetarian-2-2.db"}};
  for (const auto& [model_name, evidence_name] : pairs) {
    Model model;
    EXPECT_TRUE(published(model_name, evidence_name, model)) << evidence_name;
  }
}

TEST(Evidence, ConstantsOfAComparedDomainAreNumbers) {
  const Model model = model_of("Aged(person, age)\n1 Aged(p, x) ^ Aged(q, y) ^ x < y\n");
  EXPECT_EQ(good(model, "Aged(Anna, 7)\nage = {8, 9.5}\n").size(), 1u);
  for (const char* text : {"Aged(Anna, 7)\nAged(Bob, Old)\n", "Aged(Anna, 7)\nage = {8, Old}\n"}) {
    Diagnostics diagnostics;
    EXPECT_FALSE(parse_evidence(model, text, "e.db", diagnostics));
    EXPECT_NE(diagnostics.render().find("e.db:2:"), std::string::npos) << diagnostics.render();
    EXPECT_NE(diagnostics.render().find("'Old' is no number, and formulas compare the constants of domain 'age'"),
              std::string::npos)
        << diagnostics.render();
  }
}

TEST(Evidence, AnAtomHasOneDegree) {
  const Model model = model_of(kModel);
  const std::vector<Evidence> twice = good(model, "0.7 Smokes(Anna)\n0.7 Smokes(Anna)\n");
  EXPECT_EQ(twice.at(0).of(*model.find_predicate("Smokes")).size(), 1u);
  Diagnostics diagnostics;
  EXPECT_FALSE(parse_evidence(model, "0.7 Smokes(Anna)\n0.8 Smokes(Anna)\n", "e.db", diagnostics));
  EXPECT_NE(diagnostics.render().find("to degree 0.7"), std::string::npos) << diagnostics.render();
}

}  // namespace
}  // namespace sherlog
