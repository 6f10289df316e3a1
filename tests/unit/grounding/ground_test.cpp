#include "grounding/ground.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "mln/query.h"

namespace sherlog {
namespace {

struct Setting {
  std::vector<std::string> queries;
  std::vector<std::string> open_world = {};
  GroundingOptions options = {};
};

struct Grounded {
  std::optional<Model> model;
  std::optional<Evidence> evidence;
  GroundingResult result;

  const GroundNetwork& network() const { return *result.network; }
  // Everything in the network, a line each, sorted: what is asked, weighed and demanded.
  std::vector<std::string> lines() const {
    std::vector<std::string> text;
    const GroundNetwork& n = network();
    for (const Feature& f : n.features()) text.push_back(fmt::format("{:g} {}", f.weight, n.literal_text(f.literal)));
    for (const Constraint& c : n.constraints()) text.push_back(n.literal_text(c.literal) + ".");
    std::ranges::sort(text);
    return text;
  }
  std::vector<std::string> asked() const {
    std::vector<std::string> text;
    for (const QueryTarget& q : network().queries()) {
      text.push_back(q.is_formula ? q.formula_text + " = " + network().literal_text(q.literal)
                                  : network().literal_text(q.literal));
    }
    return text;
  }
  std::vector<std::string> conflict() const {
    std::vector<std::string> text;
    for (const Conflict::Item& item : result.conflict->items) {
      const Sources& sources = item.is_formula ? *result.conflict->model_sources : *result.conflict->evidence_sources;
      text.push_back(item.text + (item.place.line > 0
                                      ? fmt::format(" @ {}:{}", sources.name(item.place.file), item.place.line)
                                      : ""));
    }
    std::ranges::sort(text);
    return text;
  }
};

class Interrupting : public Monitor {
 public:
  bool interrupted() const override { return true; }
};

Grounded ground_text(const std::string& model_text, const std::string& evidence_text, const Setting& setting,
                     Monitor* monitor = nullptr) {
  Diagnostics diagnostics;
  Grounded grounded;
  grounded.model = parse_model(model_text, "m.mln", diagnostics);
  if (grounded.model) {
    auto databases = parse_evidence(*grounded.model, evidence_text, "e.db", diagnostics);
    if (databases) grounded.evidence = databases->front();
  }
  std::optional<Query> query;
  if (grounded.evidence) query = parse_query(*grounded.model, *grounded.evidence, setting.queries, diagnostics);
  EXPECT_TRUE(query) << diagnostics.render();
  if (!query) return grounded;
  GroundingOptions options = setting.options;
  for (const std::string& name : setting.open_world)
    options.open_world.push_back(*grounded.model->find_predicate(name));
  Monitor silent;
  grounded.result =
      ground(*grounded.model, *grounded.evidence, *query, options, monitor != nullptr ? *monitor : silent);
  return grounded;
}

using Lines = std::vector<std::string>;
const double kLog2 = std::log(2.0);

// --- formulas --------------------------------------------------------------------------------------------------------

TEST(Grounding, KeepsOnlyWhatEvidenceLeavesUndecided) {
  const auto g = ground_text(
      "Friends(person, person)\nSmokes(person)\nCancer(person)\n"
      "1.5 Smokes(x) => Cancer(x)\n1.1 Friends(x, y) => (Smokes(x) <=> Smokes(y))\n",
      "Friends(Anna, Bob)\nSmokes(Bob)\n", {{"Smokes", "Cancer"}});
  EXPECT_EQ(g.lines(), (Lines{"1.1 Smokes(Anna)", "1.5 !Smokes(Anna) v Cancer(Anna)", "1.5 Cancer(Bob)"}));
  EXPECT_EQ(g.asked(), (Lines{"Smokes(Anna)", "Cancer(Anna)", "Cancer(Bob)"}));
  // Of the four pairs only (Anna, Bob) are friends: three ground formulas are true whatever happens.
  EXPECT_DOUBLE_EQ(g.network().constant_score(), 3 * 1.1);
  EXPECT_DOUBLE_EQ(g.network().grounding_count(), 2 + 4);
  EXPECT_EQ(g.network().evidence_atom_count(), 2u);
}

TEST(Grounding, WeighsAConjunctionAsAWhole) {
  const auto g = ground_text("P(d)\nQ(d)\n2 P(x) ^ Q(x)\n", "Q(A)\n!Q(B)\nd = {A, B, C}\n", {{"P"}, {"Q"}});
  // A: Q is known, so P alone; B: false; C: P ^ Q, the negation of a disjunction, so its weight is turned.
  EXPECT_EQ(g.lines(), (Lines{"-2 !P(C) v !Q(C)", "2 P(A)"}));
  EXPECT_DOUBLE_EQ(g.network().constant_score(), 2);
}

TEST(Grounding, SaysByTheBlockWhatHoldsOfAllItsValuesButSome) {
  const std::string declared = "e = {move, stay, not, gone}\nis(old, e!)\nP(old)\nmay(old, e?)\n";
  const auto lines = [&](const std::string& rule) {
    return ground_text(declared + rule, "old = {A, B}\n", {{"is", "P", "may"}}).lines();
  };
  EXPECT_EQ(lines("is(A, e1) ^ e1 != not => P(A).\n"), (Lines{"is(A,not) v P(A)."}));
  EXPECT_EQ(lines("is(A, e1) ^ e1 != not ^ not != e1 ^ e1 != gone => P(A).\n"),
            (Lines{"is(A,not) v is(A,gone) v P(A)."}));
  EXPECT_EQ(lines("is(x, e1) ^ is(y, e2) ^ e1 != not ^ e2 != not => x = y.\n"), (Lines{"is(A,not) v is(B,not)."}));
  // As many as there are values: the variable stands in another place as well, the block may be empty, a soft formula is
  // counted.
  EXPECT_EQ(lines("is(A, e1) ^ is(B, e1) ^ e1 != not ^ e1 != gone => P(A).\n"),
            (Lines{"!is(A,move) v !is(B,move) v P(A).", "!is(A,stay) v !is(B,stay) v P(A)."}));
  EXPECT_EQ(lines("may(A, e1) ^ e1 != not ^ e1 != gone => P(A).\n"),
            (Lines{"P(A) v !may(A,move).", "P(A) v !may(A,stay)."}));
  EXPECT_EQ(lines("2 is(A, e1) ^ e1 != not ^ e1 != gone => P(A)\n"),
            (Lines{"2 !is(A,move) v P(A)", "2 !is(A,stay) v P(A)"}));
}

TEST(Grounding, SplitsAHardConjunction) {
  const auto g = ground_text("P(d)\nQ(d)\nP(x) ^ (P(y) => Q(y)).\n", "d = {A}\n", {{"P", "Q"}});
  EXPECT_EQ(g.lines(), (Lines{"!P(A) v Q(A).", "P(A)."}));
}

TEST(Grounding, MergesSymmetricGroundFormulas) {
  const auto g = ground_text("P(d)\n1 P(x) v P(y)\n", "d = {A, B}\n", {{"P"}});
  EXPECT_EQ(g.lines(), (Lines{"1 P(A)", "1 P(B)", "2 P(A) v P(B)"}));
}

TEST(Grounding, MakesEqualitiesAndComparisonsConstant) {
  const auto g = ground_text("P(d)\n1 P(x) ^ P(y) ^ x != y ^ x < y\n3 P(x) => x = 2\n", "d = {1, 2, 10}\n", {{"P"}});
  EXPECT_EQ(g.lines(), (Lines{"-1 !P(1) v !P(10)", "-1 !P(2) v !P(1)", "-1 !P(2) v !P(10)", "-3 P(1)", "-3 P(10)"}));
  // Six orders of two, three of them rising; x = 2 holds for one of three, the other two are turned.
  EXPECT_DOUBLE_EQ(g.network().constant_score(), 3 * 1 + 3 * 3);
}

TEST(Grounding, ExpandsQuantifiersOverTheirDomain) {
  const auto g = ground_text("P(d)\nR(d, e)\n1 P(x) => EXIST y (R(x, y))\n2 FORALL x (P(x))\n",
                             "d = {A, B}\nR(A, C)\ne = {C, D}\n", {{"P"}});
  // R is closed: A has a C, so its implication holds; B has none.
  EXPECT_EQ(g.lines(), (Lines{"-1 P(B)", "-2 !P(A) v !P(B)"}));
}

TEST(Grounding, TakesExistsOverAnEmptyDomainAsFalse) {
  const auto g = ground_text("P(d)\nR(d, e)\n1 EXIST y (R(x, y)) v P(x)\n4 FORALL y (R(x, y))\n8 R(x, y)\n",
                             "d = {A}\n", {{"P", "R"}});
  EXPECT_EQ(g.lines(), (Lines{"1 P(A)"}));
  EXPECT_DOUBLE_EQ(g.network().constant_score(), 4);
}

// 40 x 40 pairs, of which each side holds for three: only those, and what is asked, are looked at.
TEST(Grounding, VisitsAnEquivalenceWhereOneOfItsImplicationsMayFail) {
  std::string evidence = "P(A1,A2)\nP(A1,A3)\nP(A4,A5)\nQ(A1,A2)\nQ(A6,A7)\nQ(A8,A8)\n";
  for (int i = 1; i <= 40; ++i) evidence += fmt::format("Named(A{})\n", i);
  const std::string predicates = "P(t, t)\nQ(t, t)\nNamed(t)\nR(t, t)\n";
  const Grounded soft = ground_text(predicates + "0.5 P(x, y) <=> Q(x, y)\n", evidence, {{"R(A1,A1)"}});
  EXPECT_LT(soft.result.formulas[0].joined, 10u);
  EXPECT_NEAR(soft.network().constant_score(), 0.5 * (1600 - 4), 1e-9);
  const Grounded denied = ground_text(predicates + "0.5 !(P(x, y) <=> !Q(x, y))\n", evidence, {{"R(A1,A1)"}});
  EXPECT_NEAR(denied.network().constant_score(), 0.5 * (1600 - 4), 1e-9);
  // An open side: where the other one is true, and where it may be true itself.
  const Grounded open = ground_text(predicates + "0.5 P(x, y) <=> (R(x, y) ^ x = A1)\n", evidence, {{"R(A1,?y)"}});
  EXPECT_EQ(open.network().features().size(), 40u);
  // 38 denied ones of R are worth a constant, P(A4,A5) alone is wrong for certain.
  EXPECT_NEAR(open.network().constant_score(), 0.5 * (1600 - 1 - 40 + 38), 1e-9);
  const Grounded hard = ground_text(predicates + "P(x, y) <=> Q(x, y).\n", evidence, {{"R(A1,A1)"}});
  EXPECT_EQ(hard.result.termination, Termination::kNoPossibleWorld);
}

TEST(Grounding, IsTheSameWithHashTables) {
  const std::string model =
      "Friends(p, p)\nSmokes(p)\n1 Friends(x, y) ^ Smokes(x) => Smokes(y)\n2 Friends(x, y) <=> Friends(y, x)\n";
  const std::string evidence = "Friends(A, B)\nFriends(B, C)\n0.7 Friends(A, C)\nSmokes(A)\n";
  GroundingOptions sparse;
  sparse.dense_atoms = 0;
  const auto dense = ground_text(model, evidence, {{"Smokes"}});
  const auto hashed = ground_text(model, evidence, {{"Smokes"}, {}, sparse});
  EXPECT_EQ(dense.lines(), hashed.lines());
  EXPECT_DOUBLE_EQ(dense.network().constant_score(), hashed.network().constant_score());
}

// Table 1 of the identity model with 15 old and 15 new clusters: the counts follow from the sizes of the domains.
TEST(Grounding, CountsTableOne) {
  std::string clusters = "oldCluster = {O0";
  for (int i = 1; i < 15; ++i) clusters += fmt::format(", O{}", i);
  clusters += "}\nnewCluster = {N0";
  for (int i = 1; i < 15; ++i) clusters += fmt::format(", N{}", i);
  const std::string some = "(EXIST n (is(o,n,Stay) v is(o,n,Move) v is(o,n,Newview)))";
  GroundingOptions all_open;
  all_open.open_world_all = true;
  const auto g = ground_text(
      "explanations = {Move, Stay, Newview, Not}\nsimilar(oldCluster,newCluster)\nproximity(oldCluster,newCluster)\n"
      "outOfView(oldCluster)\nis(oldCluster,newCluster,explanations!)\ndisappear(oldCluster)\nappear(newCluster)"
      "\nhidden(oldCluster)\n"
      "(is(a,c,e1) ^ is(b,c,e2) ^ !(e1=Not) ^ !(e2=Not)) => a=b.\n"
      "(is(c,a,e1) ^ is(c,b,e2) ^ !(e1=Not) ^ !(e2=Not)) => a=b.\n"
      "is(o,n,Stay) <=> (similar(o,n) ^ proximity(o,n)).\nis(o,n,Move) <=> (similar(o,n) ^ !proximity(o,n)).\n"
      "is(o,n,Newview) <=> (!similar(o,n) ^ proximity(o,n)).\n"
      "outOfView(o) => (!(EXIST m (is(o,m,Stay) v is(o,m,Newview))) ^ (is(o,n,Not) v is(o,n,Move))).\n"
      "appear(n) <=> !(EXIST o (is(o,n,Stay) v is(o,n,Move) v is(o,n,Newview))).\n"
      "disappear(o) <=> (!" +
          some + " ^ !outOfView(o)).\nhidden(o) <=> (!" + some + " ^ outOfView(o)).\n",
      clusters + "}\n", {{"is", "appear", "disappear", "hidden", "similar", "proximity", "outOfView"}, {}, all_open});
  ASSERT_TRUE(g.result.network) << g.result.message;
  EXPECT_EQ(g.network().atom_count(), 900u + 2 * 225 + 4 * 15);  // 1410
  EXPECT_EQ(g.network().variable_count(), 225u + 2 * 225 + 4 * 15);
  EXPECT_DOUBLE_EQ(g.network().grounding_count(), 2 * 54000 + 3 * 225 + 225 + 15 + 2 * 15);  // 108 945
  // a != b: 15 * 14 * 15 in both orders, of which each says the same: one of them is visited. The blocks say at once what
  // holds of the 3 * 3 explanations that are not Not.
  EXPECT_EQ(g.result.formulas[0].joined, 3150u / 2);
  EXPECT_EQ(g.result.formulas[0].features, 1575u);
}

// --- open and closed -------------------------------------------------------------------------------------------------

TEST(OpenWorld, ClosesWhatIsNeitherAskedNorNamed) {
  const std::string model = "P(d)\nQ(d)\n*R(d)\n1 P(x) v Q(x) v R(x)\n", evidence = "d = {A}\n";
  EXPECT_EQ(ground_text(model, evidence, {{"P"}}).lines(), (Lines{"1 P(A)"}));
  EXPECT_EQ(ground_text(model, evidence, {{"P"}, {"Q"}}).lines(), (Lines{"1 P(A) v Q(A)"}));
  Setting all{{"P"}};
  all.options.open_world_all = true;
  EXPECT_EQ(ground_text(model, evidence, all).lines(), (Lines{"1 P(A) v Q(A)"}));  // *R stays closed
  EXPECT_EQ(ground_text(model, evidence, {{"P"}, {"R"}}).lines(), (Lines{"1 P(A) v R(A)"}));
  EXPECT_EQ(ground_text(model, evidence, {{"P", "R"}}).lines(), (Lines{"1 P(A) v R(A)"}));
}

TEST(OpenWorld, OpensThePredicatesOfAQueriedFormula) {
  const auto g = ground_text("P(d)\nQ(d)\n1 P(x) v Q(x)\n", "d = {A}\n", {{"P(A) ^ Q(A)"}});
  EXPECT_EQ(g.lines(), (Lines{"1 P(A) v Q(A)"}));
}

TEST(OpenWorld, KeepsStatedUnknownAtomsOfAClosedPredicateOpen) {
  const auto g = ground_text("P(d)\nQ(d)\n1 P(x) ^ Q(x)\n", "d = {A, B}\n?Q(A)\n", {{"P"}});
  EXPECT_EQ(g.lines(), (Lines{"-1 !P(A) v !Q(A)"}));
}

TEST(OpenWorld, CountsUnmentionedAtomsWithoutListingThem) {
  std::string evidence = "d = {C0";
  for (int i = 1; i < 3000; ++i) evidence += fmt::format(", C{}", i);
  const auto g =
      ground_text("P(d, d)\nQ(d)\nB(d, e!)\ne = {X, Y, Z}\n1 Q(x)\n", evidence + "}\nP(C0, C0)\n", {{"Q(C0)"}, {"P"}});
  EXPECT_EQ(g.network().atom_count(), 3000u);  // Q
  EXPECT_NEAR(g.network().free_log_count(), (9e6 - 1) * kLog2 + 3000 * std::log(3.0), 1e-6);
}

// --- blocks ----------------------------------------------------------------------------------------------------------

const std::string kBlocks =
    "shape = {Box, Flat, Round}\nobject(cluster, shape!)\nlabel(cluster, shape?)\n1 object(c, Box)\n2 label(c, Box)\n";

TEST(Blocks, AStatedValueDecidesItsSiblings) {
  const auto g = ground_text(kBlocks, "object(A, Box)\nlabel(A, Flat)\n", {{"object", "label"}});
  EXPECT_EQ(g.network().atom_count(), 0u);
  EXPECT_TRUE(g.asked().empty());
  EXPECT_DOUBLE_EQ(g.network().constant_score(), 1);
  EXPECT_DOUBLE_EQ(g.network().free_log_count(), 0);
}

TEST(Blocks, TheOnlyValueLeftIsTrue) {
  const auto g = ground_text(kBlocks, "!object(A, Flat)\n!object(A, Round)\n", {{"object"}});
  EXPECT_EQ(g.network().atom_count(), 0u);
  EXPECT_DOUBLE_EQ(g.network().constant_score(), 1);
}

TEST(Blocks, DeniedValuesAreNoCandidates) {
  const auto g = ground_text(kBlocks, "!object(A, Flat)\n!label(A, Flat)\n", {{"object", "label"}});
  EXPECT_EQ(g.asked(), (Lines{"object(A,Box)", "object(A,Round)", "label(A,Box)", "label(A,Round)"}));
  ASSERT_EQ(g.network().variable_count(), 2u);
  EXPECT_FALSE(g.network().has_none(VariableId(0)));
  EXPECT_TRUE(g.network().has_none(VariableId(1)));
}

TEST(Blocks, ExactlyOneStaysOpenWhereClosedAndAtMostOneDoesNot) {
  const auto g = ground_text(kBlocks + "P(cluster)\n", "cluster = {A}\n", {{"P"}});
  EXPECT_EQ(g.lines(), (Lines{"1 object(A,Box)"}));  // label(A, Box) is false
  EXPECT_EQ(g.network().candidate_count(g.network().variable_of(AtomId(1))), 3u);
}

TEST(Blocks, TwoMarkedArgumentsFormOneBlock) {
  const auto g = ground_text("at(row!, column!, time)\n1 at(r, c, t)\n",
                             "row = {R1, R2}\ncolumn = {C1, C2}\ntime = {T1, T2}\n", {{"at"}});
  EXPECT_EQ(g.network().variable_count(), 2u);
  EXPECT_EQ(g.network().candidate_count(VariableId(0)), 4u);
}

TEST(Blocks, TheFirstArgumentMayBeMarked) {
  const auto g = ground_text("state = {On, Off}\nis(state!, time)\n1 is(On, t)\n", "time = {T1}\n", {{"is"}});
  EXPECT_EQ(g.asked(), (Lines{"is(On,T1)", "is(Off,T1)"}));
  EXPECT_EQ(g.network().variable_count(), 1u);
}

// --- soft evidence ---------------------------------------------------------------------------------------------------

TEST(SoftEvidence, WeighsTrueWorldsByPAndFalseOnesByTheRest) {
  const auto g = ground_text("P(d)\nQ(d)\n1 P(x) => Q(x)\n", "0.7 P(A)\n", {{"Q"}});
  ASSERT_EQ(g.network().features().size(), 2u);
  const Feature& f = g.network().features()[1];
  EXPECT_EQ(f.weight_id, kVirtualEvidence);
  EXPECT_NEAR(f.weight, std::log(0.7 / 0.3), 1e-12);
  EXPECT_NEAR(g.network().constant_score(), std::log(0.3), 1e-12);
}

TEST(SoftEvidence, OnADecidedAtomIsAConstant) {
  const auto g = ground_text("shape = {Box, Flat}\nobject(cluster, shape!)\nP(cluster)\n1 P(c)\n",
                             "object(A, Box)\n0.2 object(A, Flat)\n", {{"P"}});
  EXPECT_NEAR(g.network().constant_score(), std::log(0.8), 1e-12);
}

TEST(SoftEvidence, IsATargetUnderJeffrey) {
  Setting jeffrey{{"Q"}};
  jeffrey.options.soft_evidence = SoftEvidence::kJeffrey;
  const auto g = ground_text("P(d)\nQ(d)\n1 P(x) => Q(x)\n", "0.7 P(A)\n", jeffrey);
  ASSERT_EQ(g.network().soft_targets().size(), 1u);
  EXPECT_EQ(g.network().atom_text(g.network().soft_targets()[0].atom), "P(A)");
  const auto decided = ground_text("shape = {Box, Flat}\nobject(cluster, shape!)\nQ(d)\n1 Q(c)\n",
                                   "object(A, Box)\n0.2 object(A, Flat)\n", jeffrey);
  EXPECT_EQ(decided.result.termination, Termination::kNoPossibleWorld);
  EXPECT_EQ(decided.conflict(), (Lines{"0.2 object(A,Flat) @ e.db:2", "object(A,Box) @ e.db:1"}));
}

// --- queries ---------------------------------------------------------------------------------------------------------

TEST(Queries, ListAtomsInOrderAndOnce) {
  const std::string model = "R(d, d)\n1 R(x, y)\n", evidence = "d = {A, B}\nR(A, A)\n";
  EXPECT_EQ(ground_text(model, evidence, {{"R"}}).asked(), (Lines{"R(A,B)", "R(B,A)", "R(B,B)"}));
  EXPECT_EQ(ground_text(model, evidence, {{"R(?x,?x)", "R"}}).asked(), (Lines{"R(B,B)", "R(A,B)", "R(B,A)"}));
  EXPECT_EQ(ground_text(model, evidence, {{"R(B,?x)", "R(B,A)"}}).asked(), (Lines{"R(B,A)", "R(B,B)"}));
}

TEST(Queries, FormulasMayBeConstant) {
  const auto g =
      ground_text("P(d)\n1 P(x)\n", "d = {A, B}\nP(A)\n", {{"P(A) v P(B)", "P(A) ^ P(B)", "EXIST x (!P(x))"}});
  EXPECT_EQ(g.asked(), (Lines{"P(A) v P(B) = true", "P(A) ^ P(B) = P(B)", "EXIST x (!P(x)) = !P(B)"}));
}

// --- templates -------------------------------------------------------------------------------------------------------

TEST(Templates, HaveAWeightForEachConstantThatIsMet) {
  const auto g = ground_text("color(c, col)\nobject(c, o!)\no = {Cup, Pot}\n2 color(x, +k) ^ object(x, +t)\n",
                             "color(A, Red)\ncol = {Red, Blue}\n", {{"object"}});
  EXPECT_EQ(g.lines(), (Lines{"2 object(A,Cup)", "2 object(A,Pot)"}));
  ASSERT_EQ(g.network().weights().size(), 2u);  // Blue is met nowhere
  EXPECT_EQ(g.network().weights()[1].plus_constants, (std::vector<ConstantIndex>{0, 1}));
}

TEST(Templates, KeepWeightsOfZeroForLearning) {
  Setting learning{{"object"}};
  learning.options.keep_zero_weights = true;
  const auto g = ground_text("color(c, col)\nobject(c, o!)\no = {Cup, Pot}\n0 color(x, +k) ^ object(x, +t)\n",
                             "color(A, Red)\ncol = {Red, Blue}\n", learning);
  EXPECT_EQ(g.network().weights().size(), 2u);
  EXPECT_EQ(g.network().features().size(), 2u);
}

TEST(Templates, UniqueTakesEachCombinationOnce) {
  Setting learning{{"object"}};
  learning.options.keep_zero_weights = true;
  const auto g = ground_text(
      "object(c, o!)\no = {Cup, Pot, Pan}\n#unique{+?a, +?b}\n0 object(?x, +?a) ^ object(?y, +?b) ^ ?x != ?y\n",
      "c = {C1, C2}\n", learning);
  EXPECT_EQ(g.network().weights().size(), 3u);  // 3 over 2
  EXPECT_DOUBLE_EQ(g.network().grounding_count(), 3 * 2 * 2);
  EXPECT_EQ(g.network().features().size(), 3u * 2u);
}

// --- no possible world, limits ---------------------------------------------------------------------------------------

TEST(Conflicts, NameTheGroundFormulaAndTheEvidenceThatSuffices) {
  const auto g = ground_text("P(d)\nQ(d)\nR(d)\nP(x) ^ R(x) => Q(x).\n", "P(A)\nR(A)\n!R(B)\nP(B)\n", {{"R"}});
  EXPECT_EQ(g.result.termination, Termination::kNoPossibleWorld);
  EXPECT_FALSE(g.result.network);
  EXPECT_EQ(g.conflict(), (Lines{"P(A) @ e.db:1", "P(A) ^ R(A) => Q(A) @ m.mln:4", "Q(A) is not stated and Q is closed",
                                 "R(A) @ e.db:2"}));
}

TEST(Conflicts, LeaveOutEvidenceThatIsNotNeeded) {
  const auto g = ground_text("P(d)\nQ(d)\n!(P(x) ^ P(y) ^ (Q(x) v Q(y))).\n", "P(A)\nQ(A)\n", {{"Q"}});
  EXPECT_EQ(g.conflict(), (Lines{"!(P(A) ^ P(A) ^ (Q(A) v Q(A))) @ m.mln:3", "P(A) @ e.db:1", "Q(A) @ e.db:2"}));
}

TEST(Conflicts, NameTheSiblingThatDecides) {
  const auto g =
      ground_text("shape = {Box, Flat}\nobject(cluster, shape!)\nobject(c, Flat).\n", "object(A, Box)\n", {{"object"}});
  EXPECT_EQ(g.conflict(), (Lines{"object(A,Box) @ e.db:1", "object(A,Flat) @ m.mln:3"}));
}

TEST(Conflicts, AreFoundByPropagationThroughSeveralFormulas) {
  const auto g = ground_text("P(d)\nQ(d)\nR(d, d)\nR(x, y) ^ P(x) => P(y).\nP(x) => !Q(x).\nP(x) v Q(x).\n",
                             "R(A, B)\nR(B, C)\nR(D, E)\nP(A)\nQ(C)\n", {{"P", "Q"}});
  EXPECT_EQ(g.result.termination, Termination::kNoPossibleWorld);
  EXPECT_EQ(g.conflict(),
            (Lines{"P(A) @ e.db:4", "P(C) => !Q(C) @ m.mln:5", "Q(C) @ e.db:5", "R(A,B) @ e.db:1",
                   "R(A,B) ^ P(A) => P(B) @ m.mln:4", "R(B,C) @ e.db:2", "R(B,C) ^ P(B) => P(C) @ m.mln:4"}));
}

TEST(Conflicts, PropagateThroughBlocks) {
  const auto g = ground_text(
      "s = {Box, Flat, Tall}\nobject(c, s!)\nP(c)\n!object(x, Box).\n!object(x, Flat).\nP(x) => !object(x, "
      "Tall).\nP(x).\n",
      "c = {A}\n", {{"object", "P"}});
  EXPECT_EQ(g.conflict(), (Lines{"!object(A,Box) @ m.mln:4", "!object(A,Flat) @ m.mln:5",
                                 "P(A) => !object(A,Tall) @ m.mln:6", "P(A) @ m.mln:7"}));
}

const char* kOneToOne =
    "e = {move, stay, not}\nis(old, new, e!)\n(is(a, c, e1) ^ is(b, c, e2) ^ e1 != not ^ e2 != not) => a = b.\n";

TEST(Conflicts, NameTheValuesThatTheEvidenceStatesOfBlocks) {
  const auto g = ground_text(kOneToOne, "is(A, N, stay)\nis(B, N, move)\n", {{"is"}});
  EXPECT_EQ(g.conflict(), (Lines{"is(A,N,stay) @ e.db:1",
                                 "is(A,N,stay) ^ is(B,N,move) ^ stay != not ^ move != not => A = B @ m.mln:3",
                                 "is(B,N,move) @ e.db:2"}));
}

TEST(Conflicts, LeaveTheValueOpenWhereTheEvidenceDoes) {
  const auto g = ground_text(kOneToOne, "!is(A, N, not)\nis(B, N, move)\n", {{"is"}});
  EXPECT_EQ(g.result.termination, Termination::kNoPossibleWorld);
  EXPECT_EQ(g.conflict(),
            (Lines{"!is(A,N,not) @ e.db:1", "is(A,N,e1) ^ is(B,N,e2) ^ e1 != not ^ e2 != not => A = B @ m.mln:3",
                   "is(B,N,move) @ e.db:2"}));
}

TEST(Conflicts, AnExactlyOneBlockNeedsAConstant) {
  const auto g = ground_text("object(cluster, shape!)\nP(cluster)\n1 P(c)\n", "P(A)\n", {{"object"}});
  EXPECT_EQ(g.result.termination, Termination::kNoPossibleWorld);
  EXPECT_EQ(g.result.conflict->sentence,
            "'object' needs exactly one value from 'shape', and that domain has no constants");
}

TEST(Limits, RefuseBeforeTheMemoryIsGone) {
  std::string evidence = "d = {C0";
  for (int i = 1; i < 2000; ++i) evidence += fmt::format(", C{}", i);
  Setting small{{"P"}};
  small.options.max_memory = 100'000'000;
  const auto g = ground_text("P(d)\n1 P(x) ^ P(y) => P(z)\n", evidence + "}\n", small);
  EXPECT_EQ(g.result.termination, Termination::kMemoryLimit);
  EXPECT_FALSE(g.result.network);
  EXPECT_NE(g.result.message.find("m.mln:2"), std::string::npos) << g.result.message;
  EXPECT_NE(g.result.message.find("8e+09"), std::string::npos) << g.result.message;
}

TEST(Limits, StopWhenTimeIsUpOrTheUserSaysSo) {
  const std::string model = "P(d)\n1 P(x) ^ P(y) => P(z)\n";
  std::string evidence = "d = {C0";
  for (int i = 1; i < 200; ++i) evidence += fmt::format(", C{}", i);
  evidence += "}\n";
  Setting hurried{{"P"}};
  hurried.options.max_seconds = 0;
  EXPECT_EQ(ground_text(model, evidence, hurried).result.termination, Termination::kTimeLimit);
  Interrupting interrupting;
  EXPECT_EQ(ground_text(model, evidence, {{"P"}}, &interrupting).result.termination, Termination::kInterrupted);
}

}  // namespace
}  // namespace sherlog
