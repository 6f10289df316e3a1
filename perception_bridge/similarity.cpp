#include "perception_bridge/similarity.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <functional>
#include <limits>
#include <map>
#include <numeric>

#include "mln/diagnostics.h"
#include "perception_bridge/annotation_types.h"

namespace sherlog {
namespace {

// A degree of exactly 0 or 1 would be a certainty that no measurement gives.
constexpr double kLeastDegree = 1e-9;

constexpr std::array<std::string_view, 3> kKernelNames = {"gaussian", "textbook_gaussian", "logistic"};
constexpr std::array<std::string_view, 6> kDistanceNames = {"position", "euclidean",  "histogram",
                                                            "hamming",  "categories", "size"};

template <class Names>
std::optional<std::size_t> index_of(const Names& names, std::string_view name) {
  const auto found = std::find(names.begin(), names.end(), name);
  return found == names.end() ? std::nullopt : std::optional(static_cast<std::size_t>(found - names.begin()));
}

// --- distances ---

double euclidean(const std::vector<double>& a, const std::vector<double>& b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += (a[i] - b[i]) * (a[i] - b[i]);
  return std::sqrt(sum);
}

std::optional<double> position_distance(const Cluster& a, const Cluster& b) {
  const auto first = position_of(a), second = position_of(b);
  if (!first || !second) return std::nullopt;
  if (first->frame != second->frame) return std::numeric_limits<double>::infinity();
  const std::size_t common = std::min(first->coordinates.size(), second->coordinates.size());
  const auto cut = [&](const ScenePosition& position) {
    return std::vector<double>(position.coordinates.begin(),
                               position.coordinates.begin() + static_cast<std::ptrdiff_t>(common));
  };
  return euclidean(cut(*first), cut(*second));
}

// sqrt(1 - sum sqrt(p q)) of the normalised counts
std::optional<double> hellinger(const std::vector<double>& a, const std::vector<double>& b) {
  const double first = std::accumulate(a.begin(), a.end(), 0.0), second = std::accumulate(b.begin(), b.end(), 0.0);
  if (!(first > 0) || !(second > 0)) return std::nullopt;
  double overlap = 0;
  for (std::size_t i = 0; i < a.size(); ++i) overlap += std::sqrt(std::max(0.0, a[i] / first * (b[i] / second)));
  return std::sqrt(std::max(0.0, 1 - overlap));
}

std::optional<double> log_sizes(std::vector<double> a, std::vector<double> b) {
  std::sort(a.begin(), a.end());
  std::sort(b.begin(), b.end());
  if (a.empty() || !(a.front() > 0) || !(b.front() > 0)) return std::nullopt;
  for (double& edge : a) edge = std::log(edge);
  for (double& edge : b) edge = std::log(edge);
  return euclidean(a, b);
}

std::optional<double> hamming(std::string_view a, std::string_view b) {
  if (a.empty() || a.size() != b.size()) return std::nullopt;
  const auto digit = [](char c) {
    return c >= '0' && c <= '9'   ? c - '0'
           : c >= 'a' && c <= 'f' ? c - 'a' + 10
           : c >= 'A' && c <= 'F' ? c - 'A' + 10
                                  : -1;
  };
  int different = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    const int first = digit(a[i]), second = digit(b[i]);
    if (first < 0 || second < 0) return std::nullopt;
    different += std::popcount(static_cast<unsigned>(first ^ second));
  }
  return static_cast<double>(different) / (4.0 * static_cast<double>(a.size()));
}

std::optional<double> one_distance(const SimilarityRule& rule, const Annotation& a, const Annotation& b) {
  const auto first = select(a.fields, rule.field), second = select(b.fields, rule.field);
  if (first.size() != 1 || second.size() != 1) return std::nullopt;
  if (rule.distance == DistanceKind::kHamming) {
    const bool texts = first[0]->text() != nullptr && second[0]->text() != nullptr;
    return texts ? hamming(*first[0]->text(), *second[0]->text()) : std::nullopt;
  }
  const auto x = numbers_of(*first[0]), y = numbers_of(*second[0]);
  if (!x || !y || x->size() != y->size()) return std::nullopt;
  if (rule.distance == DistanceKind::kHistogram) return hellinger(*x, *y);
  if (rule.distance == DistanceKind::kSize) return log_sizes(*x, *y);
  return euclidean(*x, *y);
}

// The weights of the names, which sum to 1; empty where there is none.
std::map<std::string, double> weights_of(const SimilarityRule& rule, const Cluster& cluster) {
  std::map<std::string, double> weights;
  double sum = 0;
  for (const Annotation* annotation : annotations_of(cluster.annotations, rule.type)) {
    double weight = annotation->confidence.value_or(1);
    if (!rule.weight.empty()) {
      for (const Value* value : select(annotation->fields, rule.weight)) weight = value->number().value_or(weight);
    }
    for (const Value* value : select(annotation->fields, rule.field)) {
      if (value->text() == nullptr || !(weight > 0)) continue;
      weights[*value->text()] += weight;
      sum += weight;
    }
  }
  for (auto& [name, weight] : weights) weight /= sum;
  return weights;
}

std::optional<double> category_distance(const SimilarityRule& rule, const Cluster& a, const Cluster& b) {
  auto first = weights_of(rule, a);
  const auto second = weights_of(rule, b);
  if (first.empty() || second.empty()) return std::nullopt;
  for (const auto& [name, weight] : second) first[name] -= weight;
  double sum = 0;
  for (const auto& [name, weight] : first) sum += std::abs(weight);
  return std::min(1.0, sum / 2);
}

// --- learning ---

// Every pair's similarity while one sigma after the other is changed.
class PairLikelihood {
 public:
  PairLikelihood(const SimilarityConfig& config, const std::vector<LabelledPair>& pairs)
      : pairs_(pairs), logarithms_(config.rules.size(), std::vector<double>(pairs.size(), 0.0)), sums_(pairs.size()) {
    for (const LabelledPair& pair : pairs) {
      counts_.push_back(
          static_cast<double>(std::ranges::count_if(pair.distances, [](const auto& d) { return d.has_value(); })));
    }
    for (std::size_t i = 0; i < config.rules.size(); ++i) set(i, config.rules[i]);
  }

  void set(std::size_t i, const SimilarityRule& rule) {
    for (std::size_t p = 0; p < pairs_.size(); ++p) {
      const double logarithm = logarithm_of(p, i, rule);
      sums_[p] += logarithm - logarithms_[i][p];
      logarithms_[i][p] = logarithm;
    }
  }

  // The mean, as if rule i were that one.
  double with(std::size_t i, const SimilarityRule& rule) const {
    double sum = 0;
    for (std::size_t p = 0; p < pairs_.size(); ++p) {
      if (counts_[p] == 0) continue;
      const double logarithms = sums_[p] - logarithms_[i][p] + logarithm_of(p, i, rule);
      const double s = std::clamp(std::exp(logarithms / counts_[p]), kLeastDegree, 1 - kLeastDegree);
      sum += std::log(pairs_[p].same ? s : 1 - s);
    }
    return sum / static_cast<double>(pairs_.size());
  }

 private:
  double logarithm_of(std::size_t p, std::size_t i, const SimilarityRule& rule) const {
    const auto& distance = pairs_[p].distances[i];
    if (!distance) return 0;
    return std::log(std::max(kernel_value(rule.kernel, *distance, rule.sigma), std::numeric_limits<double>::min()));
  }

  const std::vector<LabelledPair>& pairs_;
  std::vector<std::vector<double>> logarithms_;  // of the kernels' values, by rule and pair
  std::vector<double> sums_, counts_;            // by pair
};

// The best x in [low, high] of a function that may have several peaks: a grid, then golden sections around its best point.
double maximise(const std::function<double(double)>& f, double low, double high) {
  constexpr int kGrid = 40;
  const double step = (high - low) / kGrid;
  double best = low, best_value = f(low);
  for (int i = 1; i <= kGrid; ++i) {
    const double value = f(low + step * i);
    if (value > best_value) best = low + step * i, best_value = value;
  }
  double a = std::max(low, best - step), b = std::min(high, best + step);
  constexpr double kGolden = 0.6180339887498949;
  double x = b - kGolden * (b - a), y = a + kGolden * (b - a);
  double fx = f(x), fy = f(y);
  while (b - a > 1e-7) {
    if (fx > fy) {
      b = y, y = x, fy = fx;
      x = b - kGolden * (b - a), fx = f(x);
    } else {
      a = x, x = y, fx = fy;
      y = a + kGolden * (b - a), fy = f(y);
    }
  }
  const double middle = (a + b) / 2;
  return f(middle) >= best_value ? middle : best;
}

std::string check_pairs(const SimilarityConfig& config, const std::vector<LabelledPair>& pairs) {
  if (std::string problem = validate(config); !problem.empty()) return problem;
  bool same = false, different = false;
  for (std::size_t p = 0; p < pairs.size(); ++p) {
    const LabelledPair& pair = pairs[p];
    if (pair.distances.size() != config.rules.size()) {
      return fmt::format("pair {} has {} distances, and there are {} rules", p, pair.distances.size(),
                         config.rules.size());
    }
    for (std::size_t i = 0; i < pair.distances.size(); ++i) {
      if (pair.distances[i] && !(*pair.distances[i] >= 0)) {
        return fmt::format("pair {}: the distance {} of '{}' is not a number of at least 0", p, *pair.distances[i],
                           config.rules[i].type);
      }
    }
    (pair.same ? same : different) = true;
  }
  if (!same || !different) return "there have to be pairs of one thing and pairs of two things";
  return {};
}

// "" where it is not there; anything but a text is a problem.
std::string text_at(const Value& object, const char* key, std::string& problem) {
  const Value* value = object.find(key);
  if (value == nullptr) return "";
  if (value->text() != nullptr) return *value->text();
  if (problem.empty()) problem = fmt::format("a similarity rule's '{}' is {}, not a text", key, value->kind());
  return "";
}

std::optional<SimilarityRule> rule_from_json(const Value& document, std::string& problem) {
  if (document.object() == nullptr) return problem = "a similarity rule is not an object", std::nullopt;
  for (const auto& [key, value] : *document.object()) {
    constexpr std::array<std::string_view, 6> kKeys = {"type", "distance", "field", "weight", "kernel", "sigma"};
    if (!index_of(kKeys, key)) return problem = fmt::format("a similarity rule has no '{}'", key), std::nullopt;
  }
  SimilarityRule rule;
  problem.clear();
  rule.type = text_at(document, "type", problem);
  rule.field = text_at(document, "field", problem);
  rule.weight = text_at(document, "weight", problem);
  const std::string distance = text_at(document, "distance", problem);
  const std::string kernel = document.find("kernel") == nullptr ? "gaussian" : text_at(document, "kernel", problem);
  if (!problem.empty()) return std::nullopt;
  const auto distance_index = index_of(kDistanceNames, distance);
  const auto kernel_index = index_of(kKernelNames, kernel);
  if (!distance_index) {
    problem = fmt::format("'{}': distance '{}' is none of {}", rule.type, distance, fmt::join(kDistanceNames, ", "));
    return std::nullopt;
  }
  if (!kernel_index) {
    problem = fmt::format("'{}': kernel '{}' is none of {}", rule.type, kernel, fmt::join(kKernelNames, ", "));
    return std::nullopt;
  }
  rule.distance = static_cast<DistanceKind>(*distance_index);
  rule.kernel = static_cast<SimilarityKernel>(*kernel_index);
  if (const Value* sigma = document.find("sigma")) rule.sigma = sigma->number().value_or(std::nan(""));
  return rule;
}

// Names that are none, and rules that would count the same thing twice.
std::string check_types(const SimilarityConfig& config) {
  for (std::size_t i = 0; i < config.rules.size(); ++i) {
    const SimilarityRule& rule = config.rules[i];
    if (std::string problem = mistyped_annotation_type(rule.type); !problem.empty()) return problem;
    for (std::size_t j = 0; j < i; ++j) {
      const SimilarityRule& other = config.rules[j];
      if (full_type_name(rule.type) == full_type_name(other.type) && rule.distance == other.distance &&
          rule.field == other.field) {
        return fmt::format("there are two similarity rules for '{}'{}", rule.type,
                           rule.field.empty() ? "" : fmt::format(" and its '{}'", rule.field));
      }
    }
  }
  return {};
}

}  // namespace

std::string mistyped_annotation_type(std::string_view type) {
  if (find_annotation_type(type) != nullptr) return {};
  if (!type.starts_with("rs.") && !type.starts_with("sherlog.") && type.find('.') != std::string_view::npos) return {};
  std::vector<std::string> names;
  for (const AnnotationType& known : annotation_types()) {
    names.emplace_back(known.name);
    names.emplace_back(known.name.substr(known.name.rfind('.') + 1));
  }
  const std::string nearest = did_you_mean(type, names);
  return fmt::format("there is no annotation type '{}'{}", type,
                     nearest.empty() ? "" : fmt::format("; did you mean '{}'?", nearest));
}

double kernel_value(SimilarityKernel kernel, double distance, double sigma) {
  const double x = distance / sigma;
  switch (kernel) {
    case SimilarityKernel::kGaussian:
      return std::exp(-(x / 2) * (x / 2));  // Eq. 1
    case SimilarityKernel::kTextbookGaussian:
      return std::exp(-x * x / 2);
    case SimilarityKernel::kLogistic:
      return 2 - 2 / (1 + std::exp(-x));  // Eq. 2
  }
  return 0;
}

SimilarityConfig default_similarity() {
  using enum DistanceKind;
  using enum SimilarityKernel;
  return {{{"rs.annotation.PoseAnnotation", kPosition, "", "", kGaussian, 0.25},
           {"sherlog.annotation.MeanColor", kEuclidean, "/color", "", kGaussian, 0.25},
           {"rs.annotation.ColorHistogram", kHistogram, "/hist", "", kGaussian, 0.3},
           {"rs.annotation.SemanticColor", kCategories, "/color", "/ratio", kLogistic, 0.3},
           {"rs.annotation.Shape", kCategories, "/shape", "", kLogistic, 0.5},
           {"rs.annotation.PclFeature", kHistogram, "/feature", "", kGaussian, 0.3},
           {"rs.annotation.Geometry", kSize, "/size", "", kGaussian, 0.3},
           {"rs.annotation.PerceptualHash", kHamming, "/hash", "", kGaussian, 0.15},
           {"rs.annotation.Detection", kCategories, "/name", "", kLogistic, 0.5}}};
}

std::string validate(const SimilarityConfig& config) {
  for (const SimilarityRule& rule : config.rules) {
    if (rule.type.empty()) return "a similarity rule has no 'type'";
    if (!(rule.sigma > 0) || !std::isfinite(rule.sigma)) {
      return fmt::format("'{}': sigma {} is not a positive number", rule.type, rule.sigma);
    }
    if (rule.distance != DistanceKind::kPosition && rule.field.empty()) {
      return fmt::format("'{}' has no 'field'", rule.type);
    }
  }
  return {};
}

std::optional<SimilarityConfig> similarity_from_json(const Value& document, std::string& problem) {
  const Value* rules = document.find("rules");
  if (rules == nullptr || rules->list() == nullptr) {
    problem = "a similarity has a list of 'rules'";
    return std::nullopt;
  }
  for (const auto& [key, value] : *document.object()) {
    if (key != "rules") return problem = fmt::format("a similarity has 'rules' and no '{}'", key), std::nullopt;
  }
  SimilarityConfig config;
  for (const Value& item : *rules->list()) {
    const auto rule = rule_from_json(item, problem);
    if (!rule) return std::nullopt;
    config.rules.push_back(*rule);
  }
  problem = validate(config);
  if (problem.empty()) problem = check_types(config);
  return problem.empty() ? std::optional(std::move(config)) : std::nullopt;
}

Value similarity_to_json(const SimilarityConfig& config) {
  Value::List rules;
  for (const SimilarityRule& rule : config.rules) {
    Value::Object object = {{"type", Value(rule.type)},
                            {"distance", Value(std::string(kDistanceNames[static_cast<std::size_t>(rule.distance)]))}};
    if (!rule.field.empty()) object.emplace_back("field", Value(rule.field));
    if (!rule.weight.empty()) object.emplace_back("weight", Value(rule.weight));
    object.emplace_back("kernel", Value(std::string(kKernelNames[static_cast<std::size_t>(rule.kernel)])));
    object.emplace_back("sigma", Value(rule.sigma));
    rules.emplace_back(std::move(object));
  }
  return Value(Value::Object{{"rules", Value(std::move(rules))}});
}

std::optional<double> distance_between(const SimilarityRule& rule, const Cluster& a, const Cluster& b) {
  if (rule.distance == DistanceKind::kPosition) return position_distance(a, b);
  if (rule.distance == DistanceKind::kCategories) return category_distance(rule, a, b);
  std::optional<double> nearest;
  for (const Annotation* first : annotations_of(a.annotations, rule.type)) {
    for (const Annotation* second : annotations_of(b.annotations, rule.type)) {
      const auto distance = one_distance(rule, *first, *second);
      if (distance && !std::isnan(*distance) && (!nearest || *distance < *nearest)) nearest = distance;
    }
  }
  return nearest;
}

Similarity similarity_between(const SimilarityConfig& config, const Cluster& a, const Cluster& b,
                              const std::vector<std::string>& types) {
  Similarity result;
  double logarithms = 0;
  for (const SimilarityRule& rule : config.rules) {
    const bool wanted = types.empty() || std::any_of(types.begin(), types.end(), [&](const std::string& type) {
                          return full_type_name(type) == full_type_name(rule.type);
                        });
    if (!wanted) continue;
    const auto distance = distance_between(rule, a, b);
    if (!distance) continue;
    const double similarity = kernel_value(rule.kernel, *distance, rule.sigma);
    result.parts.push_back({rule.type, *distance, similarity});
    logarithms += std::log(similarity);  // of 0: minus infinity, and the mean is 0
  }
  if (!result.parts.empty()) result.value = std::exp(logarithms / static_cast<double>(result.parts.size()));
  return result;
}

LabelledPair labelled_pair(const SimilarityConfig& config, const Cluster& a, const Cluster& b, bool same) {
  LabelledPair pair;
  pair.same = same;
  for (const SimilarityRule& rule : config.rules) pair.distances.push_back(distance_between(rule, a, b));
  return pair;
}

SigmaLearning learn_sigmas(const SimilarityConfig& config, const std::vector<LabelledPair>& pairs,
                           double prior_deviation) {
  SigmaLearning result;
  result.config = config;
  result.pair_counts.assign(config.rules.size(), 0);
  result.problem = check_pairs(config, pairs);
  if (!result.problem.empty()) return result;
  for (const LabelledPair& pair : pairs) {
    for (std::size_t i = 0; i < config.rules.size(); ++i) result.pair_counts[i] += pair.distances[i] ? 1u : 0u;
  }
  if (config.rules.empty()) return result;
  PairLikelihood likelihood(config, pairs);
  result.before = likelihood.with(0, config.rules[0]);
  // Of a mean, so that the prior weighs as much as it does beside the sum.
  const auto prior = [&](std::size_t i, double sigma) {
    const double z = std::log(sigma / config.rules[i].sigma) / prior_deviation;
    return -0.5 * z * z / static_cast<double>(pairs.size());
  };
  double best_objective = result.before;
  constexpr int kMostRounds = 50;
  for (int round = 0; round < kMostRounds; ++round) {
    const double before = best_objective;
    for (std::size_t i = 0; i < config.rules.size(); ++i) {
      if (result.pair_counts[i] == 0) continue;
      SimilarityRule rule = result.config.rules[i];
      double others = 0;
      for (std::size_t j = 0; j < config.rules.size(); ++j) {
        if (j != i) others += prior(j, result.config.rules[j].sigma);
      }
      const auto objective = [&](double log_sigma) {
        rule.sigma = std::exp(log_sigma);
        return likelihood.with(i, rule) + others + prior(i, rule.sigma);
      };
      const double best = maximise(objective, std::log(1e-3), std::log(1e3));
      if (const double value = objective(best); value > best_objective) {
        best_objective = value;
        result.config.rules[i] = rule;
        likelihood.set(i, rule);
      }
    }
    if (best_objective - before < 1e-10) break;
  }
  result.after = likelihood.with(0, result.config.rules[0]);
  return result;
}

}  // namespace sherlog
