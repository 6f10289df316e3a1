// Variable elimination on a tree of buckets: sums, maxima and exact draws of a product of tables.
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

#include "inference/elimination_order.h"
#include "inference/rng.h"
#include "mln/monitor.h"

namespace sherlog {

// The symbolic half: which table goes where, and how to walk through it.
class BucketTree {
 public:
  static constexpr double kMaxJoinedLog2 = 31.0;

  // How a smaller table is walked while a joined table is walked in order: nested loops, outermost first, neighbours
  // fused.
  struct Loop {
    std::uint32_t count = 1;
    std::uint32_t stride = 0;
  };
  struct Coordinate {
    std::uint32_t variable;
    std::uint32_t stride;
  };
  struct Input {
    bool is_message = false;
    std::uint32_t index = 0;  // of the table, or of the bucket that sends
    std::uint32_t loop_begin = 0, loop_end = 0;
    std::uint32_t own_stride = 0;                            // of the bucket's variable
    std::uint32_t coordinate_begin = 0, coordinate_end = 0;  // of the other variables
  };
  struct Bucket {
    std::uint32_t variable = 0;
    std::uint32_t cardinality = 1;
    std::uint32_t input_begin = 0, input_end = 0;
    std::uint64_t message_size = 1;  // joined table: message_size * cardinality, the bucket's variable runs fastest
  };

  BucketTree() = default;
  // Tables are dense, the last variable of a scope runs fastest. No scope is empty. `order` holds every
  // variable once. Joined tables must have fewer than 2^kMaxJoinedLog2 entries.
  BucketTree(std::span<const std::uint32_t> cardinalities, std::span<const std::vector<std::uint32_t>> scopes,
             std::span<const std::uint32_t> order);

  std::size_t variable_count() const { return cardinalities_.size(); }
  std::uint32_t cardinality(std::uint32_t variable) const { return cardinalities_[variable]; }
  std::span<const Bucket> buckets() const { return buckets_; }
  std::span<const Input> inputs(const Bucket& b) const {
    return {inputs_.data() + b.input_begin, b.input_end - b.input_begin};
  }
  std::span<const Loop> loops(const Input& i) const {
    return {loops_.data() + i.loop_begin, i.loop_end - i.loop_begin};
  }
  std::span<const Coordinate> coordinates(const Input& i) const {
    return {coordinates_.data() + i.coordinate_begin, i.coordinate_end - i.coordinate_begin};
  }
  std::span<const std::uint64_t> table_sizes() const { return table_sizes_; }
  std::uint64_t largest_joined() const { return largest_joined_; }
  std::uint64_t total_joined() const { return total_joined_; }      // entries of all joined tables
  std::uint64_t total_messages() const { return total_messages_; }  // entries of all messages

 private:
  void place_input(Bucket& bucket, const std::vector<std::uint32_t>& joined, std::span<const std::uint32_t> scope,
                   bool is_message, std::uint32_t index);

  std::vector<std::uint32_t> cardinalities_;
  std::vector<Bucket> buckets_;  // in elimination order
  std::vector<Input> inputs_;
  std::vector<Loop> loops_;
  std::vector<Coordinate> coordinates_;
  std::vector<std::uint64_t> table_sizes_;
  std::vector<std::uint32_t> stride_of_;  // scratch, by variable
  std::uint64_t largest_joined_ = 1, total_joined_ = 0, total_messages_ = 0;
};

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

// Exact draws from the product of a few tables whose contents change and whose shape does not: built once, then
// filled, prepared and drawn from as often as one likes without an allocation. A table is in plain (not logarithmic)
// numbers >= 0; its last variable runs fastest; no scope is empty.
class EliminationPlan {
 public:
  EliminationPlan(std::vector<std::uint32_t> cardinalities, std::vector<std::vector<std::uint32_t>> scopes,
                  const OrderLimits& limits = {});

  // Entries of all joined tables: the time of one `prepare`. Known before memory is taken: the tables are made by the
  // first call of `table` or `prepare`. Infinity where the tables cannot be numbered; then the plan is of no use.
  double cost() const { return cost_; }
  double largest_log2() const { return largest_log2_; }
  std::size_t memory_bytes() const;  // of the tables, made or not

  std::size_t variable_count() const { return tree_.variable_count(); }
  std::size_t table_count() const { return tree_.table_sizes().size(); }
  std::span<double> table(std::size_t index);

  // Sums the product up; false where it is zero everywhere. To be called after the tables were filled.
  bool prepare();
  // log of the sum of the product over all assignments, after `prepare` (-infinity where that said false).
  double log_partition() const { return log_partition_; }
  // One assignment with the product's probability; after `prepare` said true.
  void sample(Rng& rng, std::span<std::uint32_t> values);
  // log of the product's probability (normalised) of `values`, after `prepare` said true; -infinity where it is zero.
  double log_probability(std::span<const std::uint32_t> values);
  // `prepare` and `sample` in one; false where the product is zero everywhere.
  bool draw(Rng& rng, std::span<std::uint32_t> values) {
    if (!prepare()) return false;
    sample(rng, values);
    return true;
  }

 private:
  void allocate();
  void join(const BucketTree::Bucket& bucket, bool in_logarithms);
  std::span<const double> content(const BucketTree::Input& input) const;
  // Fills weights_ with the bucket's product given the values of later variables; returns their sum.
  double conditional(const BucketTree::Bucket& bucket, std::span<const std::uint32_t> values);

  BucketTree tree_;
  double cost_ = 0.0, largest_log2_ = 0.0;
  std::vector<double> storage_;  // tables, then messages
  std::vector<std::uint64_t> table_start_, message_start_;
  std::vector<double> joined_, weights_;
  double log_partition_ = 0.0;
};

}  // namespace sherlog
