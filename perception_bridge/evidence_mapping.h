// Which annotation becomes which evidence: a small JSON document that people edit.
//
// Idea      A rule says: of annotations of this type, the text at this field is the value of that predicate; how sure it is; how
//           it is spelled; whether that is a fact or a degree. Rules for pairs say which similarity is which predicate. New
//           annotators and new models need a new document and no program.
//             {"name": "mine", "clusters": {"prefix": "c", "domain": "cluster"},
//              "rules": [{"annotation": "rs.annotation.Shape", "predicate": "shape", "value": "/shape", "degree": "confidence",
//                         "threshold": 0.5, "spelling": "capital"}]}
//           docs/scenes.md lists all keys. `sherlog scenes mapping NAME` prints the shipped ones: fusion, identity, perception,
//           robosherlock, robosherlock_wordnet.
// Source    the atoms of RoboSherlock's MLNInferencer, without its mistakes: clusters are numbered beyond 9, a word that is not
//           known is never an empty constant, a Goggles answer is no evidence of degree 0.
// Errors    a sentence that names the rule and the key; an unknown key is an error, since it is nearly always a typing mistake
#pragma once

#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "perception_bridge/similarity.h"

namespace sherlog {

enum class Spelling : std::uint8_t {
  kAsIs,
  kLower,    // box
  kCapital,  // Box: the first letter; the others stay
};

struct AtomRule {
  std::string annotation;  // the type; those below it count too
  std::string predicate;   // "shape"; "goggles_{category}" takes a field's text, and is "goggles" where there is none
  std::string value;       // pointer to a text or a list of texts: one atom for each
  // Pointer to a number, or "confidence"; empty: 1. Where the annotation has none: missing_degree.
  std::string degree;
  double missing_degree = 1;
  double threshold = 0;   // what is below is left out
  bool soft = false;      // the degree goes into the evidence; else the atom is a fact
  bool of_scene = false;  // predicate(value) from the scene's annotations; else predicate(cluster, value)
  bool training = false;  // labels: only where they are asked for
  Spelling spelling = Spelling::kAsIs;
  std::map<std::string, std::string> where;   // field = text, upper and lower case are one; all have to hold
  std::map<std::string, std::string> values;  // from (in lower case) to; "" leaves it out
  bool only_listed = false;                   // values that are not listed are left out
};

// predicate(old, new) with the similarity of the two by these types as its degree.
struct PairRule {
  std::string predicate;
  std::vector<std::string> types;  // empty: all
  double missing = 0.5;            // nothing to compare: says nothing
};

struct NamedDomain {
  std::string prefix, domain;  // c, cluster: constants c0, c1, ...
};

struct EvidenceMapping {
  std::string name;
  NamedDomain clusters{"c", "cluster"};
  NamedDomain old_clusters{"O", "oldCluster"}, new_clusters{"N", "newCluster"};
  std::vector<AtomRule> rules;
  std::vector<PairRule> pairs;
  std::string out_of_view;  // predicate(old); empty: none
  SimilarityConfig similarity = default_similarity();
};

std::optional<EvidenceMapping> mapping_from_json(const Value& document, std::string& problem);
Value mapping_to_json(const EvidenceMapping& mapping);

std::vector<std::string> shipped_mapping_names();
// Nothing where there is none of that name.
std::optional<EvidenceMapping> shipped_mapping(std::string_view name);

}  // namespace sherlog
