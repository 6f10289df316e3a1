// A most probable world, with a proof that there is no better one where a proof is found.
//
// Idea      A component that is a one-to-one matching (matching.h) is solved by the Hungarian algorithm: proved. What is left
//           is simplified first (map_reduction.h); what is left falls into components, and each gets the first of
//           these that fits its structure:
//             narrow           variable elimination (exact.h): proved
//             pairwise         minimum cut (min_cut.h): proved if no product is left in the way, otherwise values of some
//                              variables, after which simplification starts again
//             any              the relaxation of an integer program (integer_program.h); proved if it comes out whole; else a short
//                              local search for an incumbent, branch and cut within a bounded effort
//             still open       MaxWalkSAT (max_walk_sat.h) with all flips and restarts: the best world found, with the
//                              smallest upper bound that was met on the way
//           Choices depend on structure and fixed amounts of work, so without a time limit the answer depends on the
//           network, the options and the seed alone.
// Input     MethodContext: components, atom_bias (added to the score where the atom is true)
// Output    values of the components' variables; map_score of them; map_bound, equal to map_score where proved
// Errors    kNoPossibleWorld with `conflict`; kTimeLimit and kInterrupted with the best world so far. Where no world that
//           meets the hard formulas was found and none was refuted, `values` is empty, map_score is minus infinity and the message
//           says so; the termination is kTimeLimit (of `stop`, or of the bounded effort).
// Random    Rng(seed, restart); threads do not change the answer.
#pragma once

#include "inference/inference.h"

namespace sherlog {

MethodResult run_map(const MethodContext& context);

}  // namespace sherlog
