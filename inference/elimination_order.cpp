#include "inference/elimination_order.h"

#include <algorithm>
#include <boost/graph/adjacency_list.hpp>
#include <boost/graph/minimum_degree_ordering.hpp>
#include <cmath>
#include <optional>
#include <queue>
#include <tuple>
#include <utility>

namespace sherlog {
namespace {

using Adjacency = std::vector<std::vector<std::uint32_t>>;  // sorted neighbours

constexpr std::uint32_t kDegreeForExactFill =
    400;                                  // beyond it the fill is bounded by degree^2 / 2: it is not competitive
constexpr double kHopelessMargin = 16.0;  // log2 beyond the limit where better orders are no longer sought
constexpr double kEndMargin = 64.0;       // log2 beyond the limit where an order is not even completed
constexpr double kWorthShuffling = 11.0;  // log2 of a largest table for which shuffled ties are tried
constexpr int kShuffles = 12;
constexpr std::uint64_t kStepsPerStopCheck = std::uint64_t{1} << 18;

struct Problem {
  Adjacency adjacency;
  std::vector<double> log2_cardinality;
  std::vector<std::uint32_t> prefix;  // eliminated beforehand: at most one neighbour each
  std::vector<bool> gone;             // in `prefix`
  double prefix_total = 0.0;          // entries
  double prefix_largest = 0.0;        // log2
};

// log2 of a sum of table sizes, kept as a plain sum until it overflows: tables beyond 2^1000 are all "infinite".
double entries(double log2_size) { return std::exp2(std::min(log2_size, 1000.0)); }

Problem make_problem(std::span<const std::uint32_t> cardinalities, std::span<const std::vector<std::uint32_t>> scopes) {
  Problem problem;
  const std::size_t n = cardinalities.size();
  problem.adjacency.resize(n);
  problem.log2_cardinality.reserve(n);
  for (const std::uint32_t k : cardinalities) problem.log2_cardinality.push_back(std::log2(std::max(k, 1u)));
  for (const auto& scope : scopes) {
    for (const std::uint32_t a : scope) {
      for (const std::uint32_t b : scope) {
        if (a != b) problem.adjacency[a].push_back(b);
      }
    }
  }
  for (auto& neighbours : problem.adjacency) {
    std::sort(neighbours.begin(), neighbours.end());
    neighbours.erase(std::unique(neighbours.begin(), neighbours.end()), neighbours.end());
  }
  return problem;
}

// Moves vertices with at most one remaining neighbour to the prefix, again and again.
void strip_leaves(Problem& problem) {
  const std::size_t n = problem.adjacency.size();
  problem.gone.assign(n, false);
  std::vector<std::uint32_t> degree(n), queue;
  for (std::uint32_t v = 0; v < n; ++v) {
    degree[v] = static_cast<std::uint32_t>(problem.adjacency[v].size());
    if (degree[v] <= 1) queue.push_back(v);
  }
  for (std::size_t head = 0; head < queue.size(); ++head) {
    const std::uint32_t v = queue[head];
    if (problem.gone[v]) continue;
    problem.gone[v] = true;
    problem.prefix.push_back(v);
    double weight = problem.log2_cardinality[v];
    for (const std::uint32_t u : problem.adjacency[v]) {
      if (problem.gone[u]) continue;
      weight += problem.log2_cardinality[u];
      if (--degree[u] == 1) queue.push_back(u);
    }
    problem.prefix_total += entries(weight);
    problem.prefix_largest = std::max(problem.prefix_largest, weight);
  }
  for (std::uint32_t v = 0; v < n; ++v) {
    auto& neighbours = problem.adjacency[v];
    if (problem.gone[v]) {
      neighbours.clear();
    } else {
      std::erase_if(neighbours, [&](std::uint32_t u) { return problem.gone[u]; });
    }
  }
}

// The graph while variables are eliminated, with the greedy scores.
class Elimination {
 public:
  enum class Rule { kWeight, kFill };

  Elimination(const Problem& problem, std::uint64_t& steps_left, const OrderLimits& limits)
      : problem_(problem),
        adjacency_(problem.adjacency),
        steps_left_(steps_left),
        stop_(limits.stop),
        mark_(adjacency_.size(), 0),
        give_up_log2_(limits.max_table_log2 + kEndMargin) {
    total_ = problem.prefix_total;
    largest_ = problem.prefix_largest;
    order_ = problem.prefix;
    // Whoever gave up once does not start again.
    abandoned_ = limits.stop != nullptr && limits.stop->reached();
  }

  // Gives up beyond `abandon_total` entries (an order at least as good is known).
  EliminationOrder greedy(Rule rule, std::uint64_t shuffle, double abandon_total) {
    rule_ = rule;
    shuffle_ = shuffle;
    score_all();
    while (!heap_.empty() && !abandoned_) {
      const Entry entry = heap_.top();
      heap_.pop();
      if (entry.version == version_[entry.vertex]) eliminate(entry.vertex, true, abandon_total);
    }
    return result();
  }

  // First what makes no new edges (that is optimal), then the rest in the given order.
  EliminationOrder follow(std::span<const std::uint32_t> order, double abandon_total) {
    rule_ = Rule::kFill;
    score_all();
    std::vector<bool> gone = problem_.gone;
    while (!heap_.empty() && !abandoned_ && heap_.top().primary <= 0.0) {
      const Entry entry = heap_.top();
      heap_.pop();
      if (entry.version != version_[entry.vertex]) continue;
      gone[entry.vertex] = true;
      eliminate(entry.vertex, true, abandon_total);
    }
    for (const std::uint32_t v : order) {
      if (abandoned_) break;
      if (!gone[v]) eliminate(v, false, abandon_total);
    }
    return result();
  }

 private:
  struct Entry {
    double primary, secondary;
    std::uint64_t tie;
    std::uint32_t vertex, version;
    bool operator>(const Entry& other) const {
      return std::tie(primary, secondary, tie, vertex) >
             std::tie(other.primary, other.secondary, other.tie, other.vertex);
    }
  };

  EliminationOrder result() {
    EliminationOrder out;
    out.complete = !abandoned_;
    if (out.complete) out.order = std::move(order_);
    out.largest_log2 = largest_;
    out.total_log2 = total_ > 0 ? std::log2(total_) : 0.0;
    return out;
  }

  void spend(std::uint64_t steps) {
    if (steps_left_ < steps) {
      steps_left_ = 0;
      abandoned_ = true;
    } else {
      const std::uint64_t before = steps_left_;
      steps_left_ -= steps;
      if (stop_ != nullptr && before / kStepsPerStopCheck != steps_left_ / kStepsPerStopCheck && stop_->reached())
        abandoned_ = true;
    }
  }

  void score_all() {
    const std::size_t n = adjacency_.size();
    version_.assign(n, 0);
    weight_.assign(n, 0.0);
    fill_.assign(n, 0);
    for (std::uint32_t v = 0; v < n; ++v) {
      if (abandoned_) return;
      if (!problem_.gone[v]) rescore(v);
    }
  }

  void rescore(std::uint32_t v) {
    double weight = problem_.log2_cardinality[v];
    for (const std::uint32_t u : adjacency_[v]) weight += problem_.log2_cardinality[u];
    weight_[v] = weight;
    if (rule_ == Rule::kFill) fill_[v] = count_fill(v);
    spend(adjacency_[v].size() + 1);
    push(v);
  }

  void push(std::uint32_t v) {
    std::uint64_t tie = v;
    if (shuffle_ != 0) tie = (v + 1) * 0x9e3779b97f4a7c15u * (2 * shuffle_ + 1) >> 20;
    const double fill = static_cast<double>(fill_[v]);
    const bool by_fill = rule_ == Rule::kFill;
    heap_.push({by_fill ? fill : weight_[v], by_fill ? weight_[v] : 0.0, tie, v, ++version_[v]});
  }

  std::int64_t count_fill(std::uint32_t v) {
    const auto& neighbours = adjacency_[v];
    const auto degree = static_cast<std::int64_t>(neighbours.size());
    const std::int64_t pairs = degree * (degree - 1) / 2;
    if (degree > kDegreeForExactFill) return pairs;
    ++stamp_;
    for (const std::uint32_t u : neighbours) mark_[u] = stamp_;
    std::int64_t present = 0;
    for (const std::uint32_t u : neighbours) {
      spend(adjacency_[u].size());
      for (const std::uint32_t w : adjacency_[u]) present += mark_[w] == stamp_ ? 1 : 0;
    }
    return pairs - present / 2;
  }

  // An edge a-b is new: whoever sees both ends misses one edge less.
  void credit_common_neighbours(std::uint32_t a, std::uint32_t b) {
    const auto& left = adjacency_[a];
    const auto& right = adjacency_[b];
    spend(left.size() + right.size());
    for (std::size_t i = 0, j = 0; i < left.size() && j < right.size();) {
      if (left[i] < right[j]) {
        ++i;
      } else if (right[j] < left[i]) {
        ++j;
      } else {
        const std::uint32_t w = left[i];
        if (mark_[w] != stamp_ && adjacency_[w].size() <= kDegreeForExactFill) {
          --fill_[w];
          touched_.push_back(w);
        }
        ++i, ++j;
      }
    }
  }

  void eliminate(std::uint32_t v, bool scored, double abandon_total) {
    const std::vector<std::uint32_t> clique = std::move(adjacency_[v]);
    adjacency_[v].clear();
    double weight = problem_.log2_cardinality[v];
    for (const std::uint32_t u : clique) weight += problem_.log2_cardinality[u];
    total_ += entries(weight);
    largest_ = std::max(largest_, weight);
    order_.push_back(v);
    if (scored) ++version_[v];
    if (total_ > abandon_total || largest_ > give_up_log2_) {
      abandoned_ = true;
      return;
    }

    const bool track_fill = scored && rule_ == Rule::kFill;
    new_edges_.clear();
    for (const std::uint32_t u : clique) connect(u, v, clique, track_fill);
    if (!scored) return;
    touched_.clear();
    if (track_fill && !new_edges_.empty()) {
      ++stamp_;
      for (const std::uint32_t u : clique) mark_[u] = stamp_;  // rescored in full below
      for (const auto& [a, b] : new_edges_) {
        if (abandoned_) return;
        credit_common_neighbours(a, b);
      }
    }
    std::sort(touched_.begin(), touched_.end());
    touched_.erase(std::unique(touched_.begin(), touched_.end()), touched_.end());
    for (const std::uint32_t w : touched_) push(w);
    for (const std::uint32_t u : clique) {
      if (abandoned_) return;
      rescore(u);
    }
  }

  // Neighbours of u become (old and clique) without u and v.
  void connect(std::uint32_t u, std::uint32_t v, const std::vector<std::uint32_t>& clique, bool track_fill) {
    const auto& old = adjacency_[u];
    spend(old.size() + clique.size());
    merged_.clear();
    std::size_t i = 0, j = 0;
    while (i < old.size() || j < clique.size()) {
      if (j == clique.size() || (i < old.size() && old[i] < clique[j])) {
        if (old[i] != v) merged_.push_back(old[i]);
        ++i;
      } else if (i == old.size() || clique[j] < old[i]) {
        if (clique[j] != u) {
          merged_.push_back(clique[j]);
          if (track_fill && u < clique[j]) new_edges_.emplace_back(u, clique[j]);
        }
        ++j;
      } else {
        merged_.push_back(old[i]);
        ++i, ++j;
      }
    }
    adjacency_[u].assign(merged_.begin(), merged_.end());
  }

  const Problem& problem_;
  Adjacency adjacency_;
  std::uint64_t& steps_left_;
  const StopCondition* stop_;
  Rule rule_ = Rule::kWeight;
  std::uint64_t shuffle_ = 0;
  std::priority_queue<Entry, std::vector<Entry>, std::greater<>> heap_;  // lazy: entries of an old version are skipped
  std::vector<std::uint32_t> version_;
  std::vector<double> weight_;
  std::vector<std::int64_t> fill_;
  std::vector<std::uint32_t> mark_, merged_, touched_;
  std::vector<std::pair<std::uint32_t, std::uint32_t>> new_edges_;
  std::uint32_t stamp_ = 0;
  std::vector<std::uint32_t> order_;
  double total_ = 0.0, largest_ = 0.0;
  const double give_up_log2_;
  bool abandoned_ = false;
};

std::vector<std::uint32_t> minimum_degree(const Problem& problem) {
  using Graph = boost::adjacency_list<boost::vecS, boost::vecS, boost::directedS>;
  const std::size_t n = problem.adjacency.size();
  // Boost's function (1.74) reads past its last bucket where a vertex is joined to all others, complete graphs first
  // of all; an isolated vertex more gives it the missing bucket.
  const std::size_t padded = n + 1;
  Graph graph(padded);
  for (std::size_t v = 0; v < n; ++v) {
    for (const std::uint32_t u : problem.adjacency[v]) boost::add_edge(v, u, graph);
  }
  const auto index = boost::get(boost::vertex_index, graph);
  std::vector<int> degree(padded, 0), inverse_permutation(padded, 0), permutation(padded, 0), supernode(padded, 1);
  boost::minimum_degree_ordering(graph, boost::make_iterator_property_map(degree.begin(), index),
                                 inverse_permutation.data(), permutation.data(),
                                 boost::make_iterator_property_map(supernode.begin(), index), 0, index);
  std::vector<std::uint32_t> order;
  order.reserve(n);
  for (const int v : permutation) {
    if (v != static_cast<int>(n)) order.push_back(static_cast<std::uint32_t>(v));
  }
  return order;
}

}  // namespace

EliminationOrder find_elimination_order(std::span<const std::uint32_t> cardinalities,
                                        std::span<const std::vector<std::uint32_t>> scopes, const OrderLimits& limits,
                                        std::span<const std::uint32_t> sweep) {
  Problem problem = make_problem(cardinalities, scopes);
  strip_leaves(problem);
  std::uint64_t steps = limits.max_steps;
  const auto start = [&] { return Elimination(problem, steps, limits); };
  EliminationOrder best = start().greedy(Elimination::Rule::kWeight, 0, limits.max_total);
  // Within the limit at all, then least work.
  const auto fits = [&](const EliminationOrder& o) { return o.complete && o.largest_log2 <= limits.max_table_log2; };
  const auto improve = [&](EliminationOrder candidate) {
    if (!candidate.complete || (best.complete && fits(best) && !fits(candidate))) return;
    const bool newly_fits = fits(candidate) && !fits(best);
    if (!best.complete || newly_fits || candidate.total_log2 < best.total_log2) best = std::move(candidate);
  };
  const auto bound = [&] { return fits(best) ? std::exp2(best.total_log2) : limits.max_total; };

  const std::size_t rest = cardinalities.size() - problem.prefix.size();
  if (rest <= 2) return best;
  if (!sweep.empty() && best.largest_log2 > kWorthShuffling) improve(start().follow(sweep, bound()));
  if (best.largest_log2 > limits.max_table_log2 + kHopelessMargin) return best;
  improve(start().greedy(Elimination::Rule::kFill, 0, bound()));
  if (!limits.thorough || best.largest_log2 <= kWorthShuffling) return best;
  improve(start().follow(minimum_degree(problem), bound()));
  for (int i = 1; i <= kShuffles && steps > limits.max_steps / 2; ++i) {
    const auto rule = i % 3 == 0 ? Elimination::Rule::kWeight : Elimination::Rule::kFill;
    improve(start().greedy(rule, static_cast<std::uint64_t>(i), bound()));
  }
  return best;
}

}  // namespace sherlog
