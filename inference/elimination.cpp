#include "inference/elimination.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

namespace sherlog {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
// Natural logarithm of the smallest number that products may reach: well above 2^-1022, the smallest normal double.
constexpr double kSafeLog = -650.0;
// A product of plain numbers outside of these bounds is done again on logarithms.
constexpr double kTiny = 1e-200, kHuge = 1e200;
constexpr std::uint64_t kLargeTable = std::uint64_t{1}
                                      << 18;  // from here on every step of a bucket asks whether to stop

// Calls visit(begin, offset, count, stride) for the innermost runs of a joined table, in its order: its entries
// begin..begin+count-1 meet the smaller table's entries offset, offset + stride, ...
template <class Visit>
void walk(std::span<const BucketTree::Loop> loops, Visit&& visit) {
  std::array<std::uint32_t, 64> counter{};
  const BucketTree::Loop inner = loops.back();
  const std::size_t depth = loops.size() - 1;
  std::size_t begin = 0, offset = 0;
  while (true) {
    visit(begin, offset, inner.count, inner.stride);
    begin += inner.count;
    std::size_t d = depth;
    while (d > 0) {
      --d;
      offset += loops[d].stride;
      if (++counter[d] < loops[d].count) break;
      offset -= std::size_t{loops[d].stride} * loops[d].count;
      counter[d] = 0;
      if (d == 0) return;
    }
    if (depth == 0) return;
  }
}

template <class Combine>
void combine_into(std::span<const BucketTree::Loop> loops, const double* in, double* out, Combine combine) {
  walk(loops, [&](std::size_t begin, std::size_t offset, std::uint32_t count, std::uint32_t stride) {
    double* target = out + begin;
    const double* source = in + offset;
    if (stride == 0) {
      const double value = *source;
      for (std::uint32_t i = 0; i < count; ++i) target[i] = combine(target[i], value);
    } else if (stride == 1) {
      for (std::uint32_t i = 0; i < count; ++i) target[i] = combine(target[i], source[i]);
    } else {
      for (std::uint32_t i = 0; i < count; ++i) target[i] = combine(target[i], source[std::size_t{i} * stride]);
    }
  });
}

// Sums a joined table over whatever the smaller table lacks.
void sum_onto(std::span<const BucketTree::Loop> loops, const double* joined, double* out) {
  walk(loops, [&](std::size_t begin, std::size_t offset, std::uint32_t count, std::uint32_t stride) {
    const double* source = joined + begin;
    double* target = out + offset;
    if (stride == 0) {
      double sum = 0.0;
      for (std::uint32_t i = 0; i < count; ++i) sum += source[i];
      *target += sum;
    } else {
      for (std::uint32_t i = 0; i < count; ++i) target[std::size_t{i} * stride] += source[i];
    }
  });
}

constexpr auto kTimes = [](double a, double b) { return a * b; };
constexpr auto kPlus = [](double a, double b) { return a + b; };

std::vector<std::uint64_t> starts(std::size_t count, auto size_of) {
  std::vector<std::uint64_t> start(count + 1, 0);
  for (std::size_t i = 0; i < count; ++i) start[i + 1] = start[i] + size_of(i);
  return start;
}

}  // namespace

// ---------------------------------------------------------------------------------------------------------------------
// BucketTree

BucketTree::BucketTree(std::span<const std::uint32_t> cardinalities, std::span<const std::vector<std::uint32_t>> scopes,
                       std::span<const std::uint32_t> order)
    : cardinalities_(cardinalities.begin(), cardinalities.end()), stride_of_(cardinalities.size(), 0) {
  const std::size_t n = cardinalities.size();
  std::vector<std::uint32_t> position(n, 0);
  for (std::uint32_t i = 0; i < order.size(); ++i) position[order[i]] = i;

  // Inputs of each bucket: (is message, index), tables first.
  std::vector<std::vector<std::pair<bool, std::uint32_t>>> inbox(n);
  for (std::uint32_t t = 0; t < scopes.size(); ++t) {
    std::uint64_t size = 1;
    std::uint32_t first = std::numeric_limits<std::uint32_t>::max();
    for (const std::uint32_t v : scopes[t]) {
      size *= cardinalities_[v];
      first = std::min(first, position[v]);
    }
    table_sizes_.push_back(size);
    inbox[first].emplace_back(false, t);
  }

  std::vector<std::vector<std::uint32_t>> message_scope(n);
  std::vector<std::uint32_t> stamp(n, 0);
  buckets_.reserve(n);
  for (std::uint32_t b = 0; b < n; ++b) {
    const std::uint32_t v = order[b];
    std::vector<std::uint32_t> joined;
    const auto collect = [&](std::span<const std::uint32_t> scope) {
      for (const std::uint32_t u : scope) {
        if (u == v || stamp[u] == b + 1) continue;
        stamp[u] = b + 1;
        joined.push_back(u);
      }
    };
    for (const auto& [is_message, index] : inbox[b]) collect(is_message ? message_scope[index] : scopes[index]);
    std::sort(joined.begin(), joined.end(),
              [&](std::uint32_t a, std::uint32_t c) { return position[a] > position[c]; });

    Bucket bucket;
    bucket.variable = v;
    bucket.cardinality = cardinalities_[v];
    for (const std::uint32_t u : joined) bucket.message_size *= cardinalities_[u];
    message_scope[b] = joined;
    joined.push_back(v);
    bucket.input_begin = static_cast<std::uint32_t>(inputs_.size());
    for (const auto& [is_message, index] : inbox[b]) {
      place_input(bucket, joined, is_message ? message_scope[index] : scopes[index], is_message, index);
      if (is_message) std::vector<std::uint32_t>().swap(message_scope[index]);
    }
    bucket.input_end = static_cast<std::uint32_t>(inputs_.size());
    if (!message_scope[b].empty()) inbox[position[message_scope[b].back()]].emplace_back(true, b);
    const std::uint64_t size = bucket.message_size * bucket.cardinality;
    largest_joined_ = std::max(largest_joined_, size);
    total_joined_ += size;
    total_messages_ += bucket.message_size;
    buckets_.push_back(bucket);
    std::vector<std::pair<bool, std::uint32_t>>().swap(inbox[b]);
  }
}

void BucketTree::place_input(Bucket& bucket, const std::vector<std::uint32_t>& joined,
                             std::span<const std::uint32_t> scope, bool is_message, std::uint32_t index) {
  Input input;
  input.is_message = is_message;
  input.index = index;
  input.coordinate_begin = static_cast<std::uint32_t>(coordinates_.size());
  std::uint32_t stride = 1;
  for (std::size_t i = scope.size(); i-- > 0;) {
    stride_of_[scope[i]] = stride;
    if (scope[i] == bucket.variable) {
      input.own_stride = stride;
    } else {
      coordinates_.push_back({scope[i], stride});
    }
    stride *= cardinalities_[scope[i]];
  }
  input.coordinate_end = static_cast<std::uint32_t>(coordinates_.size());

  std::array<Loop, 64> fused;  // innermost first
  std::size_t count = 0;
  for (std::size_t d = joined.size(); d-- > 0;) {
    const std::uint32_t cardinality = cardinalities_[joined[d]];
    if (cardinality == 1) continue;
    const std::uint32_t step = stride_of_[joined[d]];
    if (count > 0) {
      Loop& last = fused[count - 1];
      const bool continues = last.stride == 0 ? step == 0 : step == last.stride * last.count;
      if (continues) {
        last.count *= cardinality;
        continue;
      }
    }
    fused[count++] = {cardinality, step};
  }
  if (count == 0) fused[count++] = {1, 0};
  input.loop_begin = static_cast<std::uint32_t>(loops_.size());
  for (std::size_t i = count; i-- > 0;) loops_.push_back(fused[i]);
  input.loop_end = static_cast<std::uint32_t>(loops_.size());
  for (const std::uint32_t v : scope) stride_of_[v] = 0;
  inputs_.push_back(input);
}

// ---------------------------------------------------------------------------------------------------------------------
// Two waves of messages

namespace {

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
      believe(b);
      if (with_table_marginals) project_on_tables(b);
      answer_children(b);
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

  // Turns the joined table into the (plain, normalised) belief and takes the variable's marginal from it.
  void believe(std::size_t b) {
    const auto& bucket = tree_.buckets()[b];
    const std::size_t size = bucket.message_size * bucket.cardinality;
    double* belief = joined_.data();
    if constexpr (kLogarithms) {
      const double top = *std::max_element(belief, belief + size);
      for (std::size_t i = 0; i < size; ++i) belief[i] = std::exp(belief[i] - top);
    }
    auto& marginal = result_.marginals[bucket.variable];
    marginal.assign(bucket.cardinality, 0.0);
    for (std::size_t i = 0; i < size; i += bucket.cardinality) {
      for (std::uint32_t k = 0; k < bucket.cardinality; ++k) marginal[k] += belief[i + k];
    }
    double sum = 0.0;
    for (const double p : marginal) sum += p;
    for (double& p : marginal) p /= sum;
    for (std::size_t i = 0; i < size; ++i) belief[i] /= sum;
  }

  void project_on_tables(std::size_t b) {
    for (const auto& input : tree_.inputs(tree_.buckets()[b])) {
      if (input.is_message) continue;
      auto& marginal = result_.table_marginals[input.index];
      marginal.assign(tree_.table_sizes()[input.index], 0.0);
      sum_onto(tree_.loops(input), joined_.data(), marginal.data());
    }
  }

  // Overwrites each child's message with what the rest of the tree knows and the child does not.
  void answer_children(std::size_t b) {
    for (const auto& input : tree_.inputs(tree_.buckets()[b])) {
      if (!input.is_message) continue;
      const std::size_t size = tree_.buckets()[input.index].message_size;
      double* message = messages_.data() + message_start_[input.index];
      separator_.assign(size, 0.0);
      sum_onto(tree_.loops(input), joined_.data(), separator_.data());
      for (std::size_t i = 0; i < size; ++i) {
        if constexpr (kLogarithms) {
          message[i] = separator_[i] > 0.0 ? std::log(separator_[i]) - message[i] : -kInfinity;
        } else {
          message[i] = separator_[i] > 0.0 ? separator_[i] / message[i] : 0.0;
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

// ---------------------------------------------------------------------------------------------------------------------
// EliminationPlan

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
