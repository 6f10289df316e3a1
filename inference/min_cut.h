// Most probable worlds of pairwise boolean networks by minimum cut, and lower and upper hands by roof duality.
//
// Idea      Where every formula is about at most two boolean variables, minus the score is a quadratic function of 0/1 variables.
//           If, after some variables are turned round, no product has a positive coefficient, its minimum is a minimum cut:
//           exact. Which to turn is a 2-colouring of the graph of products. Where there is none, the function is written over
//           the variables and their complements; the minimum cut of that graph gives an upper bound on the score and values
//           of some variables that some most probable world has (roof duality).
//           Formulas over more variables fit in where only their being false is wanted: an OR that is punished (an AND that is
//           rewarded) gets a variable of its own, at least each of its inputs. Hard formulas cost more than all weights together,
//           in whole numbers, and the answer is checked.
// Source    Greig, Porteous & Seheult, JRSS B 51, 1989; Hammer, Hansen & Simeone, Math. Programming 28, 1984; Boros & Hammer,
//           Discrete Applied Math. 123, 2002; maximum flow: Dinic, 1970. Boost.Graph's flows cannot be stopped on the way,
//           which is why the flow is our own.
// Cost      near linear in practice on sparse networks; memory O(features).
// Numbers   Weights are rounded to multiples of about 2^-44 of their sum; the score of the returned world is computed anew.
#pragma once

#include <cstdint>
#include <vector>

#include "grounding/network.h"
#include "mln/monitor.h"

namespace sherlog {

// Maximum flow on a directed graph with whole capacities (Dinic's algorithm).
class FlowGraph {
 public:
  explicit FlowGraph(std::uint32_t nodes) : nodes_(nodes) {}
  // Capacity `forward` from a to b and `backward` from b to a.
  void add_arc(std::uint32_t a, std::uint32_t b, std::int64_t forward, std::int64_t backward = 0);
  // Nothing where `stop` was reached; otherwise true and flow() and reachable() are known.
  bool solve(std::uint32_t source, std::uint32_t sink, const StopCondition& stop);
  std::int64_t flow() const { return flow_; }
  // From the source in the residual graph: the smallest source side of a minimum cut.
  bool reachable(std::uint32_t node) const { return level_[node] >= 0; }

 private:
  struct Arc {
    std::uint32_t head;
    std::uint32_t reverse;  // arc
    std::int64_t residual;
  };
  struct Pending {
    std::uint32_t a, b;
    std::int64_t forward, backward;
  };
  void index_arcs();
  bool find_levels(std::uint32_t source, std::uint32_t sink);
  bool block_flow(std::uint32_t source, std::uint32_t sink, const StopCondition& stop);

  std::uint32_t nodes_;
  std::vector<Pending> pending_;
  std::vector<Arc> arcs_;
  std::vector<std::uint32_t> arc_begin_, next_arc_;
  std::vector<std::int32_t> level_;
  std::int64_t flow_ = 0;
};

enum class MinCutStatus : std::uint8_t {
  kNotQuadratic,  // this network is not of the kind; nothing is known
  kOptimal,       // all values, proved
  kPartial,       // values of some variables and a bound
  kImpossible,    // no world meets the hard formulas (only where that was proved)
  kStopped,
};

struct MinCutResult {
  MinCutStatus status = MinCutStatus::kNotQuadratic;
  std::vector<std::uint32_t> values;  // by variable; kUndecided where not decided
  double bound = 0.0;                 // no world's features sum to more (constant_score left out)
  static constexpr std::uint32_t kUndecided = 0xffffffffu;
};

// All variables of the network are looked at.
MinCutResult min_cut(const GroundNetwork& network, const StopCondition& stop);

}  // namespace sherlog
