// A component compiled to tables and ordered, but not yet computed: what tells whether elimination can be afforded.
//
// Cost      That of compile_factor_graph and find_elimination_order; see there.
#pragma once

#include <cstddef>
#include <string>

#include "inference/elimination_order.h"
#include "inference/factor_graph.h"
#include "inference/inference.h"

namespace sherlog {

struct PreparedComponent {
  FactorGraph graph;
  EliminationOrder order;  // left out where the graph is impossible, too large or stopped
  double bytes = 0.0;      // of tables, messages and scratch
};

// Where compilation.stop says so, it is not narrow_enough().
PreparedComponent prepare_component(const GroundNetwork& network, ComponentId component,
                                    const InferenceOptions& options, const FactorGraphOptions& compilation);

// Its joined tables are within the limit of options.max_table_log2. Not asked of an impossible or too large graph.
bool narrow_enough(const PreparedComponent& prepared, const InferenceOptions& options);

// "its largest table would have 2^97 entries (limit 2^24)"
std::string how_wide(const EliminationOrder& order, double limit);

// What stands in the way of elimination: kTooWide or kMemoryLimit with a sentence's beginning ("component 1 (60
// variables) is too wide for exact: its largest table ..."), or kCompleted where nothing does.
struct Obstacle {
  Termination termination = Termination::kCompleted;
  std::string message;
};
Obstacle obstacle(const GroundNetwork& network, ComponentId component, const PreparedComponent& prepared,
                  const InferenceOptions& options);

// "component 1 (60 variables)"
std::string describe_component(const GroundNetwork& network, ComponentId component);

// "1,234,567"
std::string grouped_digits(std::size_t count);

}  // namespace sherlog
