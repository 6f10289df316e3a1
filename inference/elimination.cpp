#include "inference/elimination.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "inference/table_walk.h"

namespace sherlog {
namespace {

using table_walk::combine_into;
using table_walk::kPlus;
using table_walk::kTimes;
using table_walk::starts;
using table_walk::sum_onto;

constexpr double kInfinity = std::numeric_limits<double>::infinity();
// Natural logarithm of the smallest number that products may reach: well above 2^-1022, the smallest normal double.
constexpr double kSafeLog = -650.0;
constexpr std::uint64_t kLargeTable = std::uint64_t{1}
                                      << 18;  // from here on every step of a bucket asks whether to stop

// kLogarithms: tables and messages are logarithms; else they are plain, each with maximum 1.
template <bool kLogarithms>
class TwoPasses {
 public:
  TwoPasses(const BucketTree& tree, const LogTables& tables, const StopCondition& stop)
      : tree_(tree), log_tables_(tables), stop_(stop) {
    const auto buckets = tree.buckets();
    message_start_ = starts(buckets.size(), [&](std::size_t b) { return buckets[b].message_size; });
  }

  // False: stopped (result().termination), impossible (log_partition) or in need of logarithms (underflow()).
  bool upward() {
    if (!load_tables()) return false;
    const auto buckets = tree_.buckets();
    messages_.resize(message_start_.back());
    range_.assign(buckets.size(), 0.0);
    joined_.resize(tree_.largest_joined());
    for (std::size_t b = 0; b < buckets.size(); ++b) {
      if (!kLogarithms && !safe(buckets[b])) {
        underflow_ = true;
        return false;
      }
      if (should_stop(b) || !join(b, false)) return false;
      if (!send(b)) return false;
    }
    return true;
  }

  bool downward(bool with_table_marginals) {
    const auto buckets = tree_.buckets();
    result_.marginals.resize(tree_.variable_count());
    if (with_table_marginals) result_.table_marginals.resize(log_tables_.size());
    // A root's message is a number; its belief needs no more than its own product.
    std::vector<bool> is_root(buckets.size(), true);
    for (const auto& bucket : buckets) {
      for (const auto& input : tree_.inputs(bucket)) {
        if (input.is_message) is_root[input.index] = false;
      }
    }
    for (std::size_t b = buckets.size(); b-- > 0;) {
      if (should_stop(b) || !join(b, !is_root[b])) return false;
      const double scale = believe(b);
      if (with_table_marginals) project_on_tables(b, scale);
      answer_children(b, scale);
    }
    return true;
  }

  bool underflow() const { return underflow_; }
  SumProductResult& result() { return result_; }

 private:
  bool load_tables() {
    if constexpr (kLogarithms) {
      return true;
    } else {
      plain_tables_.resize(log_tables_.size());
      table_range_.assign(log_tables_.size(), 0.0);
      for (std::size_t t = 0; t < log_tables_.size(); ++t) {
        const auto& logs = log_tables_[t];
        const double top = *std::max_element(logs.begin(), logs.end());
        if (top == -kInfinity) {
          result_.log_partition = -kInfinity;
          return false;
        }
        result_.log_partition += top;
        plain_tables_[t].reserve(logs.size());
        for (const double value : logs) {
          plain_tables_[t].push_back(std::exp(value - top));
          if (value > -kInfinity) table_range_[t] = std::min(table_range_[t], value - top);
        }
      }
      return true;
    }
  }

  bool safe(const BucketTree::Bucket& bucket) const {
    double smallest = 0.0;
    for (const auto& input : tree_.inputs(bucket)) {
      smallest += input.is_message ? range_[input.index] : table_range_[input.index];
    }
    return smallest > kSafeLog;
  }

  bool should_stop(std::size_t bucket) {
    const auto& b = tree_.buckets()[bucket];
    entries_since_check_ += b.message_size * b.cardinality + 100;
    if (entries_since_check_ < kLargeTable) return false;
    entries_since_check_ = 0;
    return stop_now();
  }
  bool stop_now() {
    if (!stop_.reached()) return false;
    result_.termination = stop_.reason();
    return true;
  }

  const double* content(const BucketTree::Input& input) const {
    if (input.is_message) return messages_.data() + message_start_[input.index];
    return kLogarithms ? log_tables_[input.index].data() : plain_tables_[input.index].data();
  }

  bool join(std::size_t b, bool with_own_message) {
    const auto& bucket = tree_.buckets()[b];
    const std::size_t size = bucket.message_size * bucket.cardinality;
    double* out = joined_.data();
    if (with_own_message) {
      const double* down = messages_.data() + message_start_[b];
      for (std::size_t i = 0; i < bucket.message_size; ++i) {
        std::fill_n(out + i * bucket.cardinality, bucket.cardinality, down[i]);
      }
    } else {
      std::fill_n(out, size, kLogarithms ? 0.0 : 1.0);
    }
    for (const auto& input : tree_.inputs(bucket)) {
      if constexpr (kLogarithms) {
        combine_into(tree_.loops(input), content(input), out, kPlus);
      } else {
        combine_into(tree_.loops(input), content(input), out, kTimes);
      }
      if (size >= kLargeTable && stop_now()) return false;
    }
    return true;
  }

  // Sums the bucket's variable out of the joined table into its message, scaled to maximum 1 (or 0 as a logarithm).
  bool send(std::size_t b) {
    const auto& bucket = tree_.buckets()[b];
    double* message = messages_.data() + message_start_[b];
    const std::uint32_t k = bucket.cardinality;
    double top = kLogarithms ? -kInfinity : 0.0;
    for (std::size_t i = 0; i < bucket.message_size; ++i) {
      const double* row = joined_.data() + i * k;
      message[i] = kLogarithms ? log_sum(row, k) : plain_sum(row, k);
      top = std::max(top, message[i]);
    }
    if (top <= (kLogarithms ? -kInfinity : 0.0)) {
      result_.log_partition = -kInfinity;
      return false;
    }
    if constexpr (kLogarithms) {
      result_.log_partition += top;
      for (std::size_t i = 0; i < bucket.message_size; ++i) message[i] -= top;
    } else {
      result_.log_partition += std::log(top);
      double smallest = 1.0;
      for (std::size_t i = 0; i < bucket.message_size; ++i) {
        message[i] /= top;
        if (message[i] > 0.0) smallest = std::min(smallest, message[i]);
      }
      range_[b] = std::log(smallest);
    }
    return true;
  }

  static double plain_sum(const double* row, std::uint32_t k) {
    double sum = 0.0;
    for (std::uint32_t j = 0; j < k; ++j) sum += row[j];
    return sum;
  }
  static double log_sum(const double* row, std::uint32_t k) {
    double top = row[0];
    for (std::uint32_t j = 1; j < k; ++j) top = std::max(top, row[j]);
    if (top == -kInfinity) return top;
    double sum = 0.0;
    for (std::uint32_t j = 0; j < k; ++j) sum += std::exp(row[j] - top);
    return top + std::log(sum);
  }

  // Turns the joined table into the plain belief and takes the variable's marginal from it. Returns what the belief has to
  // be multiplied with to sum to one: those who sum over it do so after summing, when fewer numbers are left.
  double believe(std::size_t b) {
    const auto& bucket = tree_.buckets()[b];
    const std::size_t size = bucket.message_size * bucket.cardinality;
    double* belief = joined_.data();
    if constexpr (kLogarithms) {
      const double top = *std::max_element(belief, belief + size);
      for (std::size_t i = 0; i < size; ++i) belief[i] = std::exp(belief[i] - top);
    }
    auto& marginal = result_.marginals[bucket.variable];
    marginal.assign(bucket.cardinality, 0.0);
    if (bucket.cardinality == 2) {  // most are; the sums stay in registers
      double first = 0.0, second = 0.0;
      for (std::size_t i = 0; i < size; i += 2) {
        first += belief[i];
        second += belief[i + 1];
      }
      marginal = {first, second};
    } else {
      for (std::size_t i = 0; i < size; i += bucket.cardinality) {
        for (std::uint32_t k = 0; k < bucket.cardinality; ++k) marginal[k] += belief[i + k];
      }
    }
    double sum = 0.0;
    for (const double p : marginal) sum += p;
    for (double& p : marginal) p /= sum;
    return 1.0 / sum;
  }

  void project_on_tables(std::size_t b, double scale) {
    for (const auto& input : tree_.inputs(tree_.buckets()[b])) {
      if (input.is_message) continue;
      auto& marginal = result_.table_marginals[input.index];
      marginal.assign(tree_.table_sizes()[input.index], 0.0);
      sum_onto(tree_.loops(input), joined_.data(), marginal.data());
      for (double& p : marginal) p *= scale;
    }
  }

  // Overwrites each child's message with what the rest of the tree knows and the child does not.
  void answer_children(std::size_t b, double scale) {
    for (const auto& input : tree_.inputs(tree_.buckets()[b])) {
      if (!input.is_message) continue;
      const std::size_t size = tree_.buckets()[input.index].message_size;
      double* message = messages_.data() + message_start_[input.index];
      separator_.assign(size, 0.0);
      sum_onto(tree_.loops(input), joined_.data(), separator_.data());
      for (std::size_t i = 0; i < size; ++i) {
        const double sum = separator_[i] * scale;
        if constexpr (kLogarithms) {
          message[i] = sum > 0.0 ? std::log(sum) - message[i] : -kInfinity;
        } else {
          message[i] = sum > 0.0 ? sum / message[i] : 0.0;
        }
      }
    }
  }

  const BucketTree& tree_;
  const LogTables& log_tables_;
  const StopCondition& stop_;
  LogTables plain_tables_;
  std::vector<std::uint64_t> message_start_;
  std::vector<double> messages_, joined_, separator_;
  std::vector<double> table_range_, range_;  // log of the smallest nonzero entry
  std::uint64_t entries_since_check_ = 0;
  bool underflow_ = false;
  SumProductResult result_;
};

template <bool kLogarithms>
SumProductResult finish(TwoPasses<kLogarithms>& passes, bool possible, bool with_marginals, bool with_table_marginals) {
  SumProductResult& result = passes.result();
  if (possible && (with_marginals || with_table_marginals)) passes.downward(with_table_marginals);
  if (result.termination != Termination::kCompleted || !possible) {
    result.marginals.clear();
    result.table_marginals.clear();
  }
  result.in_logarithms = kLogarithms;
  return std::move(result);
}

}  // namespace

SumProductResult sum_product(const BucketTree& tree, const LogTables& tables, const StopCondition& stop,
                             bool with_marginals, bool with_table_marginals) {
  {
    TwoPasses<false> passes(tree, tables, stop);
    const bool possible = passes.upward();
    if (!passes.underflow()) return finish(passes, possible, with_marginals, with_table_marginals);
  }
  return sum_product_in_logarithms(tree, tables, stop, with_marginals, with_table_marginals);
}

SumProductResult sum_product_in_logarithms(const BucketTree& tree, const LogTables& tables, const StopCondition& stop,
                                           bool with_marginals, bool with_table_marginals) {
  TwoPasses<true> passes(tree, tables, stop);
  const bool possible = passes.upward();
  return finish(passes, possible, with_marginals, with_table_marginals);
}

MaxSumResult max_sum(const BucketTree& tree, const LogTables& tables, const StopCondition& stop) {
  MaxSumResult result;
  const auto buckets = tree.buckets();
  const auto start = starts(buckets.size(), [&](std::size_t b) { return buckets[b].message_size; });
  std::vector<double> messages(start.back()), joined(tree.largest_joined());
  const auto content = [&](const BucketTree::Input& input) {
    return input.is_message ? messages.data() + start[input.index] : tables[input.index].data();
  };
  std::vector<bool> is_root(buckets.size(), true);
  std::uint64_t since_check = 0;
  for (std::size_t b = 0; b < buckets.size(); ++b) {
    const auto& bucket = buckets[b];
    const std::size_t size = bucket.message_size * bucket.cardinality;
    since_check += size + 100;
    if (since_check >= kLargeTable) {
      since_check = 0;
      if (stop.reached()) {
        result.termination = stop.reason();
        return result;
      }
    }
    std::fill_n(joined.begin(), size, 0.0);
    for (const auto& input : tree.inputs(bucket)) {
      combine_into(tree.loops(input), content(input), joined.data(), kPlus);
      if (input.is_message) is_root[input.index] = false;
    }
    for (std::size_t i = 0; i < bucket.message_size; ++i) {
      const double* row = joined.data() + i * bucket.cardinality;
      messages[start[b] + i] = *std::max_element(row, row + bucket.cardinality);
    }
  }
  for (std::size_t b = 0; b < buckets.size(); ++b) {
    if (is_root[b]) result.log_maximum += messages[start[b]];
  }
  result.values.assign(tree.variable_count(), 0);
  if (result.log_maximum == -kInfinity) return result;
  for (std::size_t b = buckets.size(); b-- > 0;) {
    const auto& bucket = buckets[b];
    double best = -kInfinity;
    for (std::uint32_t k = 0; k < bucket.cardinality; ++k) {
      double value = 0.0;
      for (const auto& input : tree.inputs(bucket)) {
        std::size_t offset = std::size_t{k} * input.own_stride;
        for (const auto& c : tree.coordinates(input)) offset += std::size_t{result.values[c.variable]} * c.stride;
        value += content(input)[offset];
      }
      if (value > best) {
        best = value;
        result.values[bucket.variable] = k;
      }
    }
  }
  return result;
}

}  // namespace sherlog
