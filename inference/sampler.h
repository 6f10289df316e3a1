// The one sampling loop: chains of Worlds, started far apart, moved by a kernel, and judged together.
//
// Idea      Components are independent, so every chain moves each of them in turn with the moves that suit it:
//             slice step    MC-SAT only (slice.h)
//             Gibbs sweep   every variable, `!` and `?` blocks as a whole, from its conditional distribution
//             group moves   at-most-one groups as a whole, with what hangs on them (group_move.h)
//             joint blocks  sets of bounded width drawn exactly given the rest (joint_block.h), as many a sweep as cost about
//                           as much as the sweep itself, in turn
//           A component narrow enough to be one joint block is drawn independently and needs no other move.
//           Chains start from worlds as different as can be made (random ones and their opposites), so that modes that no
//           move connects show as a large R-hat.
// Source    Poon & Domingos 2006; Hamze & de Freitas 2004; Vehtari et al. 2021 for what is reported.
// Output    marginals with Monte Carlo standard error, ESS and R-hat. On a limit or interrupt: what the draws so far give.
// Errors    kNoPossibleWorld with a conflict; kTimeLimit where not one draw was made.
// Random    chain c draws from Rng(seed, c) only: the same bits whatever the number of threads.
// Cost      time O(samples x occurrences), memory O(network) a chain and one bit for each query and draw.
#pragma once

#include "inference/inference.h"

namespace sherlog {

enum class Kernel : std::uint8_t { kGibbs, kMcSat };

MethodResult sample(const MethodContext& context, Kernel kernel);

}  // namespace sherlog
