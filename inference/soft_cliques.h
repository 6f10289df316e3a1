// Groups of things that equal weights keep from being true together.
//
// Idea      "Nobody has two advisors" as a soft rule grounds to a clause !a v !b of one weight for every two candidates a, b. The
//           pairs are edges; in a clique of edges of weight w, k true members cost w k (k - 1) / 2: a convex function of their number,
//           which a linear program states exactly with one row, where pair by pair its relaxation says nothing. Edges may be
//           heavier than w: what exceeds it stays behind as an edge.
// Source    counting instead of enumerating, as in Noessner, Niepert & Stuckenschmidt, AAAI 2013; cliques are grown greedily.
// Cost      O(sum over cliques of members x neighbours), bounded by kMaxSteps: what is left then stays pairwise.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace sherlog {

struct SoftEdge {
  std::uint32_t a, b;  // different vertices
  double weight;       // positive; lowered to what the cliques leave over
};

struct SoftClique {
  double weight;
  std::vector<std::uint32_t> vertices;  // three or more
};

// No two edges join the same vertices.
std::vector<SoftClique> find_soft_cliques(std::uint32_t vertex_count, std::span<SoftEdge> edges);

}  // namespace sherlog
