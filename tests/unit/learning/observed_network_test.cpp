#include "learning/observed_network.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "learning/training_set.h"
#include "mln/evidence_builder.h"

namespace sherlog {
namespace {

using testing::HasSubstr;
using testing::IsEmpty;
using testing::StartsWith;

constexpr const char* kModel = "k(thing, kind!)\nm(thing, mark?)\nP(thing)\nfree(thing)\n0 k(x, +y) ^ P(x) ^ m(x, z)\n";

TrainingSet set_of(const std::string& model_text, const std::string& data) {
  Diagnostics diagnostics;
  const auto model = parse_model(model_text, "m.mln", diagnostics);
  EXPECT_TRUE(model) << diagnostics.render();
  const auto databases = parse_evidence(*model, data, "t.db", diagnostics);
  EXPECT_TRUE(databases) << diagnostics.render();
  return TrainingSet(*model, *databases);
}

std::string problem_of(const std::string& data) {
  const TrainingSet set = set_of(kModel, data);
  return training_problem(set.model, set.databases, set.mentioned);
}

TEST(TrainingProblem, IsNoneWhereEveryBlockHasItsValue) {
  EXPECT_THAT(problem_of("k(T1,A)\nk(T2,B)\nm(T1,Z)\nP(T2)\n"), IsEmpty());
  EXPECT_THAT(problem_of(""), IsEmpty());
}

TEST(TrainingProblem, NamesTheBlockWithoutAValueAndItsDatabase) {
  EXPECT_EQ(problem_of("k(T1,A)\nP(T2)\n"), "t.db:1: exactly one value of k(T2,?) must be true, and none is stated");
  EXPECT_THAT(problem_of("k(T1,A)\n---\n\nP(T9)\n"),
              StartsWith("database 2 of 2: t.db:4: exactly one value of k(T9,?) must be true"));
  EXPECT_THAT(problem_of("P(T1)\n"), HasSubstr("the database has no true atom of 'k'"));
}

TEST(TrainingProblem, IsAnAtomThatIsNeitherTrueNorFalse) {
  EXPECT_EQ(problem_of("k(T1,A)\n0.5 P(T1)\n"),
            "t.db:2: training data must say whether P(T1) is true or false; it is a degree");
  EXPECT_THAT(problem_of("k(T1,A)\n?P(T1)\n"), HasSubstr("it is unknown"));
  // No formula mentions this one.
  EXPECT_THAT(problem_of("k(T1,A)\n?free(T1)\n0.5 free(T2)\nk(T2,B)\n"), IsEmpty());
}

TEST(TrainingProblem, ComesWithoutAPlaceWhereThereIsNoText) {
  Diagnostics diagnostics;
  const auto model = parse_model("thing = {T}\n" + std::string(kModel), "m.mln", diagnostics);
  ASSERT_TRUE(model);
  const TrainingSet set(*model, std::vector<Evidence>{Evidence(*model)});
  EXPECT_THAT(training_problem(set.model, set.databases, set.mentioned), StartsWith("exactly one value of k(T,?)"));
}

Observation observe_all(const TrainingSet& set) {
  const TrueAtoms truth(set.model, set.databases[0]);
  Monitor monitor;
  return observe(set.model, set.databases[0], truth, std::vector<bool>(set.mentioned.size(), true), {}, set.weights, {},
                 monitor);
}

TEST(ObservedNetwork, ReadsTheWorldOffTheDatabase) {
  const TrainingSet set = set_of(kModel, "k(T1,A)\nk(T2,B)\nm(T1,Z)\nP(T2)\n");
  const Observation observation = observe_all(set);
  ASSERT_TRUE(observation.result) << observation.message;
  const GroundNetwork& network = observation.result->network;
  const TrueAtoms truth(set.model, set.databases[0]);
  std::size_t true_atoms = 0;
  for (std::size_t v = 0; v < network.variable_count(); ++v) {
    for (std::uint32_t value = 0; value < network.candidate_count(VariableId(v)); ++value) {
      const AtomId atom(network.first_atom(VariableId(v)).value + value);
      const bool holds = truth.contains(network.predicate_of(atom), network.arguments_of(atom));
      EXPECT_EQ(observation.result->values[v] == value, holds) << network.atom_text(atom);
      true_atoms += holds;
    }
  }
  EXPECT_EQ(true_atoms, 4u);
  // A weight is there although it is 0, and it is the table's.
  ASSERT_EQ(observation.result->weight_of.size(), network.weights().size());
  for (const std::uint32_t w : observation.result->weight_of) EXPECT_LT(w, set.weights.size());
}

TEST(ObservedNetwork, NamesTheBrokenFormulaAndWhatBreaksIt) {
  const TrainingSet set = set_of(std::string(kModel) + "P(x) ^ k(x, A) => EXIST z (m(x, z)).\n",
                                 "k(T1,A)\nk(T2,A)\nP(T2)\nm(T1,Z)\nP(T1)\n");
  const Observation observation = observe_all(set);
  EXPECT_FALSE(observation.result);
  EXPECT_EQ(observation.termination, Termination::kNoPossibleWorld);
  EXPECT_THAT(observation.message, StartsWith("the training data breaks a hard formula: m.mln:6: P(T2) ^ k(T2,A) =>"));
  EXPECT_THAT(observation.message, HasSubstr("\n  t.db:3: P(T2) is true"));
  EXPECT_THAT(observation.message, HasSubstr("\n  t.db:2: k(T2,A) is true"));
}

TEST(ObservedNetwork, SaysThatAnUnstatedAtomIsFalse) {
  const TrainingSet set = set_of("P(thing)\nR(thing)\n0 P(x)\nP(x) => R(x).\n", "P(T1)\n");
  const Observation observation = observe_all(set);
  EXPECT_THAT(observation.message, HasSubstr("\n  t.db:1: P(T1) is true\n  R(T1) is false"));
}

TEST(TargetWarning, CountsTheDatabasesWithoutATrueAtom) {
  const TrainingSet set = set_of("P(thing)\n0 P(x)\n", "thing={A}\n---\nP(A)\n---\n!P(A)\n");
  EXPECT_EQ(target_warning(set, *set.model.find_predicate("P")),
            "2 of 3 databases state no true atom of 'P' (the first is number 1)");
  EXPECT_EQ(target_warning(set_of("P(thing)\n0 P(x)\n", "P(A)\n"), PredicateId(0)), "");
}

}  // namespace
}  // namespace sherlog
