#include "perception_bridge/identity_resolver.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <iterator>
#include <numbers>

#include "inference/standing_question.h"
#include "perception_bridge/association_question.h"
#include "perception_bridge/grades.h"

namespace sherlog {
namespace {

constexpr double kLeastGrade = 1e-9;
constexpr const char* kAnswers[] = {"is", "appear", "disappear", "hidden"};
constexpr const char* kEvidence[] = {"similar", "proximity", "outOfView"};
constexpr const char* kSeesPlace = "seesPlace";

double clamped(double grade) { return std::clamp(grade, kLeastGrade, 1 - kLeastGrade); }
double grade_of_odds(double log_odds) { return clamped(1 / (1 + std::exp(-log_odds))); }

// log of the density of a difference of two measurements with that sigma each.
double log_difference(double difference, double sigma) {
  const double variance = 2 * sigma * sigma;
  return -0.5 * (difference * difference / variance + std::log(2 * std::numbers::pi * variance));
}

double normal_below(double z) { return 0.5 * std::erfc(-z / std::numbers::sqrt2); }

}  // namespace

std::string validate(const Grading& grading) {
  for (const double sigma : {grading.sigma_color, grading.sigma_position}) {
    if (!(sigma > 0) || !std::isfinite(sigma)) return fmt::format("sigma is {}, but must be above 0", sigma);
  }
  return {};
}

double sees_place(const Observation& old, const View& view, const FourTablesConfig& config, double sigma) {
  if (old.table != view.table) return 0;
  double inside = 1;
  const Position size = {config.table_width, config.table_depth};
  for (std::size_t a = 0; a < size.size(); ++a) {
    const auto below = [&](double x) { return normal_below((x - old.position[a]) / sigma); };
    inside *= std::clamp((below(view.max[a]) - below(view.min[a])) / (below(size[a]) - below(0)), 0.0, 1.0);
  }
  return inside;
}

PairGrade grade_pair(const Observation& old, const Observation& now, const FourTablesTrial& trial,
                     const Grading& grading) {
  const FourTablesConfig& config = trial.config;
  if (grading.kind != Grading::Kind::kOdds) {
    const auto g = grading.kind == Grading::Kind::kPaper ? printed_g : gaussian_g;
    return {clamped(g(color_distance(old, now), grading.sigma_color)),
            clamped(g(position_distance(old, now, config), grading.sigma_position))};
  }
  double color = 0;
  for (std::size_t c = 0; c < old.color.size(); ++c)
    color += log_difference(old.color[c] - now.color[c], grading.sigma_color);
  PairGrade grade{grade_of_odds(color), kLeastGrade};
  if (old.table != now.table) return grade;
  double place = std::log(config.table_width * config.table_depth);
  for (std::size_t a = 0; a < 2; ++a)
    place += log_difference(old.position[a] - now.position[a], grading.sigma_position);
  grade.proximity = grade_of_odds(place);
  return grade;
}

namespace {

PairGrade evidence_grade(const Observation& old, const Observation& now, const FourTablesTrial& trial,
                         const Grading& grading, bool with_sees_place) {
  PairGrade grade = grade_pair(old, now, trial, grading);
  if (!with_sees_place) return grade;
  // To be seen again at its place, the place has to be in view.
  const double sees = clamped(sees_place(old, trial.view, trial.config, grading.sigma_position));
  grade.proximity = grade_of_odds(std::log(grade.proximity / (1 - grade.proximity)) + std::log(sees));
  return grade;
}

}  // namespace

std::string identity_evidence(const FourTablesTrial& trial, const Grading& grading, bool with_sees_place) {
  std::string text;
  const auto out = std::back_inserter(text);
  const auto list = [&](const char* domain, char letter, std::size_t count) {
    if (count == 0) return;
    fmt::format_to(out, "{} = {{", domain);
    for (std::size_t i = 1; i <= count; ++i) fmt::format_to(out, "{}{}{}", i > 1 ? ", " : "", letter, i);
    text += "}\n";
  };
  list("oldCluster", 'O', trial.old_clusters.size());
  list("newCluster", 'N', trial.new_clusters.size());
  for (std::size_t o = 0; o < trial.old_clusters.size(); ++o) {
    const Observation& old = trial.old_clusters[o];
    if (old.out_of_view) fmt::format_to(out, "outOfView(O{})\n", o + 1);
    const double sees = clamped(sees_place(old, trial.view, trial.config, grading.sigma_position));
    if (with_sees_place) fmt::format_to(out, "{} {}(O{})\n", sees, kSeesPlace, o + 1);
    for (std::size_t n = 0; n < trial.new_clusters.size(); ++n) {
      const PairGrade grade = evidence_grade(old, trial.new_clusters[n], trial, grading, with_sees_place);
      fmt::format_to(out, "{} similar(O{},N{})\n{} proximity(O{},N{})\n", grade.similar, o + 1, n + 1, grade.proximity,
                     o + 1, n + 1);
    }
  }
  return text;
}

struct IdentityResolver::Parts {
  std::string name;
  Grading grading;
  StandingQuestion question;
  bool with_sees_place = false;
};

IdentityResolver::IdentityResolver(std::unique_ptr<Parts> parts) : parts_(std::move(parts)) {}
IdentityResolver::~IdentityResolver() = default;

std::unique_ptr<IdentityResolver> IdentityResolver::make(std::string name, Model model, const Grading& grading,
                                                         InferenceOptions options, std::string& problem) {
  problem = validate(grading);
  if (!problem.empty()) return nullptr;
  for (const char* predicate : {"is", "appear", "disappear", "hidden", "similar", "proximity", "outOfView"}) {
    if (model.find_predicate(predicate)) continue;
    problem = fmt::format("the model does not declare '{}'", predicate);
    return nullptr;
  }
  if (!explanation_constants(model, problem)) return nullptr;
  const auto& domains = model.predicate(*model.find_predicate("is")).domains;
  if (model.domain(domains[0]).name != "oldCluster" || model.domain(domains[1]).name != "newCluster") {
    problem = "the arguments of 'is' must be of the domains oldCluster and newCluster";
    return nullptr;
  }
  // What is no evidence is to be found out.
  std::vector<std::string> open;
  for (const Predicate& predicate : model.predicates()) {
    const bool given =
        std::ranges::find(kEvidence, predicate.name) != std::end(kEvidence) || predicate.name == kSeesPlace;
    if (!given) open.push_back(predicate.name);
  }
  options.threads = 1;  // trials run side by side
  const bool with_sees_place = model.find_predicate(kSeesPlace).has_value();
  auto parts = std::unique_ptr<Parts>(new Parts{
      std::move(name), grading,
      StandingQuestion(std::move(model), {std::begin(kAnswers), std::end(kAnswers)}, open, std::move(options)),
      with_sees_place});
  return std::unique_ptr<IdentityResolver>(new IdentityResolver(std::move(parts)));
}

std::string IdentityResolver::name() const { return parts_->name; }

IdentityResolver::Belief IdentityResolver::believe(const FourTablesTrial& trial) const {
  const auto start = std::chrono::steady_clock::now();
  const Parts& p = *parts_;
  Belief out;
  const std::string evidence = identity_evidence(trial, p.grading, p.with_sees_place);
  out.evidence_seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  Monitor quiet;
  const StandingQuestion::Answer answer = p.question.ask(
      evidence, quiet, method_for(p.question.options(), trial.old_clusters.size(), trial.new_clusters.size()));
  out.termination = answer.termination;
  out.message = answer.message;
  out.method = answer.method;
  out.ground_seconds = answer.ground_seconds;
  out.infer_seconds = answer.infer_seconds;
  if (answer.termination != Termination::kCompleted) return out;
  out.belief = belief_of(p.question, answer, {"O", "N"}, 1, trial.old_clusters.size(), trial.new_clusters.size());
  return out;
}

std::vector<PairGrade> IdentityResolver::grades(const FourTablesTrial& trial) const {
  std::vector<PairGrade> grades;
  for (const Observation& old : trial.old_clusters) {
    for (const Observation& now : trial.new_clusters)
      grades.push_back(evidence_grade(old, now, trial, parts_->grading, parts_->with_sees_place));
  }
  return grades;
}

MatcherAnswer IdentityResolver::resolve(const FourTablesTrial& trial) const {
  const auto start = std::chrono::steady_clock::now();
  MatcherAnswer answer;
  const Belief belief = believe(trial);
  answer.termination = belief.termination;
  answer.message = belief.message;
  if (belief.termination == Termination::kCompleted) answer.resolution = decide(belief.belief, trial);
  answer.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return answer;
}

}  // namespace sherlog
