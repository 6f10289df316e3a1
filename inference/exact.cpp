#include "inference/exact.h"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <condition_variable>
#include <limits>
#include <mutex>
#include <new>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "inference/bounded_sum.h"
#include "inference/conflict.h"
#include "inference/elimination.h"
#include "inference/parallel.h"
#include "inference/prepared_component.h"

namespace sherlog {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr std::size_t kSearchedVariables = 64;           // more are not tried by bounded search
constexpr std::uint64_t kSearchSteps = 1'500'000'000;    // two or three seconds
constexpr std::uint64_t kCheapSearchSteps = 60'000'000;  // a tenth of a second
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

struct Answer {
  bool started = false;
  Termination termination = Termination::kCompleted;
  std::string message;
  double log_partition = 0.0;         // or the best score
  std::vector<double> probabilities;  // by component query
  std::vector<std::uint32_t> values;  // by component variable
  std::vector<std::uint32_t> conflict;
};

// Tables, their logarithms as ratios, and what their entries weigh.
double search_bytes(const FactorGraph& graph) { return 4.0 * static_cast<double>(graph.table_bytes); }

bool to_be_searched(const PreparedComponent& prepared, const InferenceOptions& options) {
  const FactorGraph& graph = prepared.graph;
  return graph.possible && !graph.too_large && !graph.stopped && !narrow_enough(prepared, options) &&
         graph.cardinalities.size() <= kSearchedVariables &&
         search_bytes(graph) <= static_cast<double>(options.max_memory);
}

BoundedSumResult bounded_search(const FactorGraph& graph, std::uint64_t steps, double gap, const StopCondition& stop) {
  BoundedSumOptions options;
  options.max_steps = steps;
  options.relative_gap = gap;
  options.with_marginals = !graph.queries.empty();
  return bounded_sum(graph.cardinalities, graph.scopes, graph.tables, options, stop);
}

// Lets threads in only while their tables fit into the memory limit together.
class MemoryGate {
 public:
  explicit MemoryGate(double limit) : limit_(limit) {}
  void enter(double bytes) {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [&] { return inside_ == 0 || used_ + bytes <= limit_; });
    used_ += bytes;
    ++inside_;
  }
  void leave(double bytes) {
    {
      const std::lock_guard lock(mutex_);
      used_ = --inside_ == 0 ? 0.0 : used_ - bytes;
    }
    changed_.notify_all();
  }

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  double limit_, used_ = 0.0;
  int inside_ = 0;
};

class ExactRun {
 public:
  ExactRun(const MethodContext& context, bool for_map)
      : context_(context),
        for_map_(for_map),
        answers_(context.components.size()),
        gate_(static_cast<double>(context.options.max_memory)) {}

  MethodResult run() {
    answer_all();
    return collect();
  }

 private:
  void answer_all() {
    std::size_t threads = context_.options.threads;
    if (threads == 0) threads = std::max(1u, std::thread::hardware_concurrency());
    threads = std::min(threads, context_.components.size());
    std::atomic<std::size_t> next{0};
    const auto work = [&] {
      for (std::size_t i = next++; i < context_.components.size(); i = next++) {
        if (context_.stop.reached()) return;
        answers_[i] = answer_or_limit(context_.components[i]);
        const auto done = static_cast<double>(++done_);
        context_.stop.monitor().progress("exact", done, static_cast<double>(context_.components.size()));
      }
    };
    run_on_threads(threads, work);
  }

  Answer answer_or_limit(ComponentId component) {
    try {
      return answer(component);
    } catch (const std::bad_alloc&) {
      Answer out;
      out.started = true;
      out.termination = Termination::kMemoryLimit;
      out.message = fmt::format("memory ran out in {}", describe_component(context_.network, component));
      return out;
    }
  }

  Answer answer(ComponentId component) {
    Answer out;
    out.started = true;
    FactorGraphOptions compilation;
    compilation.atom_bias = context_.atom_bias;
    compilation.with_queries = !for_map_;
    compilation.max_bytes = context_.options.max_memory;
    compilation.stop = &context_.stop;
    const PreparedComponent prepared = prepare_component(context_.network, component, context_.options, compilation);
    if (context_.stop.reached()) {
      out.termination = context_.stop.reason();
      return out;
    }
    if (!prepared.graph.possible) {
      return impossible(prepared.graph.conflict);
    }
    if (!for_map_ && search(prepared, out)) {
      if (out.log_partition > -kInfinity || out.termination != Termination::kCompleted) return out;
      const auto constraints = context_.network.component_constraints(component);
      return impossible({constraints.begin(), constraints.end()});
    }
    if (refuse(component, prepared, out)) return out;
    gate_.enter(prepared.bytes);
    try {
      if (for_map_) {
        maximise(prepared, component, out);
      } else {
        sum(prepared, out);
      }
    } catch (const std::bad_alloc&) {
      out.termination = Termination::kMemoryLimit;
      out.message = fmt::format("the machine has no memory for {} ({:.0f} MB)",
                                describe_component(context_.network, component), std::ceil(prepared.bytes / 1e6));
    }
    gate_.leave(prepared.bytes);
    if (out.termination == Termination::kCompleted && out.log_partition == -kInfinity) {
      const auto constraints = context_.network.component_constraints(component);
      return impossible({constraints.begin(), constraints.end()});
    }
    return out;
  }

  Answer impossible(const std::vector<std::uint32_t>& contradictory) const {
    Answer out;
    out.started = true;
    out.termination = Termination::kNoPossibleWorld;
    out.message = "no world meets all hard formulas";
    out.conflict = small_conflict(context_.network, contradictory, context_.stop);
    return out;
  }

  bool refuse(ComponentId component, const PreparedComponent& prepared, Answer& out) const {
    Obstacle found = obstacle(context_.network, component, prepared, context_.options);
    if (found.termination == Termination::kCompleted) return false;
    out.termination = found.termination;
    out.message = std::move(found.message);
    if (out.termination == Termination::kTooWide)
      out.message += for_map_ ? "; use --method map" : "; use --method mcsat";
    return true;
  }

  void sum(const PreparedComponent& prepared, Answer& out) const {
    const FactorGraph& graph = prepared.graph;
    const BucketTree tree(graph.cardinalities, graph.scopes, prepared.order.order);
    const SumProductResult result = sum_product(tree, graph.tables, context_.stop, !graph.queries.empty());
    out.termination = result.termination;
    out.log_partition = result.log_partition + graph.constant;
    if (out.termination != Termination::kCompleted || out.log_partition == -kInfinity) return;
    answer_queries(graph, result.marginals, out);
  }

  // What is too wide for elimination. False: it is not, or it is too much for bounded search as well.
  bool search(const PreparedComponent& prepared, Answer& out) {
    if (!to_be_searched(prepared, context_.options)) return false;
    const FactorGraph& graph = prepared.graph;
    const double bytes = search_bytes(graph);
    gate_.enter(bytes);
    const BoundedSumResult result = bounded_search(graph, kSearchSteps, context_.options.search_gap, context_.stop);
    gate_.leave(bytes);
    if (result.termination == Termination::kTooWide) return false;
    out.termination = result.termination;
    out.log_partition = result.log_partition + graph.constant;
    if (out.termination == Termination::kCompleted && out.log_partition > -kInfinity)
      answer_queries(graph, result.marginals, out);
    return true;
  }

  static void answer_queries(const FactorGraph& graph, const std::vector<std::vector<double>>& marginals, Answer& out) {
    for (const ValueTest& query : graph.queries) {
      double p = query.is_constant() && query.value() ? 1.0 : 0.0;
      if (!query.is_constant()) {
        for (std::size_t k = 0; k < query.accepted.size(); ++k) {
          if (query.accepted[k] != 0) p += marginals[query.variable][k];
        }
      }
      out.probabilities.push_back(std::clamp(p, 0.0, 1.0));
    }
  }

  void maximise(const PreparedComponent& prepared, ComponentId component, Answer& out) const {
    const FactorGraph& graph = prepared.graph;
    const BucketTree tree(graph.cardinalities, graph.scopes, prepared.order.order);
    const MaxSumResult result = max_sum(tree, graph.tables, context_.stop);
    out.termination = result.termination;
    out.log_partition = result.log_maximum + graph.constant;
    if (out.termination != Termination::kCompleted || out.log_partition == -kInfinity) return;
    for (std::size_t i = 0; i < context_.network.component_variables(component).size(); ++i) {
      const FactorGraph::Binding& binding = graph.bindings[i];
      out.values.push_back(binding.variable == ValueTest::kConstant ? binding.values[0]
                                                                    : binding.values[result.values[binding.variable]]);
    }
  }

  MethodResult collect() {
    MethodResult result;
    const GroundNetwork& network = context_.network;
    if (for_map_) {
      result.values.assign(network.variable_count(), 0);
    } else {
      result.marginals.resize(network.queries().size());
    }
    double total = 0.0;
    std::size_t answered = 0, too_large = 0;
    for (std::size_t i = 0; i < answers_.size(); ++i) {
      const ComponentId component = context_.components[i];
      const Answer& answer = answers_[i];
      const bool good = answer.started && answer.termination == Termination::kCompleted;
      if (good) ++answered;
      if (answer.termination == Termination::kTooWide || answer.termination == Termination::kMemoryLimit) ++too_large;
      total += good ? answer.log_partition : 0.0;
      report(component, answer, good, result);
    }
    conclude(result, total, answered, too_large);
    return result;
  }

  void report(ComponentId component, const Answer& answer, bool good, MethodResult& result) const {
    const auto queries = context_.network.component_queries(component);
    const auto variables = context_.network.component_variables(component);
    if (for_map_ && good) {
      for (std::size_t v = 0; v < variables.size(); ++v) result.values[variables[v].index()] = answer.values[v];
    }
    if (!for_map_) {
      for (std::size_t q = 0; q < queries.size(); ++q) {
        result.marginals[queries[q]].probability = good ? answer.probabilities[q] : kNan;
      }
    }
    if (good) return;
    // What is certain outweighs what was merely not tried; of equals the first component speaks.
    const auto weight = [](Termination t) {
      switch (t) {
        case Termination::kNoPossibleWorld:
          return 3;
        case Termination::kTooWide:
        case Termination::kMemoryLimit:
          return 2;
        case Termination::kCompleted:
          return 0;
        default:
          return 1;
      }
    };
    const Termination unstarted = context_.stop.interrupted() ? Termination::kInterrupted : Termination::kTimeLimit;
    const Termination own = answer.started ? answer.termination : unstarted;
    if (weight(own) <= weight(result.termination)) return;
    result.termination = own;
    result.message = answer.message;
    result.conflict = answer.conflict;
  }

  void conclude(MethodResult& result, double total, std::size_t answered, std::size_t too_large) const {
    if (result.termination == Termination::kCompleted) {
      if (for_map_) {
        result.map_score = result.map_bound = total;
      } else {
        result.log_partition = total;
      }
      return;
    }
    if (for_map_) {
      result.map_score = total;
      result.map_bound = kInfinity;
    }
    if (result.termination == Termination::kTooWide || result.termination == Termination::kMemoryLimit) {
      if (too_large > 1) result.message += fmt::format(" ({} more likewise)", grouped_digits(too_large - 1));
    } else if (result.message.empty()) {
      result.message = fmt::format("stopped with {} of {} components answered", grouped_digits(answered),
                                   grouped_digits(answers_.size()));
    }
  }

  const MethodContext& context_;
  const bool for_map_;
  std::vector<Answer> answers_;
  std::atomic<std::size_t> done_{0};
  MemoryGate gate_;
};

}  // namespace

MethodResult run_exact(const MethodContext& context) { return ExactRun(context, false).run(); }

MethodResult run_exact_map(const MethodContext& context) { return ExactRun(context, true).run(); }

ExactCost exact_cost(const GroundNetwork& network, ComponentId component, const InferenceOptions& options,
                     const StopCondition& stop) {
  FactorGraphOptions compilation;
  compilation.max_bytes = options.max_memory;
  compilation.stop = &stop;
  const PreparedComponent prepared = prepare_component(network, component, options, compilation);
  ExactCost cost;
  cost.possible = prepared.graph.possible;
  cost.largest_log2 = prepared.order.largest_log2;
  cost.total_log2 = prepared.order.total_log2;
  cost.bytes = std::max(prepared.bytes, static_cast<double>(prepared.graph.table_bytes));
  cost.feasible = cost.possible && !prepared.graph.too_large && !prepared.graph.stopped &&
                  narrow_enough(prepared, options) && cost.bytes <= static_cast<double>(options.max_memory);
  return cost;
}

bool search_is_cheap(const GroundNetwork& network, ComponentId component, const InferenceOptions& options,
                     std::span<const double> atom_bias, const StopCondition& stop) {
  if (network.component_variables(component).size() > kSearchedVariables) return false;
  FactorGraphOptions compilation;
  compilation.atom_bias = atom_bias;
  compilation.max_bytes = options.max_memory;
  compilation.stop = &stop;
  const PreparedComponent prepared = prepare_component(network, component, options, compilation);
  return to_be_searched(prepared, options) &&
         bounded_search(prepared.graph, kCheapSearchSteps, options.search_gap, stop).termination ==
             Termination::kCompleted;
}

}  // namespace sherlog
