// What learning maximises: a concave function of the weights with its gradient.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "mln/monitor.h"

namespace sherlog {

class Objective {
 public:
  virtual ~Objective() = default;
  // One for each weight of the model.
  virtual std::size_t dimension() const = 0;
  // The value in nats; the gradient (dimension() entries) is overwritten.
  virtual double evaluate(std::span<const double> weights, std::span<double> gradient) = 0;
  // Minus the second derivatives for the weights in `subset`, at `weights`: dense, subset.size() squared; of no rows where it
  // was cut short.
  virtual Eigen::MatrixXd information(std::span<const double> weights, std::span<const std::uint32_t> subset) = 0;
  // How strongly the data speaks of a weight: 0 where no value of it changes the objective.
  virtual std::span<const double> support() const = 0;
  // Groups of weights that change the objective in the same way for all data at hand: only their sum is determined.
  virtual std::vector<std::vector<std::uint32_t>> indistinguishable() const { return {}; }
  // Of the last evaluation: not kCompleted where it was cut short or failed; its value is then of no use.
  virtual Termination termination() const { return Termination::kCompleted; }
  virtual std::string message() const { return ""; }
};

}  // namespace sherlog
