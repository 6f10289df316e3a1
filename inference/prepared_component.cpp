#include "inference/prepared_component.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "inference/elimination.h"

namespace sherlog {
namespace {

// All joined tables together may have 2^5 times the entries of the largest one allowed: about half of that is stored as
// messages (2 GB at the default of 2^24).
constexpr double kTotalMargin = 5.0;

}  // namespace

PreparedComponent prepare_component(const GroundNetwork& network, ComponentId component,
                                    const InferenceOptions& options, const FactorGraphOptions& compilation) {
  PreparedComponent out;
  out.graph = compile_factor_graph(network, component, compilation);
  if (!out.graph.possible || out.graph.too_large || out.graph.stopped) return out;
  OrderLimits limits;
  limits.max_table_log2 = options.max_table_log2;
  limits.stop = compilation.stop;
  out.order = find_elimination_order(out.graph.cardinalities, out.graph.scopes, limits, out.graph.sweep);
  // Tables twice (logarithms and plain numbers), the largest joined table twice (with its separator), and the
  // messages, which are at most half of all joined tables.
  out.bytes = 2.0 * static_cast<double>(out.graph.table_bytes) +
              sizeof(double) * (2.0 * std::exp2(out.order.largest_log2) + 0.5 * std::exp2(out.order.total_log2));
  return out;
}

bool narrow_enough(const PreparedComponent& prepared, const InferenceOptions& options) {
  return prepared.order.complete && prepared.order.largest_log2 <= options.max_table_log2 &&
         prepared.order.largest_log2 < BucketTree::kMaxJoinedLog2 &&
         prepared.order.total_log2 <= options.max_table_log2 + kTotalMargin;
}

std::string how_wide(const EliminationOrder& order, double limit) {
  const double largest = std::ceil(order.largest_log2 - 1e-9), total = std::ceil(order.total_log2 - 1e-9);
  if (!order.complete) {
    return fmt::format("its largest table would have at least 2^{:g} entries (limit 2^{:g})", std::max(largest, limit),
                       limit);
  }
  if (order.largest_log2 > limit)
    return fmt::format("its largest table would have 2^{:g} entries (limit 2^{:g})", largest, limit);
  return fmt::format("its tables would have 2^{:g} entries together (limit 2^{:g})", total, limit + kTotalMargin);
}

Obstacle obstacle(const GroundNetwork& network, ComponentId component, const PreparedComponent& prepared,
                  const InferenceOptions& options) {
  const bool tables_too_large = prepared.graph.too_large;
  if (!tables_too_large && !narrow_enough(prepared, options)) {
    return {Termination::kTooWide, fmt::format("{} is too wide for exact: {}", describe_component(network, component),
                                               how_wide(prepared.order, options.max_table_log2))};
  }
  if (tables_too_large || prepared.bytes > static_cast<double>(options.max_memory)) {
    const double bytes = std::max(prepared.bytes, static_cast<double>(prepared.graph.table_bytes));
    return {Termination::kMemoryLimit, fmt::format("{} needs {}{:.0f} MB for exact, which exceeds the memory limit",
                                                   describe_component(network, component),
                                                   tables_too_large ? "more than " : "", std::ceil(bytes / 1e6))};
  }
  return {};
}

std::string describe_component(const GroundNetwork& network, ComponentId component) {
  return fmt::format("component {} ({} variables)", component.value + 1,
                     grouped_digits(network.component_variables(component).size()));
}

std::string grouped_digits(std::size_t count) {
  std::string digits = std::to_string(count);
  for (std::size_t i = digits.size(); i > 3;) {
    i -= 3;
    digits.insert(i, 1, ',');
  }
  return digits;
}

}  // namespace sherlog
