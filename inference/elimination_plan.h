// Exact draws from a product of few tables whose contents change and whose shape does not.
//
// Idea      The elimination of elimination.h laid out once for many fillings: built, then filled, prepared and drawn from as
//           often as one likes without an allocation. The plan itself is constant: chains share it and own their fillings.
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
  // What one filling holds; a plan may have many, and many plans may share one in turn.
  struct Contents {
    std::vector<double> values;  // tables, then messages
    double log_partition = 0.0;  // of the sum of the product over all assignments, after `prepare`; -infinity: none
  };
  struct Scratch {
    std::vector<double> joined, weights;
  };

  EliminationPlan(std::vector<std::uint32_t> cardinalities, std::vector<std::vector<std::uint32_t>> scopes,
                  const OrderLimits& limits = {});

  // Entries of all joined tables: the time of one `prepare`. Infinity where the tables cannot be numbered; then the plan
  // is of no use.
  double cost() const { return cost_; }
  double largest_log2() const { return largest_log2_; }
  std::size_t memory_bytes() const;  // of contents and scratch

  std::size_t variable_count() const { return tree_.variable_count(); }
  std::size_t table_count() const { return tree_.table_sizes().size(); }
  // To be called before contents and scratch are used; only takes memory where there is too little.
  void make_room(Contents& contents, Scratch& scratch) const;
  std::span<double> table(Contents& contents, std::size_t index) const {
    return {contents.values.data() + table_start_[index], tree_.table_sizes()[index]};
  }

  // Sums the product up; false where it is zero everywhere. To be called after the tables were filled.
  bool prepare(Contents& contents, Scratch& scratch) const;
  // One assignment with the product's probability; after `prepare` said true.
  void sample(const Contents& contents, Scratch& scratch, Rng& rng, std::span<std::uint32_t> values) const;
  // log of the product's probability (normalised) of `values`, after `prepare` said true; -infinity where it is zero.
  double log_probability(const Contents& contents, Scratch& scratch, std::span<const std::uint32_t> values) const;

 private:
  void join(const BucketTree::Bucket& bucket, const Contents& contents, Scratch& scratch, bool in_logarithms) const;
  const double* content(const Contents& contents, const BucketTree::Input& input) const {
    return contents.values.data() + (input.is_message ? message_start_ : table_start_)[input.index];
  }
  // Fills scratch.weights with the bucket's product given the values of later variables; returns their sum.
  double conditional(const BucketTree::Bucket& bucket, const Contents& contents, Scratch& scratch,
                     std::span<const std::uint32_t> values) const;

  BucketTree tree_;
  double cost_ = 0.0, largest_log2_ = 0.0;
  std::uint32_t widest_ = 1;  // cardinality
  std::vector<std::uint64_t> table_start_, message_start_;
};

}  // namespace sherlog
