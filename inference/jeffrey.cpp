#include "inference/jeffrey.h"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

namespace sherlog {
namespace {

constexpr double kExactTolerance = 1e-10;  // of a marginal
constexpr double kSlowTolerance = 1e-7;    // accepted where no step makes it better any more
constexpr double kFarBias = 30.0;          // nats: from here on it is worth asking whether the wish is hopeless
constexpr double kHopelessMargin = 1e-7;   // by so much a direction has to separate: rounding is far below
constexpr double kLongestStep = 4.0;       // nats, at first
constexpr int kExactIterations = 500;
constexpr int kLookEvery = 10;      // iterations between questions whether there is hope
constexpr int kFirstRounds = 12;    // enough for targets that hardly touch each other
constexpr int kSampledRounds = 24;  // the first half leads near, the second is averaged
constexpr int kSampledPasses = 8;   // of so many rounds
// Of the final draws, for one round of either half, and for the question whether the average will do.
constexpr double kRoughShare = 1.0 / 16, kAveragedShare = 1.0 / 8, kCheckShare = 1.0 / 4;
constexpr double kSampledTolerance = 0.02;
constexpr double kNoise = 3.0;         // standard errors of an estimate that may well be chance
constexpr double kFewestDraws = 1e-4;  // estimates of 0 and 1 are as far off as a few draws can tell
constexpr double kLeastGain = 0.05, kMostGain = 4.0;

double logit(double p) { return std::log(p) - std::log1p(-p); }

class Fit {
 public:
  Fit(const GroundNetwork& network, std::span<const SoftTarget> targets, const JeffreyModel& model)
      : network_(network),
        targets_(targets),
        model_(model),
        size_(static_cast<Eigen::Index>(targets.size())),
        wanted_(size_) {
    for (Eigen::Index i = 0; i < size_; ++i) wanted_[i] = targets_[static_cast<std::size_t>(i)].probability;
  }

  JeffreyFit run() {
    Point start = at(Eigen::VectorXd::Zero(size_));
    if (!start.completed()) {
      stopped(start);
    } else if (start.evaluation.log_partition) {
      fit_exact(std::move(start));
    } else {
      fit_sampled(std::move(start));
    }
    return std::move(fit_);
  }

 private:
  struct Point {
    Eigen::VectorXd biases, gradient;
    double value = 0.0;
    JeffreyEvaluation evaluation;

    bool completed() const { return evaluation.termination == Termination::kCompleted; }
    double error() const { return gradient.cwiseAbs().maxCoeff(); }
    // As near as can be told: no nearer than the estimates are themselves.
    bool near() const {
      const std::vector<double>& noise = evaluation.standard_errors;
      for (Eigen::Index i = 0; i < gradient.size(); ++i) {
        const double own = noise.empty() ? 0.0 : kNoise * noise[static_cast<std::size_t>(i)];
        if (std::abs(gradient[i]) > std::max(kSampledTolerance, own)) return false;
      }
      return true;
    }
  };

  Point at(const Eigen::VectorXd& biases, double share = kCheckShare) {
    Point point;
    point.biases = biases;
    point.gradient = Eigen::VectorXd::Zero(size_);
    point.evaluation = model_.evaluate({biases.data(), static_cast<std::size_t>(size_)}, rounds_++, share);
    if (!point.completed()) return point;
    for (Eigen::Index i = 0; i < size_; ++i) {
      point.gradient[i] = point.evaluation.marginals[static_cast<std::size_t>(i)] - wanted_[i];
    }
    point.value = point.evaluation.log_partition.value_or(0.0) - biases.dot(wanted_);
    return point;
  }

  void finish(const Point& point) {
    fit_.met = true;
    fit_.biases.assign(point.biases.data(), point.biases.data() + size_);
  }

  // Not shown to be impossible, so it is answered for what it is.
  void finish_near(const Point& point) {
    finish(point);
    const std::size_t i = worst(point);
    fit_.warning =
        fmt::format("the soft evidence is not quite met: '{}' has the probability {:.6g} instead of {}",
                    network_.atom_text(targets_[i].atom), point.evaluation.marginals[i], targets_[i].probability);
  }

  void stopped(const Point& point) { fit_.termination = point.evaluation.termination; }

  static std::size_t worst(const Point& point) {
    Eigen::Index index = 0;
    point.gradient.cwiseAbs().maxCoeff(&index);
    return static_cast<std::size_t>(index);
  }

  void cannot(const Point& point) {
    const std::size_t i = worst(point);
    fit_.termination = Termination::kNoPossibleWorld;
    fit_.message = fmt::format(
        "the soft evidence cannot be met: no distribution over the possible worlds gives '{}' the probability {} "
        "together with the other soft evidence",
        network_.atom_text(targets_[i].atom), targets_[i].probability);
  }

  // No mixture of possible worlds reaches the wanted marginals in this direction.
  bool separates(Eigen::VectorXd direction) const {
    const double largest = direction.cwiseAbs().maxCoeff();
    if (!(largest > 0.0) || !std::isfinite(largest)) return false;
    direction /= largest;
    const double bound = model_.largest({direction.data(), static_cast<std::size_t>(size_)});
    return direction.dot(wanted_) > bound + kHopelessMargin * (1.0 + direction.cwiseAbs().sum());
  }

  bool hopeless(const Point& point) const {
    // A target that never (or always) holds cannot be moved at all.
    for (Eigen::Index i = 0; i < size_; ++i) {
      const double m = point.evaluation.marginals[static_cast<std::size_t>(i)];
      const bool never = m<kFewestDraws, always = m> 1.0 - kFewestDraws;
      if ((never || always) && separates((never ? 1.0 : -1.0) * Eigen::VectorXd::Unit(size_, i))) return true;
    }
    return separates(point.biases) || separates(-point.gradient);
  }

  // --- exact marginals

  Eigen::MatrixXd scaled_identity(const Point& point) const {
    Eigen::MatrixXd inverse_hessian = Eigen::MatrixXd::Zero(size_, size_);
    for (Eigen::Index i = 0; i < size_; ++i) {
      const double m = point.evaluation.marginals[static_cast<std::size_t>(i)];
      inverse_hessian(i, i) = 1.0 / std::max(m * (1.0 - m), 1e-6);
    }
    return inverse_hessian;
  }

  void fit_exact(Point point) {
    Eigen::MatrixXd inverse_hessian = scaled_identity(point);
    bool fresh = true;
    double longest = kLongestStep;
    for (int iteration = 0; iteration < kExactIterations; ++iteration) {
      if (point.error() < kExactTolerance) return finish(point);
      const bool far = point.biases.cwiseAbs().maxCoeff() > kFarBias;
      if ((iteration == 0 || far) && iteration % kLookEvery == 0 && point.error() > kSlowTolerance && hopeless(point)) {
        return cannot(point);
      }
      Eigen::VectorXd direction = -inverse_hessian * point.gradient;
      const double largest = direction.cwiseAbs().maxCoeff();
      const bool cut = largest > longest;
      if (cut) direction *= longest / largest;
      Point next;
      const double step = line_search(point, direction, next);
      if (!next.completed()) return stopped(next);
      if (!(step > 0.0)) {
        if (fresh) break;
        inverse_hessian = scaled_identity(point);
        fresh = true;
        continue;
      }
      // Weights of hundreds of nats are overcome by steps that grow.
      if (cut && step >= 1.0) longest *= 2.0;
      if (step < 0.5) longest = std::max(kLongestStep, longest / 2.0);
      update(inverse_hessian, next.biases - point.biases, next.gradient - point.gradient);
      point = std::move(next);
      fresh = false;
    }
    if (point.error() >= kSlowTolerance) return fit_in_turn(std::move(point));
    finish(point);
  }

  // The length of the step that was taken to `next`; 0 where none makes the value or the gradient smaller.
  double line_search(const Point& point, const Eigen::VectorXd& direction, Point& next) {
    const double slope = direction.dot(point.gradient);
    for (double step = 1.0; step > 1e-6 && slope < 0.0; step *= 0.5) {
      next = at(point.biases + step * direction);
      if (!next.completed()) return 0.0;
      // Near the optimum the value's rounding hides the descent: a smaller gradient is good enough.
      if (next.value <= point.value + 1e-4 * step * slope || next.gradient.norm() < 0.9 * point.gradient.norm()) {
        return step;
      }
    }
    return 0.0;
  }

  // Iterative proportional fitting, one target at a time: slow, but each step lowers D whatever its shape.
  void fit_in_turn(Point point) {
    for (int iteration = 0; iteration < kExactIterations; ++iteration) {
      if (point.error() < kSlowTolerance) return finish(point);
      const auto i = static_cast<Eigen::Index>(worst(point));
      const double m = std::clamp(point.evaluation.marginals[static_cast<std::size_t>(i)], 1e-15, 1.0 - 1e-15);
      Eigen::VectorXd biases = point.biases;
      biases[i] += logit(wanted_[i]) - logit(m);
      Point next = at(biases);
      if (!next.completed()) return stopped(next);
      point = std::move(next);
    }
    if (point.error() < kSlowTolerance) return finish(point);
    hopeless(point) ? cannot(point) : finish_near(point);
  }

  // BFGS (Nocedal & Wright, eq. 6.17).
  static void update(Eigen::MatrixXd& h, const Eigen::VectorXd& s, const Eigen::VectorXd& y) {
    const double sy = s.dot(y);
    if (sy <= 1e-300) return;
    const Eigen::VectorXd hy = h * y;
    h += ((sy + y.dot(hy)) / (sy * sy)) * (s * s.transpose()) - (hy * s.transpose() + s * hy.transpose()) / sy;
  }

  // --- estimated marginals

  void fit_sampled(Point point) {
    Eigen::VectorXd gains = Eigen::VectorXd::Ones(size_);
    if (hopeless(point)) return cannot(point);
    for (int pass = 0; pass < kSampledPasses; ++pass) {
      const int rounds = pass == 0 ? kFirstRounds : kSampledRounds;
      Eigen::VectorXd average = Eigen::VectorXd::Zero(size_);
      int averaged = 0;
      for (int round = 0; round < rounds; ++round) {
        const bool averages = round >= rounds / 2;
        Point next = at(point.biases + step_of(point, gains, averages), averages ? kAveragedShare : kRoughShare);
        if (!next.completed()) return stopped(next);
        adapt(gains, point, next);
        const bool far = next.biases.cwiseAbs().maxCoeff() > kFarBias && next.error() > kSampledTolerance;
        if (far && round % kLookEvery == 0 && hopeless(next)) return cannot(next);
        point = std::move(next);
        if (!averages) continue;
        average += point.biases;
        ++averaged;
      }
      point = at(average / averaged);
      if (!point.completed()) return stopped(point);
      if (point.near()) return finish(point);
      if (hopeless(point)) return cannot(point);
    }
    finish_near(point);
  }

  Eigen::VectorXd step_of(const Point& point, const Eigen::VectorXd& gains, bool averages) const {
    Eigen::VectorXd step(size_);
    for (Eigen::Index i = 0; i < size_; ++i) {
      const double m =
          std::clamp(point.evaluation.marginals[static_cast<std::size_t>(i)], kFewestDraws, 1.0 - kFewestDraws);
      // What is averaged shall stay near the optimum and not follow the noise.
      const double gain = averages ? std::min(gains[i], 0.5) : gains[i];
      step[i] = gain * (logit(wanted_[i]) - logit(m));
    }
    return step;
  }

  // A target whose error changes sign was moved too far, by its own step or by those of its neighbours.
  static void adapt(Eigen::VectorXd& gains, const Point& before, const Point& after) {
    for (Eigen::Index i = 0; i < gains.size(); ++i) {
      const double factor = before.gradient[i] * after.gradient[i] < 0.0 ? 0.6 : 1.2;
      gains[i] = std::clamp(gains[i] * factor, kLeastGain, kMostGain);
    }
  }

  const GroundNetwork& network_;
  std::span<const SoftTarget> targets_;
  const JeffreyModel& model_;
  Eigen::Index size_;
  Eigen::VectorXd wanted_;
  std::uint32_t rounds_ = 0;
  JeffreyFit fit_;
};

}  // namespace

JeffreyFit fit_jeffrey(const GroundNetwork& network, std::span<const SoftTarget> targets, const JeffreyModel& model) {
  return Fit(network, targets, model).run();
}

}  // namespace sherlog
