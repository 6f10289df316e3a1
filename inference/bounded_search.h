// The depth-first search of bounded_sum: a sum over all assignments whose bound exceeds a threshold.
//
// Idea      See bounded_sum.h. No memory is taken while it runs; the two variables that come last in the order are
//           summed as a product of vector, matrix and vector.
// Cost      counted in steps(), about a multiplication each.
#pragma once

#include <cstdint>
#include <memory>

#include "inference/bounded_problem.h"
#include "mln/monitor.h"

namespace sherlog {

class BoundedSearch {
 public:
  // `problem` and `stop` are kept by reference; the problem is not `impossible`.
  BoundedSearch(const BoundedProblem& problem, const StopCondition& stop, std::uint64_t max_steps);
  ~BoundedSearch();

  // Log of a lower bound of the sum in units of the root's bound: that of the assignment that looks best one variable
  // after the other, or of any that is possible. -infinity: there is none, unless stopped() or the problem may
  // underflow.
  double find_some();
  // Sums whatever has a bound above `threshold`, the root's being `scale`, in so many more steps. False: stopped.
  bool run(double scale, double threshold, std::uint64_t steps, bool with_beliefs);

  // Of the last run.
  double total() const;
  double dropped() const;  // sum of the bounds of what was left out
  // After a run with beliefs, in units of total(): what a value and an entry of problem.ratios weigh.
  double mass(std::size_t position, std::size_t value) const;
  double belief(std::size_t ratio_index) const;

  bool stopped() const;
  Termination termination() const;  // kTooWide: out of steps
  // Of a run that drops nothing.
  double full_steps() const;
  // In all runs together. Nodes: those with two variables left.
  std::uint64_t steps() const;
  std::uint64_t nodes() const;

 private:
  class Walker;
  std::unique_ptr<Walker> walker_;
};

}  // namespace sherlog
