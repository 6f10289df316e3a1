// Why an atom is as probable as it is: how far each ground formula moves its log-odds.
//
// Idea      Leave one out. Removing a feature f of weight w multiplies each world by exp(-w f), so with
//             L = log Z(a) - log Z(!a)                    the log-odds of the atom a
//             E1 = E[exp(-w f) | a], E0 = E[exp(-w f) | !a]
//           the log-odds without f are L + log E1 - log E0, and f's contribution is log E0 - log E1. f is 0 or 1, so
//           E = 1 - p + p exp(-w) with p = P(f | a) or P(f | !a): two runs of inference, one with the atom held true and one
//           with it held false, give every contribution at once, by `exact` as well as from samples. (Contributions need
//           not add up to L: two formulas that say the same each count little.)
//           A hard formula has no weight to take back: the nearest ones are left out in turn, where `exact` ran. Where hard
//           formulas alone decide the atom, those that do are given with an infinite contribution.
// Source    leave-one-out influence; the identity above is ordinary importance reweighting, exact for a 0/1 feature.
// Input     a literal of the network that is not constant
// Output    contributions in nats, largest first; mcse where they come from samples
// Errors    kRefused with a message: a constant literal, Jeffrey evidence, a method that finds worlds and not marginals.
//           kNoPossibleWorld, kTooWide, kTimeLimit, kInterrupted, kMemoryLimit: as inference says.
// Cost      two runs of inference on the atom's component; two more for each hard formula that is left out (at most 32)
// Random    as inference: the same bits for the same options
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "grounding/network.h"
#include "inference/inference.h"
#include "mln/monitor.h"

namespace sherlog {

struct Contribution {
  bool is_constraint = false;
  std::uint32_t index = 0;     // into network.constraints() or network.features()
  double log_odds = 0.0;       // moved towards true by so much (nats); infinite where it decides the atom
  std::optional<double> mcse;  // Monte Carlo standard error
};

struct Explanation {
  Termination termination = Termination::kCompleted;
  std::string message;
  std::string method;
  double probability = 0.0;
  double log_odds = 0.0;                    // may be infinite
  std::vector<Contribution> contributions;  // by absolute size, largest first; those of exactly 0 left out
  std::size_t features_in_component = 0;
  std::size_t constraints_in_component = 0;
  std::size_t constraints_left_out = 0;  // hard formulas that were tried
  std::vector<std::uint32_t> conflict;   // kNoPossibleWorld, as in InferenceResult
  double seconds = 0.0;
};

Explanation explain(const GroundNetwork& network, Literal target, const InferenceOptions& options, Monitor& monitor);

}  // namespace sherlog
