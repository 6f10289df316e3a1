// How alike two clusters are: a distance for each annotation type, made a similarity in [0, 1], and their geometric mean.
//
// Idea      Only types that both sides have are compared; each has its distance, its kernel and its sigma, the spread that its
//           annotator's noise has. The geometric mean makes one plain contradiction (similarity 0) decide.
//             gaussian            g(d) = exp(-(d / 2 sigma)^2): as printed. d is the difference of two measurements, each with
//                                 deviation sigma, so its variance is 2 sigma^2 and this is just the Gaussian of it.
//             textbook_gaussian   exp(-d^2 / (2 sigma^2))
//             logistic            l(d) = 2 - 2 / (1 + exp(-d / sigma)): 1 at 0, linear at first, 0 far away. The printed form is
//                                 infinite at 0; these are its operators in the order that has the properties it is said to have.
// Source    Beetz et al., RoboSherlock, ICRA 2015, Eqs. 1 and 2
// Learning  sigma by maximum likelihood from pairs that are known to be the same thing or two: the combined similarity is the
//           probability of "the same". Coordinate ascent in log sigma, one golden-section search a type; the likelihood need not
//           have one maximum, so each search starts from a grid.
// Errors    a distance that is negative or not a number, a sigma that is not positive: named, nothing is computed
#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "perception_bridge/scene.h"

namespace sherlog {

enum class SimilarityKernel : std::uint8_t { kGaussian, kTextbookGaussian, kLogistic };

// Requires  distance >= 0 (infinity too), sigma > 0.
double kernel_value(SimilarityKernel kernel, double distance, double sigma);

enum class DistanceKind : std::uint8_t {
  kPosition,    // metres between the clusters' positions; without end where their frames differ
  kEuclidean,   // of two lists of numbers
  kHistogram,   // Hellinger's, of two lists of counts: in [0, 1]
  kHamming,     // share of different bits of two hexadecimal texts: in [0, 1]
  kCategories,  // half of the summed differences between the weights of names: in [0, 1]
  kSize,        // Euclidean, between the logarithms of sorted edges
};

struct SimilarityRule {
  std::string type;  // of the annotation
  DistanceKind distance = DistanceKind::kEuclidean;
  std::string field;   // a pointer into the annotation: "/color"; kPosition needs none
  std::string weight;  // kCategories: a pointer to the weight of a name; else its confidence, else 1
  SimilarityKernel kernel = SimilarityKernel::kGaussian;
  double sigma = 0.25;
};

struct SimilarityConfig {
  std::vector<SimilarityRule> rules;
};

// The types that RoboSherlock's annotators fill; sigma 0.25 for places and colours, as the paper has it, and guesses of ours
// elsewhere.
SimilarityConfig default_similarity();

// A type that nothing can have, as people who edit a document mistype it: one of ours or of RoboSherlock's that there is not, or
// one without a dot. Somebody's own types are fine. "" or a sentence.
std::string mistyped_annotation_type(std::string_view type);

std::optional<SimilarityConfig> similarity_from_json(const Value& document, std::string& problem);
Value similarity_to_json(const SimilarityConfig& config);
std::string validate(const SimilarityConfig& config);

// Nothing where one side has no such annotation, or not of a comparable shape. Of several annotations of a type the nearest
// two count, except for categories, which are compared as sets.
std::optional<double> distance_between(const SimilarityRule& rule, const Cluster& a, const Cluster& b);

struct Similarity {
  struct Part {
    std::string type;
    double distance = 0, similarity = 0;
  };
  std::optional<double> value;  // nothing where no type is on both sides
  std::vector<Part> parts;
};

// `types` empty: by all rules.
Similarity similarity_between(const SimilarityConfig& config, const Cluster& a, const Cluster& b,
                              const std::vector<std::string>& types = {});

// Two clusters of which somebody knows whether they are one thing: a distance for each rule that both sides allow.
struct LabelledPair {
  std::vector<std::optional<double>> distances;  // in the order of the rules
  bool same = false;
};

LabelledPair labelled_pair(const SimilarityConfig& config, const Cluster& a, const Cluster& b, bool same);

struct SigmaLearning {
  SimilarityConfig config;
  double before = 0, after = 0;            // mean log-likelihood of a pair
  std::vector<std::uint64_t> pair_counts;  // by rule: how many pairs had both sides
  std::string problem;                     // not empty: nothing was learned
};

// `prior_deviation` of the logarithm of a sigma, around the one to begin with: a finite one keeps what few pairs say, or say of
// no use, near it.
SigmaLearning learn_sigmas(const SimilarityConfig& config, const std::vector<LabelledPair>& pairs,
                           double prior_deviation = std::numeric_limits<double>::infinity());

}  // namespace sherlog
