// Exactly-one groups of boolean atoms that a model spells out as hard clauses, seen as the blocks that they are.
//
// Idea      "P(a) v P(b) v P(c)." with every pair excluded says what a `!` block says, but as boolean atoms no single change
//           is possible and every sampler is locked in. Such groups become one variable with a value for each atom; their
//           clauses then hold by themselves and vanish.
// Output    a network with the same worlds and the same queries in the same order; atoms are renumbered. Its constant score and
//           bindings are not kept.
// Cost      linear, plus the pairs of the recognised groups.
#pragma once

#include <optional>
#include <vector>

#include "grounding/network.h"

namespace sherlog {

struct RecognisedBlocks {
  GroundNetwork network;
  std::vector<AtomId> atom;  // new number of each old atom
  bool possible = true;      // false: a hard formula contradicts the groups
};

// Nothing where there are no such groups.
std::optional<RecognisedBlocks> recognise_blocks(const GroundNetwork& network);

}  // namespace sherlog
