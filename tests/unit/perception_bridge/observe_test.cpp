#include "perception_bridge/observe.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <random>

#include "mln/parser.h"
#include "perception_bridge/kitchen_scenes.h"
#include "perception_bridge/view.h"

namespace sherlog {
namespace {

using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

Value json(const std::string& text) {
  std::string problem;
  const auto value = parse_json(text, problem);
  EXPECT_TRUE(value) << problem;
  return value.value_or(Value());
}

Cluster cluster_of(const std::string& text) {
  SceneMessages messages;
  const auto cluster = designator_from_json(json(text), messages);
  EXPECT_TRUE(cluster) << messages.errors.front();
  return cluster.value_or(Cluster{});
}

Cluster at(double x, double y, const std::string& frame = "map", const std::string& more = "") {
  return cluster_of(R"({"id":"c","rs.annotation.LocationAnnotation":[{"position":[)" + std::to_string(x) + "," +
                    std::to_string(y) + R"(],"frame":")" + frame + "\"}]" + more + "}");
}

// --- kernels and distances ---

TEST(Similarity, KernelsHaveTheValuesOfTheCorrectedEquations) {
  using enum SimilarityKernel;
  EXPECT_EQ(kernel_value(kGaussian, 0, 0.25), 1);
  EXPECT_NEAR(kernel_value(kGaussian, 0.25, 0.25), 0.7788, 5e-5);          // exp(-1/4)
  EXPECT_NEAR(kernel_value(kTextbookGaussian, 0.25, 0.25), 0.6065, 5e-5);  // exp(-1/2)
  EXPECT_EQ(kernel_value(kLogistic, 0, 1), 1);
  EXPECT_NEAR(kernel_value(kLogistic, 1, 1), .537883, 5e-7);
  EXPECT_NEAR(kernel_value(kLogistic, 2, 1), .238406, 5e-7);
  EXPECT_NEAR(kernel_value(kLogistic, 4, 1), .035972, 5e-7);
  // Linear at first: the second difference at 0 vanishes with the step.
  const double h = 1e-3;
  EXPECT_NEAR(kernel_value(kLogistic, 2 * h, 1) - 2 * kernel_value(kLogistic, h, 1) + 1, 0, 1e-8);
  for (const auto kernel : {kGaussian, kTextbookGaussian, kLogistic}) {
    EXPECT_EQ(kernel_value(kernel, std::numeric_limits<double>::infinity(), 0.3), 0);
    for (double d = 0; d < 3; d += 0.1) EXPECT_GT(kernel_value(kernel, d, 0.3), kernel_value(kernel, d + 0.1, 0.3));
  }
}

TEST(Similarity, IsSymmetricAndOneForTheSame) {
  for (std::uint64_t number = 0; number < 5; ++number) {
    const Scene scene = kitchen_scene(default_kitchen(), 8, number);
    for (const Cluster& a : scene.clusters) {
      EXPECT_NEAR(*similarity_between(default_similarity(), a, a).value, 1, 1e-7);
      for (const Cluster& b : scene.clusters) {
        const auto forth = similarity_between(default_similarity(), a, b),
                   back = similarity_between(default_similarity(), b, a);
        EXPECT_EQ(*forth.value, *back.value);
        EXPECT_GE(*forth.value, 0);
        EXPECT_LE(*forth.value, 1);
      }
    }
  }
}

TEST(Similarity, OnlySharedTypesCountAndAZeroDecides) {
  const Cluster here = at(0, 0, "map", R"(,"sherlog.annotation.MeanColor":[{"color":[1,0,0]}])");
  const Cluster there = at(0, 0.25, "map", R"(,"rs.annotation.Shape":[{"shape":"box"}])");
  const auto similarity = similarity_between(default_similarity(), here, there);
  ASSERT_EQ(similarity.parts.size(), 1u);
  EXPECT_NEAR(*similarity.value, std::exp(-0.25), 1e-12);
  EXPECT_EQ(similarity_between(default_similarity(), here, cluster_of(R"({"id":"x"})")).value, std::nullopt);
  const Cluster elsewhere = at(0, 0, "fridge", R"(,"sherlog.annotation.MeanColor":[{"color":[1,0,0]}])");
  EXPECT_EQ(*similarity_between(default_similarity(), here, elsewhere).value, 0) << "other frames are infinitely far";
  EXPECT_EQ(*similarity_between(default_similarity(), here, elsewhere, {"MeanColor"}).value, 1);
}

TEST(Similarity, DistancesAreWhatTheyAreSaidToBe) {
  const auto distance = [](DistanceKind kind, const char* field, const std::string& a, const std::string& b) {
    const SimilarityRule rule{"my.annotation.T", kind, field, "/w", SimilarityKernel::kGaussian, 1};
    return distance_between(rule, cluster_of(R"({"id":"a","my.annotation.T":[)" + a + "]}"),
                            cluster_of(R"({"id":"b","my.annotation.T":[)" + b + "]}"));
  };
  using enum DistanceKind;
  EXPECT_DOUBLE_EQ(*distance(kEuclidean, "/v", R"({"v":[0,3]})", R"({"v":[4,0]})"), 5);
  EXPECT_DOUBLE_EQ(*distance(kEuclidean, "/v", R"({"v":[0,3]},{"v":[4,1]})", R"({"v":[4,0]})"), 1) << "the nearest two";
  EXPECT_EQ(distance(kEuclidean, "/v", R"({"v":[0,3]})", R"({"v":[4]})"), std::nullopt);
  EXPECT_DOUBLE_EQ(*distance(kHistogram, "/v", R"({"v":[1,0]})", R"({"v":[0,7]})"), 1);
  EXPECT_NEAR(*distance(kHistogram, "/v", R"({"v":[1,3]})", R"({"v":[2,6]})"), 0, 1e-7);
  EXPECT_DOUBLE_EQ(*distance(kHamming, "/v", R"({"v":"f0"})", R"({"v":"00"})"), 0.5);
  EXPECT_EQ(distance(kHamming, "/v", R"({"v":"f0"})", R"({"v":"xy"})"), std::nullopt);
  EXPECT_DOUBLE_EQ(*distance(kSize, "/v", R"({"v":[1,2,3]})", R"({"v":[3,2,1]})"), 0);
  EXPECT_DOUBLE_EQ(*distance(kSize, "/v", R"({"v":[1]})", R"({"v":[2]})"), std::log(2));
  // red .75 and blue .25 against red: half of .25 + .25
  EXPECT_DOUBLE_EQ(
      *distance(kCategories, "/v", R"({"v":"red","w":0.6},{"v":"blue","w":0.2})", R"({"v":"red","w":0.9})"), 0.25);
}

TEST(Similarity, LearnsTheSigmaThatMadeTheLabels) {
  SimilarityConfig config{{default_similarity().rules[0]}};
  // Labels drawn with the probability that the kernel with sigma 0.4 gives.
  std::mt19937_64 random(5);
  std::uniform_real_distribution<double> uniform(0, 1);
  std::vector<LabelledPair> pairs;
  for (int i = 0; i < 4000; ++i) {
    const double distance = 2 * uniform(random);
    pairs.push_back({{distance}, uniform(random) < kernel_value(SimilarityKernel::kGaussian, distance, 0.4)});
  }
  const SigmaLearning learned = learn_sigmas(config, pairs);
  EXPECT_EQ(learned.problem, "");
  EXPECT_NEAR(learned.config.rules[0].sigma, 0.4, 0.03);
  EXPECT_GT(learned.after, learned.before);
  EXPECT_THAT(learned.pair_counts, ElementsAre(4000u));
}

TEST(Similarity, RefusesDistancesThatAreNone) {
  const SimilarityConfig config{{default_similarity().rules[0]}};
  EXPECT_THAT(learn_sigmas(config, {{{-1.0}, true}, {{1.0}, false}}).problem, HasSubstr("pair 0: the distance -1"));
  EXPECT_THAT(learn_sigmas(config, {{{1.0}, true}, {{std::nan("")}, false}}).problem, HasSubstr("pair 1"));
  EXPECT_THAT(learn_sigmas(config, {{{1.0}, true}}).problem, HasSubstr("pairs of one thing and pairs of two"));
  EXPECT_THAT(learn_sigmas(config, {}).problem, HasSubstr("pairs of one thing"));
  EXPECT_THAT(learn_sigmas(config, {{{}, true}}).problem, HasSubstr("0 distances"));
  SimilarityConfig bad = config;
  bad.rules[0].sigma = 0;
  EXPECT_THAT(validate(bad), HasSubstr("sigma 0 is not a positive number"));
}

TEST(Similarity, ItsConfigurationRoundTrips) {
  std::string problem;
  const Value document = similarity_to_json(default_similarity());
  const auto again = similarity_from_json(document, problem);
  ASSERT_TRUE(again) << problem;
  EXPECT_EQ(similarity_to_json(*again), document);
  for (const auto& [text, message] :
       {std::pair{R"({"rules":[{"type":"T","distance":"euclidean","field":"/x","sigma":-1}]})", "sigma -1"},
        std::pair{R"({"rules":[{"type":"T","distance":"manhattan"}]})", "none of position"},
        std::pair{R"({"rules":[{"type":"T","distance":"euclidean"}]})", "no 'field'"},
        std::pair{R"({"rules":[{"type":"Shape","distance":"categories","field":"/shape","weight":7}]})", "'weight'"},
        std::pair{R"({"rules":[{"type":"Shape","distance":"categories","field":["/shape"]}]})", "'field'"},
        std::pair{R"({"rules":[{"type":"rs.annotation.Shap","distance":"categories","field":"/shape"}]})",
                  "did you mean 'rs.annotation.Shape'?"},
        std::pair{R"({"rules":[{"type":"Shape","distance":"categories","field":"/shape"},
                      {"type":"rs.annotation.Shape","distance":"categories","field":"/shape"}]})",
                  "two similarity rules"},
        std::pair{R"({"rules":[],"rule":[]})", "no 'rule'"}, std::pair{R"({"rules":[{"typ":"T"}]})", "no 'typ'"},
        std::pair{R"({})", "'rules'"}}) {
    EXPECT_FALSE(similarity_from_json(json(text), problem));
    EXPECT_THAT(problem, HasSubstr(message));
  }
}

// --- views ---

// The same question by another way: the eight corners' planes, for a camera that is only turned about the vertical.
TEST(View, AFrustumAgreesWithPlaneGeometry) {
  std::mt19937_64 random(11);
  std::uniform_real_distribution<double> uniform(-1, 1);
  const double pi = std::acos(-1.0);
  int inside = 0;
  for (int i = 0; i < 10'000; ++i) {
    const double heading = pi * uniform(random), half_width = 0.3 + 0.2 * uniform(random),
                 half_height = 0.3 + 0.2 * uniform(random);
    ViewFrustum view;
    view.frame = "map";
    view.translation = {uniform(random), uniform(random), uniform(random)};
    // Optical axes to the world: z forward along the heading, x to the right, y down.
    const double fx = std::cos(heading), fy = std::sin(heading);
    // The quaternion of the matrix with columns right = (fy, -fx, 0), down = (0, 0, -1), forward = (fx, fy, 0).
    const double c = std::cos(heading / 2 - pi / 4), s = std::sin(heading / 2 - pi / 4), r = std::sqrt(0.5);
    view.rotation = {-r * c, -r * s, r * s, r * c};
    view.horizontal_angle = 2 * half_width;
    view.vertical_angle = 2 * half_height;
    view.near = 0.2;
    view.far = 1.5;
    const ScenePosition point{{2 * uniform(random), 2 * uniform(random), 2 * uniform(random)}, "map"};
    const double dx = point.coordinates[0] - view.translation[0], dy = point.coordinates[1] - view.translation[1],
                 dz = point.coordinates[2] - view.translation[2];
    const double forward = dx * fx + dy * fy, right = dx * fy - dy * fx;
    const bool expected = forward >= 0.2 && forward <= 1.5 && std::abs(right) <= forward * std::tan(half_width) &&
                          std::abs(dz) <= forward * std::tan(half_height);
    EXPECT_EQ(sees(view, point), expected);
    inside += expected ? 1 : 0;
  }
  EXPECT_GT(inside, 50);
}

TEST(View, OtherFramesAreOutOfViewAndNoViewSeesEverything) {
  const ViewBox box{"table1", {0, 0}, {1, 1}};
  EXPECT_TRUE(sees(box, {{0.5, 1, 7}, "table1"}));
  EXPECT_FALSE(sees(box, {{0.5, 1.01}, "table1"}));
  EXPECT_FALSE(sees(box, {{0.5, 0.5}, "table2"}));
  EXPECT_TRUE(sees(SceneView{}, {{0.5, 0.5}, "table2"}));
  EXPECT_FALSE(sees(SceneView{{}, {box}}, {{0.5, 0.5}, "table2"}));
}

Cluster thing_at(const std::string& id, const Eigen::Vector3d& middle, const Eigen::Vector3d& size,
                 double heading = 0) {
  return cluster_of(fmt::format(
      R"({{"id": "{}", "rs.annotation.Geometry": [{{"size": [{}, {}, {}]}}],
          "rs.annotation.PoseAnnotation": [{{"world": {{"rs.tf.StampedPose": {{"frame": "map",
              "rotation": [0, 0, {}, {}], "translation": [{}, {}, {}]}}}}}}]}})",
      id, size[0], size[1], size[2], std::sin(heading / 2), std::cos(heading / 2), middle[0], middle[1], middle[2]));
}

// A camera at the origin that looks along y (right is x, down is -z), with a half angle of 0.6.
ViewFrustum camera_along_y() {
  ViewFrustum frustum;
  frustum.frame = "map";
  frustum.rotation = {-std::sqrt(0.5), 0, 0, std::sqrt(0.5)};
  frustum.horizontal_angle = frustum.vertical_angle = 1.2;
  return frustum;
}

TEST(View, WhatIsWhollyBehindAThingIsOutOfView) {
  const Cluster cup = thing_at("cup", {0, 2, 0}, {0.08, 0.08, 0.1});
  const auto sees_cup = [&](std::vector<Cluster> things) {
    SceneView view{{camera_along_y()}, {}};
    for (const Cluster& thing : things) view.things.push_back(*box_of(thing));
    return sees_thing(view, cup);
  };
  const Cluster carton = thing_at("carton", {0, 1, 0}, {0.3, 0.1, 0.3}, 0.2);
  EXPECT_TRUE(sees_cup({}));
  EXPECT_FALSE(sees_cup({carton}));
  EXPECT_TRUE(sees_cup({thing_at("behind", {0, 3, 0}, {0.9, 0.1, 0.9})}));
  EXPECT_TRUE(sees_cup({thing_at("beside", {0.2, 1, 0}, {0.3, 0.1, 0.3})})) << "half of the cup looks out";
  EXPECT_TRUE(sees_cup({thing_at("low", {0, 1, -0.15}, {0.3, 0.1, 0.3})})) << "its top looks out";
  EXPECT_FALSE(
      sees_cup({thing_at("left", {-0.15, 1, 0}, {0.32, 0.1, 0.3}), thing_at("right", {0.15, 1, 0}, {0.32, 0.1, 0.3})}));
  EXPECT_TRUE(sees_cup({thing_at("in its place", {0, 1.98, 0}, {0.2, 0.2, 0.2})})) << "its place is seen";
  EXPECT_TRUE(sees_cup({carton, cup})) << "something is seen in its place";
}

// The oracle looks along many rays and asks each whether it meets the box nearer than the thing.
TEST(View, CoveringAgreesWithRays) {
  std::mt19937_64 random(5);
  std::uniform_real_distribution<double> uniform(-1, 1);
  int covered = 0, clear = 0;
  for (int i = 0; i < 3000; ++i) {
    const Eigen::Vector3d at(0.3 * uniform(random), 1.2 + 0.2 * uniform(random), 0.3 * uniform(random));
    const Eigen::Vector3d size(0.2 + 0.15 * uniform(random), 0.2 + 0.15 * uniform(random),
                               0.2 + 0.15 * uniform(random));
    const double heading = 1.5 * uniform(random);
    const Eigen::Vector3d middle(0.3 * uniform(random), 2 + 0.2 * uniform(random), 0.3 * uniform(random));
    const Cluster thing = thing_at("thing", middle, {0.1, 0.1, 0.1});
    SceneView view{{camera_along_y()}, {}};
    view.things.push_back(*box_of(thing_at("box", at, size, heading)));
    // How much of the thing, a little larger or smaller than it is, is behind a box that is a little smaller or larger.
    const auto hidden = [&](double grow_thing, double grow_box) {
      const auto back = Eigen::AngleAxisd(-heading, Eigen::Vector3d::UnitZ()) * Eigen::Translation3d(-at);
      int all = 0, behind = 0;
      for (int k = 0; k < 27; ++k) {
        const Eigen::Vector3d unit((k % 3) / 2.0 - 0.5, (k / 3 % 3) / 2.0 - 0.5, (k / 9) / 2.0 - 0.5);
        const Eigen::Vector3d point = middle + grow_thing * 0.1 * unit;
        bool meets = false;
        for (int step = 0; step <= 800 && !meets; ++step) {
          const Eigen::Vector3d on_ray = back * (point * (step / 800.0));
          meets = ((on_ray.cwiseAbs() - size / 2).array() <= grow_box).all();
        }
        ++all;
        behind += meets ? 1 : 0;
      }
      return static_cast<double>(behind) / all;
    };
    if (!sees_thing(view, thing)) {
      ++covered;
      if (covered > 30) continue;
      EXPECT_EQ(hidden(0.75, 0.001), 1) << i;
    } else if (++clear <= 30) {
      EXPECT_LT(hidden(0.85, -0.012), 1) << i;
    }
  }
  EXPECT_GT(covered, 100);
  EXPECT_GT(clear, 100);
}

TEST(View, AThingBehindAnotherIsHiddenAndNotGone) {
  Scene scene;
  scene.id = "s";
  const double turn = std::sqrt(0.5);
  scene.annotations = cluster_of(fmt::format(R"({{"id": "c", "sherlog.annotation.ViewFrustum": [{{"frame": "map",
      "translation": [0, 0, 0], "rotation": [{}, 0, 0, {}], "horizontal_angle": 1.2, "vertical_angle": 1.2}}]}})",
                                             -turn, turn))
                          .annotations;
  scene.clusters = {thing_at("carton", {0, 1, 0}, {0.3, 0.1, 0.3})};
  const std::vector<Cluster> olds = {thing_at("cup", {0, 2, 0}, {0.08, 0.08, 0.1}),
                                     thing_at("milk", {0.6, 2, 0}, {0.08, 0.08, 0.1})};
  EXPECT_THAT(evidence_text(observe_change(*shipped_mapping("identity"), olds, scene)),
              AllOf(HasSubstr("outOfView(O0)"), Not(HasSubstr("outOfView(O1)"))));
}

// --- evidence ---

Scene fusion_scene() {
  SceneMessages messages;
  const auto scene = scene_from_json(json(R"json({"id":"s","timestamp":1,
      "sherlog.annotation.Context":[{"name":"breakfast"}],
      "identifiables":[{"id":"a",
        "rs.annotation.Shape":[{"shape":"box","confidence":0.889},{"shape":"flat","confidence":0.3},{"shape":"torus"}],
        "rs.annotation.SemanticColor":[{"color":"red","ratio":0.6},{"color":"black","ratio":0.1}],
        "rs.annotation.SemanticSize":[{"size":"Large","confidence":0.5}],
        "rs.annotation.Goggles":[{"category":"Logo","title":"Dr Oetker"},{"title":"Kellogg's zoo (500 g)"}],
        "rs.annotation.Classification":[{"classname":"Milk","classification_type":"INSTANCE","confidence":0.7}],
        "rs.annotation.GroundTruth":[{"classificationGT":{"classname":"Vitalis_Cereals"}}]},
      {"id":"b"}]})json"),
                                     messages);
  EXPECT_TRUE(scene) << messages.errors.front();
  return scene.value_or(Scene{});
}

TEST(Observe, TheFusionMappingWritesTheWordsOfTheModel) {
  const SceneObservation observation = observe(*shipped_mapping("fusion"), fusion_scene());
  EXPECT_EQ(evidence_text(observation),
            "cluster = {c0, c1}\nshape(c0,Box)\ncolor(c0,Red)\ngoggles_Logo(c0,\"Dr Oetker\")\nscene(Breakfast)\n");
  EXPECT_THAT(observation.notes, ElementsAre(HasSubstr("'torus'")));
  EXPECT_THAT(evidence_text(observe(*shipped_mapping("fusion"), fusion_scene(), {.labels = true, .fuzzy = {}})),
              HasSubstr("object(c0,Vitalis_Cereals)"));
}

TEST(Observe, TheRoboSherlockMappingWritesItsAtoms) {
  const EvidenceMapping mapping = *shipped_mapping("robosherlock");
  const std::string hard = evidence_text(observe(mapping, fusion_scene()));
  for (const char* atom :
       {"shape(c0,box)\n", "shape(c0,flat)\n", "size(c0,large)\n", "color(c0,red)\n", "instance(c0,Milk)\n",
        "goggles_Logo(c0,\"Dr Oetker\")\n", "goggles(c0,\"Kellogg's zoo (500 g)\")\n", "scene(breakfast)\n"}) {
    EXPECT_THAT(hard, HasSubstr(atom));
  }
  const SceneObservation fuzzy = observe(mapping, fusion_scene(), {.labels = false, .fuzzy = true});
  EXPECT_THAT(evidence_text(fuzzy), HasSubstr("0.889 shape(c0,box)\n"));
  EXPECT_THAT(evidence_text(fuzzy), HasSubstr("0.6 color(c0,red)\n"));
  EXPECT_EQ(mln_atoms(fuzzy, "c1").fields[0].second.list()->size(), 0u);
  EXPECT_EQ(*mln_atoms(fuzzy, "c0").fields[0].second.list()->front().text(), "0.889 shape(c0,box)");
  EXPECT_THAT(evidence_text(observe(*shipped_mapping("robosherlock_wordnet"), fusion_scene())),
              HasSubstr("shape(c0,boxlike.s.01)"));
}

TEST(Observe, MoreThanTenClustersKeepTheirNumbers) {
  Scene scene = fusion_scene();
  while (scene.clusters.size() < 13) scene.clusters.push_back(scene.clusters.front());
  EXPECT_THAT(evidence_text(observe(*shipped_mapping("fusion"), scene)), HasSubstr("shape(c12,Box)"));
}

TEST(Observe, GeneratedScenesAreGoodEvidenceForTheFusionModel) {
  Diagnostics diagnostics;
  const auto model = parse_model_files({SHERLOG_SOURCE_DIR "/models/information_fusion/fusion.mln"}, diagnostics);
  ASSERT_TRUE(model) << diagnostics.render();
  for (std::uint64_t number = 0; number < 30; ++number) {
    const Scene scene = kitchen_scene(default_kitchen(), 2, number);
    const auto evidence =
        to_evidence(observe(*shipped_mapping("fusion"), scene, {.labels = true, .fuzzy = {}}), *model, diagnostics);
    ASSERT_TRUE(evidence) << diagnostics.render();
  }
  EXPECT_EQ(diagnostics.warning_count(), 0u) << diagnostics.render();
}

TEST(Observe, PairsAndViewBecomeTheEvidenceOfTheIdentityModel) {
  Scene now;
  now.id = "now";
  now.clusters = {at(0, 0, "map", R"(,"sherlog.annotation.MeanColor":[{"color":[1,0,0]}])"),
                  cluster_of(R"({"id":"n"})")};
  Annotation view;
  view.type = "sherlog.annotation.ViewBox";
  view.frame = "map";
  view.fields = {{"min", number_list({-1, -1})}, {"max", number_list({1, 1})}};
  now.annotations = {view};
  const std::vector<Cluster> old = {at(0, 0.25, "map", R"(,"sherlog.annotation.MeanColor":[{"color":[1,0,0]}])"),
                                    at(0, 3)};
  const SceneObservation observation = observe_change(*shipped_mapping("identity"), old, now);
  EXPECT_EQ(evidence_text(observation),
            "oldCluster = {O0, O1}\nnewCluster = {N0, N1}\n"
            "0.999999999 similar(O0,N0)\n0.5 similar(O0,N1)\n0.5 similar(O1,N0)\n0.5 similar(O1,N1)\n"
            "0.778800783 proximity(O0,N0)\n0.5 proximity(O0,N1)\n1e-09 proximity(O1,N0)\n0.5 proximity(O1,N1)\n"
            "outOfView(O1)\n");  // exp(-(3 / 0.5)^2) is below the least degree
  Diagnostics diagnostics;
  const auto model = parse_model_files({SHERLOG_SOURCE_DIR "/models/identity_resolution/table1.mln"}, diagnostics);
  ASSERT_TRUE(model);
  EXPECT_TRUE(to_evidence(observation, *model, diagnostics)) << diagnostics.render();
  const std::string other = evidence_text(observe_change(*shipped_mapping("robosherlock"), old, now));
  EXPECT_THAT(other, HasSubstr("oldClusters = {O0, O1}"));
  EXPECT_THAT(other, HasSubstr("looksSimilar(O0,N0)"));
  EXPECT_THAT(other, HasSubstr("samePos(O0,N0)"));
}

TEST(Observe, EmptyScenesAreNoEvidence) {
  Scene empty;
  empty.id = "s";
  EXPECT_EQ(evidence_text(observe(*shipped_mapping("fusion"), empty)), "");
  EXPECT_EQ(evidence_text(observe_change(*shipped_mapping("identity"), {}, empty)), "");
}

TEST(EvidenceMapping, ShippedOnesRoundTrip) {
  for (const std::string& name : shipped_mapping_names()) {
    const EvidenceMapping mapping = *shipped_mapping(name);
    EXPECT_EQ(mapping.name, name);
    std::string problem;
    const auto again = mapping_from_json(mapping_to_json(mapping), problem);
    ASSERT_TRUE(again) << problem;
    EXPECT_EQ(mapping_to_json(*again), mapping_to_json(mapping));
    EXPECT_EQ(evidence_text(observe(*again, fusion_scene())), evidence_text(observe(mapping, fusion_scene())));
  }
  EXPECT_EQ(shipped_mapping("nonsense"), std::nullopt);
}

TEST(EvidenceMapping, MistakesAreNamedWithTheirRule) {
  std::string problem;
  for (const auto& [text, message] :
       {std::pair{R"([])", "not an object"}, std::pair{R"({})", "no 'name'"},
        std::pair{R"({"name":"m","rulez":[]})", "did you mean 'rules'?"},
        std::pair{R"({"name":"m","rules":[{"annotation":"T","predicate":"p"}]})", "rule 1 has no 'value'"},
        std::pair{R"({"name":"m","rules":[{"annotation":"T","predicate":"p","value":"/v","threshold":2}]})",
                  "'threshold'"},
        std::pair{R"({"name":"m","rules":[{"annotation":"T","predicate":"p","value":"/v","spelling":"UPPER"}]})",
                  "none of as_is"},
        std::pair{R"({"name":"m","rules":[{"annotation":"T","predicate":"p","value":"/v","fuzzy":true}]})", "'fuzzy'"},
        std::pair{R"({"name":"m","similarity":{"rules":[{"type":"T","distance":"x"}]}})", "similarity"},
        std::pair{R"({"name":"m","schema":"sherlog.mapping/9"})", "sherlog.mapping/9"}}) {
    EXPECT_FALSE(mapping_from_json(json(text), problem)) << text;
    EXPECT_THAT(problem, HasSubstr(message)) << text;
  }
}

TEST(EvidenceMapping, MistypedNamesAreFound) {
  std::string problem;
  const std::string good_rule = R"("predicate":"p","value":"/v"})";
  for (const auto& [text, message] :
       {std::pair{R"({"name":"m","rules":[{"annotation":"rs.annotation.Shap",)" + good_rule + "]}",
                  "did you mean 'rs.annotation.Shape'?"},
        std::pair{R"({"name":"m","rules":[{"annotation":"sherlog.annotation.Weight",)" + good_rule + "]}",
                  "no annotation type 'sherlog.annotation.Weight'"},
        std::pair{R"({"name":"m","rules":[{"annotation":"Shap",)" + good_rule + "]}", "did you mean 'Shape'?"},
        std::pair{std::string(R"({"name":"m","rules":[{"annotation":"Shape","predicate":"sha pe(","value":"/v"}]})"),
                  "'sha pe('"},
        std::pair{std::string(R"({"name":"m","rules":[{"annotation":"Shape","predicate":"a_{b","value":"/v"}]})"),
                  "'a_{b'"},
        std::pair{std::string(R"({"name":"m","pairs":[{"predicate":"1","types":[]}]})"), "no name"},
        std::pair{std::string(R"({"name":"m","pairs":[{"predicate":"p","types":["rs.annotation.Shap"]}]})"), "Shape"},
        std::pair{std::string(R"({"name":"m","out_of_view":"not in view"})"), "no name"},
        std::pair{std::string(R"({"name":"m","clusters":{"prefix":"c ","domain":"cluster"}})"), "no name"}}) {
    EXPECT_FALSE(mapping_from_json(json(text), problem)) << text;
    EXPECT_THAT(problem, HasSubstr(message)) << text;
  }
  for (const char* type : {"my.annotation.Weight", "Shape", "GogglesAnnotation", "rs.annotation.Shape"}) {
    const std::string text = std::string(R"({"name":"m","rules":[{"annotation":")") + type +
                             R"(","predicate":"goggles_{category}","value":"/v"}]})";
    EXPECT_TRUE(mapping_from_json(json(text), problem)) << problem;
  }
}

TEST(EvidenceMapping, ValuesAreMappedWhateverTheirCase) {
  const std::string rule =
      R"({"name":"m","rules":[{"annotation":"Shape","predicate":"shape","value":"/shape","values":)";
  std::string problem;
  const auto mapping = mapping_from_json(json(rule + R"({"Box":"BOX"}}]})"), problem);
  ASSERT_TRUE(mapping) << problem;
  EXPECT_THAT(evidence_text(observe(*mapping, fusion_scene())), HasSubstr("BOX)"));
  EXPECT_FALSE(mapping_from_json(json(rule + R"({"Box":"BOX","box":"b"}}]})"), problem));
  EXPECT_THAT(problem, HasSubstr("'box' twice"));
}

TEST(EvidenceMapping, AProductOfTheImageSearchIsOneForFusion) {
  SceneMessages messages;
  const auto scene = scene_from_json(json(R"({"id":"s","timestamp":1,"identifiables":[{"id":"c","rs.annotation.Goggles":
      [{"category":"Product","title":"Heinz Tomato Ketchup"}]}]})"),
                                     messages);
  ASSERT_TRUE(scene);
  EXPECT_THAT(evidence_text(observe(*shipped_mapping("fusion"), *scene)),
              HasSubstr("goggles(c0,\"Heinz Tomato Ketchup\")"));
}

}  // namespace
}  // namespace sherlog
