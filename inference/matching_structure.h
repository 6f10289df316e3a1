// A one-to-one matching seen in a component of a ground network.
//
// Idea      Table 1 of the RoboSherlock paper says that no two old clusters are one new cluster and the other way round. On the
//           ground these are pairwise hard clauses over variables (the anchors) that are each "on" under some of their
//           values. The clauses are the edges of a graph over the anchors; where that graph falls into cliques such
//           that each anchor lies in at most two of them and the cliques can be coloured with two colours, the
//           cliques are rows and columns, and each anchor is the cell of one row and one column. Everything else
//           has to be local: the rest of the network falls into small clusters, each of which sees one anchor (a cell) or
//           long disjunctions "some anchor of this row has one of these values" (a side). One anchor of a row is on at most,
//           so what the disjunctions say of a row depends on the one value that is on: the row's state. Then the component
//           is a weighted matching: a cell weighs, summed over its on-values, the sum of its cluster times what the states
//           of its row and column weigh, each relative to nothing being on.
//           Nothing here knows predicates or names; what does not fit is refused with a reason.
// Cost      O(clauses log clauses + squares of the groups); at most 2^18 anchors
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "grounding/network.h"

namespace sherlog {

inline constexpr std::uint32_t kNoGroup = 0xffffffffu;

struct MatchingCluster {
  std::vector<VariableId> variables;
  std::vector<std::uint32_t> features, constraints, queries;  // indices of the network's
  // One of the two:
  std::uint32_t cell = kNoGroup;   // into MatchingStructure::cells
  std::uint32_t group = kNoGroup;  // into MatchingStructure::groups
};

struct MatchingCell {
  VariableId anchor;
  std::vector<bool> on;  // by value
  std::uint32_t row = 0, column = 0;
  std::vector<std::uint32_t> row_state, column_state;  // by value: into MatchingGroup::states; 0 where off
};

// A row or column with two or more cells.
struct MatchingGroup {
  bool is_row = false;
  std::uint32_t number = 0;  // of the row or column
  std::vector<std::uint32_t> cells;
  // By state: which disjunctions over its cells are true, a bit for each. State 0 is that of nothing being on.
  std::vector<std::uint64_t> states = {0};
};

struct MatchingStructure {
  std::string problem;  // not empty: this is no matching, and why
  std::uint32_t rows = 0, columns = 0;
  std::vector<MatchingCell> cells;
  std::vector<MatchingGroup> groups;
  std::vector<MatchingCluster> clusters;
  // By gate of the network: its inputs that speak of cells only say together that this group is in a state with the
  // bit set; or kNoGroup.
  std::vector<std::uint32_t> group_of_gate;
  std::vector<std::uint8_t> bit_of_gate;
  // By gate: 1 where it is a disjunction of cells' atoms and of such disjunctions.
  std::vector<std::uint8_t> anchors_only;
  std::vector<std::uint32_t> cell_of;  // by variable of the network, or kNoGroup

  bool speaks_of_cells(const GroundNetwork& network, Literal literal) const {
    if (literal.is_atom()) return cell_of[network.variable_of(literal.atom()).index()] != kNoGroup;
    return literal.is_gate() && !literal.negated() && anchors_only[literal.gate().index()] == 1;
  }

  bool found() const { return problem.empty(); }
};

MatchingStructure find_matching(const GroundNetwork& network, ComponentId component);

}  // namespace sherlog
