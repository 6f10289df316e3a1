// One frame through a flow, on several threads; and how long annotators take.
//
// Idea      Whoever has all that it reads may run. Each gets its own part of the analysis and hands back its own
//           additions, which are put together in the order of the flow: threads decide when something runs and never
//           what comes out.
// Errors    an annotator that throws, or writes what it does not declare: its result is missing, a sentence says so,
//           and so it goes with those who cannot do without it. The others run.
// Cost      as the annotators; two locks for each of them
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "rgbd/pipeline/flow.h"

namespace sherlog::rgbd {

struct AnnotatorRun {
  std::string annotator;
  double milliseconds = 0;
  std::string problem = {};  // empty: it did what it should
  bool ran = false;          // false: what it reads was missing
};

// In the order of the flow. `threads` 0: as many as the machine has. Throws std::bad_alloc where an annotator did.
std::vector<AnnotatorRun> run_flow(const Annotators& annotators, const Flow& flow, Analysis& analysis,
                                   std::uint32_t threads = 1);

// Table 2: mean and sample standard deviation of each annotator over the frames, and of their sum.
class RunTimes {
 public:
  struct Row {
    std::string annotator;
    std::uint64_t runs = 0, failures = 0;
    double mean = 0, deviation = 0;  // milliseconds
  };
  void add(const std::vector<AnnotatorRun>& runs);
  std::vector<Row> rows() const;
  Row total() const;  // by frame: the sum over its annotators

 private:
  struct Sums {
    std::string annotator;
    std::uint64_t runs = 0, failures = 0;
    double mean = 0, squares = 0;  // Welford
    void add(double value);
    Row row() const;
  };
  std::vector<Sums> sums_;
  Sums total_{"total"};
};

}  // namespace sherlog::rgbd
