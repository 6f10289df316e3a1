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
}

std::size_t EliminationPlan::memory_bytes() const {
  if (cost_ == kInfinity) return std::numeric_limits<std::size_t>::max();
  return (message_start_.back() + tree_.largest_joined()) * sizeof(double);
}

void EliminationPlan::allocate() {
  if (!storage_.empty() || cost_ == kInfinity) return;
  storage_.assign(std::max<std::uint64_t>(message_start_.back(), 1), 1.0);
  joined_.resize(tree_.largest_joined());
  std::uint32_t widest = 1;
  for (const auto& bucket : tree_.buckets()) widest = std::max(widest, bucket.cardinality);
  weights_.resize(widest);
}

std::span<double> EliminationPlan::table(std::size_t index) {
  allocate();
  return {storage_.data() + table_start_[index], tree_.table_sizes()[index]};
}

std::span<const double> EliminationPlan::content(const BucketTree::Input& input) const {
  if (input.is_message)
    return {storage_.data() + message_start_[input.index], tree_.buckets()[input.index].message_size};
  return {storage_.data() + table_start_[input.index], tree_.table_sizes()[input.index]};
}

void EliminationPlan::join(const BucketTree::Bucket& bucket, bool in_logarithms) {
  const std::size_t size = bucket.message_size * bucket.cardinality;
  std::fill_n(joined_.data(), size, in_logarithms ? 0.0 : 1.0);
  for (const auto& input : tree_.inputs(bucket)) {
    const double* from = content(input).data();
    if (in_logarithms) {
      combine_into(tree_.loops(input), from, joined_.data(), [](double a, double b) { return a + std::log(b); });
    } else {
      combine_into(tree_.loops(input), from, joined_.data(), kTimes);
    }
  }
}

bool EliminationPlan::prepare() {
  log_partition_ = -kInfinity;
  if (cost_ == kInfinity) return false;
  allocate();
  double log_sum = 0.0;
  const auto buckets = tree_.buckets();
  for (std::size_t b = 0; b < buckets.size(); ++b) {
    const auto& bucket = buckets[b];
    double* message = storage_.data() + message_start_[b];
    join(bucket, false);
    double top = 0.0;
    const auto reduce = [&] {
      top = 0.0;
      for (std::size_t i = 0; i < bucket.message_size; ++i) {
        double sum = 0.0;
        for (std::uint32_t k = 0; k < bucket.cardinality; ++k) sum += joined_[i * bucket.cardinality + k];
        message[i] = sum;
        top = std::max(top, sum);
      }
    };
    reduce();
    double scale = 0.0;
    if (!(top > kTiny && top < kHuge)) {  // zero, or the product ran out of the range of doubles
      join(bucket, true);
      const std::size_t size = bucket.message_size * bucket.cardinality;
      scale = *std::max_element(joined_.data(), joined_.data() + size);
      if (scale == -kInfinity) return false;
      for (std::size_t i = 0; i < size; ++i) joined_[i] = std::exp(joined_[i] - scale);
      reduce();
    }
    for (std::size_t i = 0; i < bucket.message_size; ++i) message[i] /= top;
    log_sum += std::log(top) + scale;
  }
  log_partition_ = log_sum;
  return log_sum > -kInfinity;
}

double EliminationPlan::conditional(const BucketTree::Bucket& bucket, std::span<const std::uint32_t> values) {
  const auto fill = [&](bool in_logarithms) {
    double total = 0.0;
    for (std::uint32_t k = 0; k < bucket.cardinality; ++k) weights_[k] = in_logarithms ? 0.0 : 1.0;
    for (const auto& input : tree_.inputs(bucket)) {
      std::size_t offset = 0;
      for (const auto& c : tree_.coordinates(input)) offset += std::size_t{values[c.variable]} * c.stride;
      const double* from = content(input).data() + offset;
      for (std::uint32_t k = 0; k < bucket.cardinality; ++k) {
        const double entry = from[std::size_t{k} * input.own_stride];
        weights_[k] = in_logarithms ? weights_[k] + std::log(entry) : weights_[k] * entry;
      }
    }
    for (std::uint32_t k = 0; k < bucket.cardinality; ++k) total += weights_[k];
    return total;
  };
  double total = fill(false);
  if (total > kTiny && total < kHuge) return total;
  fill(true);
  const double top = *std::max_element(weights_.begin(), weights_.begin() + bucket.cardinality);
  total = 0.0;
  for (std::uint32_t k = 0; k < bucket.cardinality; ++k) {
    weights_[k] = top == -kInfinity ? 0.0 : std::exp(weights_[k] - top);
    total += weights_[k];
  }
  return total;
}

void EliminationPlan::sample(Rng& rng, std::span<std::uint32_t> values) {
  for (std::size_t b = tree_.buckets().size(); b-- > 0;) {
    const auto& bucket = tree_.buckets()[b];
    double rest = rng.uniform() * conditional(bucket, values);
    std::uint32_t chosen = 0;
    for (std::uint32_t k = 0; k < bucket.cardinality; ++k) {
      if (weights_[k] <= 0.0) continue;
      chosen = k;  // stays the last possible value where rounding leaves a remainder
      rest -= weights_[k];
      if (rest < 0.0) break;
    }
    values[bucket.variable] = chosen;
  }
}

double EliminationPlan::log_probability(std::span<const std::uint32_t> values) {
  double sum = 0.0;
  for (std::size_t b = tree_.buckets().size(); b-- > 0;) {
    const auto& bucket = tree_.buckets()[b];
    const double total = conditional(bucket, values);
    const double weight = weights_[values[bucket.variable]];
    if (!(weight > 0.0)) return -kInfinity;
    sum += std::log(weight / total);
  }
  return sum;
}

}  // namespace sherlog
