// Exact draws from a product of few tables whose contents change and whose shape does not.
//
// Idea      The elimination of elimination.h laid out once for many fillings: built, then filled, prepared and drawn from as
//           often as one likes without an allocation.
// Numbers   Plain products with every message scaled to maximum 1; a bucket whose product leaves the range of doubles is
//           done again on logarithms.
// Cost      `prepare` O(cost()), a draw O(variables x their tables).
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "inference/bucket_tree.h"
#include "inference/elimination_order.h"
#include "inference/rng.h"

namespace sherlog {

// A table is in plain (not logarithmic) numbers >= 0; its last variable runs fastest; no scope is empty.
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
