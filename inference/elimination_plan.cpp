#include "inference/elimination_plan.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "inference/table_walk.h"

namespace sherlog {
namespace {

using table_walk::combine_into;
using table_walk::kTimes;
using table_walk::starts;

constexpr double kInfinity = std::numeric_limits<double>::infinity();
// A product of plain numbers outside of these bounds is done again on logarithms.
constexpr double kTiny = 1e-200, kHuge = 1e200;

}  // namespace

EliminationPlan::EliminationPlan(std::vector<std::uint32_t> cardinalities,
                                 std::vector<std::vector<std::uint32_t>> scopes, const OrderLimits& limits) {
  const EliminationOrder found = find_elimination_order(cardinalities, scopes, limits);
  largest_log2_ = found.largest_log2;
  cost_ = std::exp2(found.total_log2);
  if (!found.complete || largest_log2_ >= BucketTree::kMaxJoinedLog2) {
    cost_ = kInfinity;
    return;
  }
  tree_ = BucketTree(cardinalities, scopes, found.order);
  const auto buckets = tree_.buckets();
  table_start_ = starts(tree_.table_sizes().size(), [&](std::size_t t) { return tree_.table_sizes()[t]; });
  message_start_ = starts(buckets.size(), [&](std::size_t b) { return buckets[b].message_size; });
  for (std::uint64_t& start : message_start_) start += table_start_.back();
  for (const auto& bucket : buckets) widest_ = std::max(widest_, bucket.cardinality);
}

std::size_t EliminationPlan::memory_bytes() const {
  if (cost_ == kInfinity) return std::numeric_limits<std::size_t>::max();
  return (message_start_.back() + tree_.largest_joined()) * sizeof(double);
}

void EliminationPlan::make_room(Contents& contents, Scratch& scratch) const {
  if (cost_ == kInfinity) return;
  const auto grow = [](std::vector<double>& v, std::uint64_t size) {
    if (v.size() < size) v.resize(size);
  };
  grow(contents.values, message_start_.back());
  grow(scratch.joined, tree_.largest_joined());
  grow(scratch.weights, widest_);
}

void EliminationPlan::join(const BucketTree::Bucket& bucket, const Contents& contents, Scratch& scratch,
                           bool in_logarithms) const {
  const std::size_t size = bucket.message_size * bucket.cardinality;
  double* joined = scratch.joined.data();
  std::fill_n(joined, size, in_logarithms ? 0.0 : 1.0);
  for (const auto& input : tree_.inputs(bucket)) {
    const double* from = content(contents, input);
    if (in_logarithms) {
      combine_into(tree_.loops(input), from, joined, [](double a, double b) { return a + std::log(b); });
    } else {
      combine_into(tree_.loops(input), from, joined, kTimes);
    }
  }
}

bool EliminationPlan::prepare(Contents& contents, Scratch& scratch) const {
  contents.log_partition = -kInfinity;
  if (cost_ == kInfinity) return false;
  double log_sum = 0.0;
  const auto buckets = tree_.buckets();
  double* joined = scratch.joined.data();
  for (std::size_t b = 0; b < buckets.size(); ++b) {
    const auto& bucket = buckets[b];
    double* message = contents.values.data() + message_start_[b];
    join(bucket, contents, scratch, false);
    double top = 0.0;
    const auto reduce = [&] {
      top = 0.0;
      for (std::size_t i = 0; i < bucket.message_size; ++i) {
        double sum = 0.0;
        for (std::uint32_t k = 0; k < bucket.cardinality; ++k) sum += joined[i * bucket.cardinality + k];
        message[i] = sum;
        top = std::max(top, sum);
      }
    };
    reduce();
    double scale = 0.0;
    if (!(top > kTiny && top < kHuge)) {  // zero, or the product ran out of the range of doubles
      join(bucket, contents, scratch, true);
      const std::size_t size = bucket.message_size * bucket.cardinality;
      scale = *std::max_element(joined, joined + size);
      if (scale == -kInfinity) return false;
      for (std::size_t i = 0; i < size; ++i) joined[i] = std::exp(joined[i] - scale);
      reduce();
    }
    for (std::size_t i = 0; i < bucket.message_size; ++i) message[i] /= top;
    log_sum += std::log(top) + scale;
  }
  contents.log_partition = log_sum;
  return log_sum > -kInfinity;
}

double EliminationPlan::conditional(const BucketTree::Bucket& bucket, const Contents& contents, Scratch& scratch,
                                    std::span<const std::uint32_t> values) const {
  double* weights = scratch.weights.data();
  const auto fill = [&](bool in_logarithms) {
    double total = 0.0;
    for (std::uint32_t k = 0; k < bucket.cardinality; ++k) weights[k] = in_logarithms ? 0.0 : 1.0;
    for (const auto& input : tree_.inputs(bucket)) {
      std::size_t offset = 0;
      for (const auto& c : tree_.coordinates(input)) offset += std::size_t{values[c.variable]} * c.stride;
      const double* from = content(contents, input) + offset;
      for (std::uint32_t k = 0; k < bucket.cardinality; ++k) {
        const double entry = from[std::size_t{k} * input.own_stride];
        weights[k] = in_logarithms ? weights[k] + std::log(entry) : weights[k] * entry;
      }
    }
    for (std::uint32_t k = 0; k < bucket.cardinality; ++k) total += weights[k];
    return total;
  };
  double total = fill(false);
  if (total > kTiny && total < kHuge) return total;
  fill(true);
  const double top = *std::max_element(weights, weights + bucket.cardinality);
  total = 0.0;
  for (std::uint32_t k = 0; k < bucket.cardinality; ++k) {
    weights[k] = top == -kInfinity ? 0.0 : std::exp(weights[k] - top);
    total += weights[k];
  }
  return total;
}

void EliminationPlan::sample(const Contents& contents, Scratch& scratch, Rng& rng,
                             std::span<std::uint32_t> values) const {
  for (std::size_t b = tree_.buckets().size(); b-- > 0;) {
    const auto& bucket = tree_.buckets()[b];
    double rest = rng.uniform() * conditional(bucket, contents, scratch, values);
    std::uint32_t chosen = 0;
    for (std::uint32_t k = 0; k < bucket.cardinality; ++k) {
      if (scratch.weights[k] <= 0.0) continue;
      chosen = k;  // stays the last possible value where rounding leaves a remainder
      rest -= scratch.weights[k];
      if (rest < 0.0) break;
    }
    values[bucket.variable] = chosen;
  }
}

double EliminationPlan::log_probability(const Contents& contents, Scratch& scratch,
                                        std::span<const std::uint32_t> values) const {
  double sum = 0.0;
  for (std::size_t b = tree_.buckets().size(); b-- > 0;) {
    const auto& bucket = tree_.buckets()[b];
    const double total = conditional(bucket, contents, scratch, values);
    const double weight = scratch.weights[values[bucket.variable]];
    if (!(weight > 0.0)) return -kInfinity;
    sum += std::log(weight / total);
  }
  return sum;
}

}  // namespace sherlog
