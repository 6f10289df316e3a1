// Variable elimination on a tree of buckets: sums and maxima of a product of tables.
//
// Idea      Every variable has a bucket. A table goes to the bucket of whichever of its variables is eliminated first.
//           The bucket multiplies its tables and the messages it got, removes its variable (by sum or maximum) and
//           sends what is left to the bucket of the next variable in there. The last messages are numbers whose
//           product is the partition sum. Backwards, each bucket knows the distribution of its variable given the
//           later ones, which gives draws and most probable assignments; and a second wave of messages gives every
//           marginal: a bucket's belief, divided by what the child had sent, is what the child did not know (0/0 = 0:
//           what was impossible stays so). Only messages are stored; the joined table is a scratch that is made again
//           on the way back.
// Numbers   Plain products with every message scaled to maximum 1, as long as no product can underflow (the smallest
//           entry of each table is tracked); otherwise everything is done again on logarithms, at several times the
//           cost.
// Source    Dechter, Artificial Intelligence 113, 1999 (buckets); Jensen, Lauritzen & Olesen, CSQ 4, 1990 (division).
// Cost      time O(sum of joined tables x tables joined), memory: messages plus the largest joined table.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "inference/bucket_tree.h"
#include "mln/monitor.h"

namespace sherlog {

// Tables of natural logarithms (-infinity: impossible), in the layout of the tree's scopes.
using LogTables = std::vector<std::vector<double>>;

struct SumProductResult {
  Termination termination = Termination::kCompleted;  // or kInterrupted, kTimeLimit
  double log_partition = 0.0;                         // -infinity: nothing is possible, and there are no marginals
  std::vector<std::vector<double>> marginals;         // [variable][value]
  std::vector<std::vector<double>> table_marginals;   // [table][entry]: probability of that joint value of its scope
  bool in_logarithms = false;                         // plain products might have underflowed
};

// `with_table_marginals` asks for the others too.
SumProductResult sum_product(const BucketTree& tree, const LogTables& tables, const StopCondition& stop,
                             bool with_marginals = true, bool with_table_marginals = false);
// The second way of sum_product, on logarithms throughout.
SumProductResult sum_product_in_logarithms(const BucketTree& tree, const LogTables& tables, const StopCondition& stop,
                                           bool with_marginals = true, bool with_table_marginals = false);

struct MaxSumResult {
  Termination termination = Termination::kCompleted;
  double log_maximum = 0.0;           // -infinity: nothing is possible
  std::vector<std::uint32_t> values;  // by variable; the first of equals
};

MaxSumResult max_sum(const BucketTree& tree, const LogTables& tables, const StopCondition& stop);

}  // namespace sherlog
