// When the optimiser of learning is content.
#pragma once

#include <cstdint>

namespace sherlog {

struct OptimiserOptions {
  std::uint32_t max_iterations = 1000;
  double gradient_tolerance = 1e-6;   // largest entry of the gradient (with prior)
  double function_tolerance = 1e-13;  // relative change of the value
};

}  // namespace sherlog
