#include "inference/jeffrey.h"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

namespace sherlog {
namespace {

constexpr double kExactTolerance = 1e-10;     // of a marginal
constexpr double kSlowTolerance = 1e-7;       // accepted where no step makes it better any more
constexpr double kLargestBias = 60.0;         // nats: beyond, a marginal of p needs odds of 10^26 against the model
constexpr int kExactIterations = 500;
constexpr int kSampledRounds = 40;
constexpr double kSampledTolerance = 0.02;

double logit(double p) { return std::log(p) - std::log1p(-p); }

class Fit {
 public:
  Fit(const GroundNetwork& network, std::span<const SoftTarget> targets,
      const std::function<JeffreyEvaluation(std::span<const double>)>& evaluate)
      : network_(network), targets_(targets), evaluate_(evaluate), size_(static_cast<Eigen::Index>(targets.size())) {}

  JeffreyFit run() {
    Point start = at(Eigen::VectorXd::Zero(size_));
    if (start.evaluation.termination == Termination::kCompleted && !start.evaluation.log_partition) {
      fit_sampled(std::move(start));
    } else {
      fit_exact(std::move(start));
    }
    return std::move(fit_);
  }

 private:
  struct Point {
    Eigen::VectorXd biases, gradient;
    double value = 0.0;
    JeffreyEvaluation evaluation;
  };

  Point at(const Eigen::VectorXd& biases) {
    Point point;
    point.biases = biases;
    point.gradient = Eigen::VectorXd::Zero(size_);
    point.evaluation = evaluate_({biases.data(), static_cast<std::size_t>(size_)});
    if (point.evaluation.termination != Termination::kCompleted) return point;
    point.value = point.evaluation.log_partition.value_or(0.0);
    for (Eigen::Index i = 0; i < size_; ++i) {
      const double p = targets_[static_cast<std::size_t>(i)].probability;
      point.gradient[i] = point.evaluation.marginals[static_cast<std::size_t>(i)] - p;
      point.value -= biases[i] * p;
    }
    return point;
  }

  void finish(const Point& point) {
    fit_.met = true;
    fit_.biases.assign(point.biases.data(), point.biases.data() + size_);
  }

  void stopped(const Point& point) { fit_.termination = point.evaluation.termination; }

  void cannot(const Point& point) {
    Eigen::Index worst = 0;
    point.gradient.cwiseAbs().maxCoeff(&worst);
    const SoftTarget& target = targets_[static_cast<std::size_t>(worst)];
    fit_.termination = Termination::kNoPossibleWorld;
    fit_.message = fmt::format("the soft evidence cannot be met: no distribution over the possible worlds gives '{}' the probability {} together "
                               "with the other soft evidence (nearest found: {:.6g})",
                               network_.atom_text(target.atom), target.probability,
                               point.evaluation.marginals[static_cast<std::size_t>(worst)]);
  }

  // A marginal of 0 or 1 cannot be moved by any bias.
  bool fixed(const Point& point) const {
    return std::ranges::any_of(point.evaluation.marginals, [](double m) { return m <= 0.0; });
  }

  void fit_exact(Point point) {
    if (point.evaluation.termination != Termination::kCompleted) return stopped(point);
    if (fixed(point)) return cannot(point);
    Eigen::MatrixXd inverse_hessian = Eigen::MatrixXd::Zero(size_, size_);
    const auto reset = [&](const Point& p) {
      inverse_hessian.setZero();
      for (Eigen::Index i = 0; i < size_; ++i) {
        const double m = p.evaluation.marginals[static_cast<std::size_t>(i)];
        inverse_hessian(i, i) = 1.0 / std::max(m * (1.0 - m), 1e-6);
      }
    };
    reset(point);
    bool fresh = true;
    for (int iteration = 0; iteration < kExactIterations; ++iteration) {
      const double error = point.gradient.cwiseAbs().maxCoeff();
      if (error < kExactTolerance) return finish(point);
      if (point.biases.cwiseAbs().maxCoeff() > kLargestBias) return cannot(point);
      Eigen::VectorXd direction = -inverse_hessian * point.gradient;
      const double largest = direction.cwiseAbs().maxCoeff();
      if (largest > 4.0) direction *= 4.0 / largest;
      double slope = direction.dot(point.gradient);
      Point next;
      double step = 1.0;
      bool moved = false;
      for (; step > 1e-6 && slope < 0.0; step *= 0.5) {
        next = at(point.biases + step * direction);
        if (next.evaluation.termination != Termination::kCompleted) return stopped(next);
        // Near the optimum the value's rounding hides the descent: a smaller gradient is good enough.
        if (next.value <= point.value + 1e-4 * step * slope || next.gradient.norm() < 0.9 * point.gradient.norm()) {
          moved = true;
          break;
        }
      }
      if (!moved) {
        if (error < kSlowTolerance) return finish(point);
        if (fresh) return cannot(point);
        reset(point);
        fresh = true;
        continue;
      }
      update(inverse_hessian, next.biases - point.biases, next.gradient - point.gradient);
      point = std::move(next);
      fresh = false;
    }
    if (point.gradient.cwiseAbs().maxCoeff() < kSlowTolerance) return finish(point);
    cannot(point);
  }

  // BFGS (Nocedal & Wright, eq. 6.17).
  static void update(Eigen::MatrixXd& h, const Eigen::VectorXd& s, const Eigen::VectorXd& y) {
    const double sy = s.dot(y);
    if (sy <= 1e-300) return;
    const Eigen::VectorXd hy = h * y;
    h += ((sy + y.dot(hy)) / (sy * sy)) * (s * s.transpose()) - (hy * s.transpose() + s * hy.transpose()) / sy;
  }

  void fit_sampled(Point point) {
    Eigen::VectorXd average = Eigen::VectorXd::Zero(size_);
    int averaged = 0;
    for (int round = 0; round < kSampledRounds; ++round) {
      const double damping = round < 5 ? 1.0 : 5.0 / round;
      for (Eigen::Index i = 0; i < size_; ++i) {
        // Estimates of 0 and 1 are as far off as a few draws can tell.
        const double m = std::clamp(point.evaluation.marginals[static_cast<std::size_t>(i)], 1e-4, 1.0 - 1e-4);
        const double wanted = targets_[static_cast<std::size_t>(i)].probability;
        point.biases[i] += damping * (logit(wanted) - logit(m));
      }
      if (point.biases.cwiseAbs().maxCoeff() > kLargestBias) return cannot(point);
      if (round >= kSampledRounds / 2) {
        average += point.biases;
        ++averaged;
      }
      point = at(point.biases);
      if (point.evaluation.termination != Termination::kCompleted) return stopped(point);
    }
    point = at(average / averaged);
    if (point.evaluation.termination != Termination::kCompleted) return stopped(point);
    if (point.gradient.cwiseAbs().maxCoeff() > kSampledTolerance) return cannot(point);
    finish(point);
  }

  const GroundNetwork& network_;
  std::span<const SoftTarget> targets_;
  const std::function<JeffreyEvaluation(std::span<const double>)>& evaluate_;
  Eigen::Index size_;
  JeffreyFit fit_;
};

}  // namespace

JeffreyFit fit_jeffrey(const GroundNetwork& network, std::span<const SoftTarget> targets,
                       const std::function<JeffreyEvaluation(std::span<const double>)>& evaluate) {
  return Fit(network, targets, evaluate).run();
}

}  // namespace sherlog
