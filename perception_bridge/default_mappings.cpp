// The shipped evidence mappings. Each is the value that `sherlog scenes mapping NAME` prints; to add one: a function here and its
// line in kMappings.
#include <array>
#include <utility>

#include "perception_bridge/evidence_mapping.h"

namespace sherlog {
namespace {

using Words = std::map<std::string, std::string>;

const std::vector<std::string> kAppearance = {"sherlog.annotation.MeanColor", "rs.annotation.ColorHistogram",
                                              "rs.annotation.SemanticColor",  "rs.annotation.Shape",
                                              "rs.annotation.PclFeature",     "rs.annotation.Geometry",
                                              "rs.annotation.PerceptualHash"};

AtomRule rule(const char* annotation, const char* predicate, const char* value) {
  AtomRule result;
  result.annotation = annotation;
  result.predicate = predicate;
  result.value = value;
  return result;
}

// models/identity_resolution/table1.mln
EvidenceMapping identity() {
  EvidenceMapping mapping;
  mapping.name = "identity";
  mapping.pairs = {{"similar", kAppearance, 0.5}, {"proximity", {"rs.annotation.PoseAnnotation"}, 0.5}};
  mapping.out_of_view = "outOfView";
  return mapping;
}

// The same for a camera that measures places to a centimetre: with the paper's 25 cm, what is put down beside the old place of
// something else is at that place. The spreads were learned together with models/identity_resolution/scenes.mln.
EvidenceMapping perception() {
  EvidenceMapping mapping = identity();
  mapping.name = "perception";
  const std::map<std::string_view, double> sigmas = {
      {"rs.annotation.PoseAnnotation", 0.01}, {"sherlog.annotation.MeanColor", 0.021},
      {"rs.annotation.ColorHistogram", 0.10}, {"rs.annotation.SemanticColor", 0.063},
      {"rs.annotation.Shape", 0.28},          {"rs.annotation.PclFeature", 0.31},
      {"rs.annotation.Geometry", 0.88}};
  for (SimilarityRule& rule : mapping.similarity.rules) {
    if (const auto learned = sigmas.find(rule.type); learned != sigmas.end()) rule.sigma = learned->second;
  }
  return mapping;
}

// models/information_fusion: the words of predicates.mln
EvidenceMapping fusion() {
  EvidenceMapping mapping;
  mapping.name = "fusion";
  AtomRule shape = rule("rs.annotation.Shape", "shape", "/shape");
  shape.degree = "confidence";
  shape.threshold = 0.5;
  shape.spelling = Spelling::kCapital;
  shape.values = {{"round", "Round"}, {"flat", "Flat"}, {"box", "Box"}, {"cylinder", "Round"}, {"sphere", "Round"}};
  shape.only_listed = true;
  AtomRule color = rule("rs.annotation.SemanticColor", "color", "/color");
  color.degree = "/ratio";
  color.threshold = 0.2;
  color.spelling = Spelling::kCapital;
  color.values = {{"red", "Red"},     {"yellow", "Yellow"}, {"blue", "Blue"},   {"green", "Green"}, {"white", "White"},
                  {"black", "Black"}, {"cyan", "Blue"},     {"magenta", "Red"}, {"grey", "White"}};
  color.only_listed = true;
  mapping.rules = {shape, color};
  for (const auto& [category, predicate] :
       {std::pair{"Text", "goggles_Text"}, std::pair{"Logo", "goggles_Logo"}, std::pair{"Contact", "goggles_Contact"},
        std::pair{"Image", "goggles"}, std::pair{"Product", "goggles"}}) {
    mapping.rules.push_back(rule("rs.annotation.Goggles", predicate, "/title"));
    mapping.rules.back().where = {{"category", category}};
  }
  AtomRule scene = rule("sherlog.annotation.Context", "scene", "/name");
  scene.of_scene = true;
  scene.spelling = Spelling::kCapital;
  AtomRule label = rule("rs.annotation.GroundTruth", "object", "/classificationGT/classname");
  label.training = true;
  mapping.rules.push_back(scene);
  mapping.rules.push_back(label);
  return mapping;
}

// The atoms of RoboSherlock's MLNInferencer, in lower case: shape(c0,box).
EvidenceMapping robosherlock() {
  EvidenceMapping mapping;
  mapping.name = "robosherlock";
  const auto lower = [](AtomRule entry, const char* degree) {
    entry.spelling = Spelling::kLower;
    entry.degree = degree;
    return entry;
  };
  AtomRule product = rule("rs.annotation.Goggles", "goggles_{category}", "/title");
  AtomRule shape_class = rule("rs.annotation.Classification", "shape", "/classname");
  shape_class.where = {{"classification_type", "SHAPE"}};
  AtomRule object_class = rule("rs.annotation.Classification", "class", "/classname");
  object_class.where = {{"classification_type", "CLASS"}};
  AtomRule instance = rule("rs.annotation.Classification", "instance", "/classname");
  instance.where = {{"classification_type", "INSTANCE"}};
  for (AtomRule* entry : {&shape_class, &object_class, &instance}) entry->degree = "confidence";
  AtomRule detection = rule("rs.annotation.Detection", "detection", "/name");
  detection.degree = "confidence";
  AtomRule label = rule("rs.annotation.GroundTruth", "object", "/classificationGT/classname");
  label.training = true;
  AtomRule scene = lower(rule("sherlog.annotation.Context", "scene", "/name"), "");
  scene.of_scene = true;
  AtomRule color = lower(rule("rs.annotation.SemanticColor", "color", "/color"), "/ratio");
  color.threshold = 0.2;
  mapping.rules = {lower(rule("rs.annotation.Shape", "shape", "/shape"), "confidence"),
                   lower(rule("rs.annotation.SemanticSize", "size", "/size"), "confidence"),
                   color,
                   product,
                   detection,
                   shape_class,
                   object_class,
                   instance,
                   label,
                   scene};
  mapping.old_clusters = {"O", "oldClusters"};
  mapping.new_clusters = {"N", "newClusters"};
  mapping.pairs = {{"looksSimilar", kAppearance, 0.5}, {"samePos", {"rs.annotation.PoseAnnotation"}, 0.5}};
  mapping.out_of_view = "outOfView";
  return mapping;
}

// The same with WordNet's concepts; words that have none there stay as they are.
EvidenceMapping robosherlock_wordnet() {
  EvidenceMapping mapping = robosherlock();
  mapping.name = "robosherlock_wordnet";
  const Words words = {
      {"box", "boxlike.s.01"},     {"round", "round.a.01"},   {"flat", "flat.s.01"},   {"cylinder", "cylindrical.a.01"},
      {"small", "small.a.01"},     {"medium", "medium.a.01"}, {"large", "large.a.01"}, {"red", "red.s.01"},
      {"yellow", "yellow.s.01"},   {"green", "green.s.01"},   {"cyan", "cyan.s.01"},   {"blue", "blue.s.01"},
      {"magenta", "magenta.s.01"}, {"white", "white.a.01"},   {"black", "black.a.01"}, {"grey", "gray.s.01"}};
  for (AtomRule& entry : mapping.rules) {
    const bool grounded = entry.predicate == "shape" || entry.predicate == "size" || entry.predicate == "color";
    if (grounded) entry.values = words;
  }
  return mapping;
}

constexpr std::array<std::pair<std::string_view, EvidenceMapping (*)()>, 5> kMappings = {
    {{"fusion", fusion},
     {"identity", identity},
     {"perception", perception},
     {"robosherlock", robosherlock},
     {"robosherlock_wordnet", robosherlock_wordnet}}};

}  // namespace

std::vector<std::string> shipped_mapping_names() {
  std::vector<std::string> names;
  names.reserve(kMappings.size());
  for (const auto& [name, make] : kMappings) names.emplace_back(name);
  return names;
}

std::optional<EvidenceMapping> shipped_mapping(std::string_view name) {
  for (const auto& [known, make] : kMappings) {
    if (known == name) return make();
  }
  return std::nullopt;
}

}  // namespace sherlog
