// How much the outcome of a look tells about what is asked: mutual information on a ground network.
//
// Idea      Q are the queried variables, O those whose values a look would reveal (an annotator's atoms). The expected drop of
//           the entropy of Q is I(Q; O) = H(Q) - E[H(Q | O)], never negative. Its sum runs over all outcomes, and 60
//           boolean atoms have 2^60; two facts tame it.
//           1. O meets the rest of the network only through the variables that share a formula with it: the frontier F, as a
//           rule one block, the class of the thing that is looked at. So P(o | rest) = P(o | F), which is computed from the few
//           formulas around O and falls apart into factors (each atom its own, given the class); and one run of inference
//           gives P(F), whatever else the network holds. Hidden variables beside O are summed out with it. Where that
//           is too wide, hidden variables join F instead, together with all of Q in their components.
//           2. An outcome matters only by the belief about F that it leads to. The factors are multiplied in one after
//           the other, and outcomes that lead to the same belief are merged on the way (sufficient statistics): those that
//           say nothing about F vanish, twenty atoms of one meaning become a count.
//           Where more different beliefs are left than `max_outcomes`, outcomes are drawn from their exact distribution instead, and
//           the mean of the Kullback-Leibler divergence of P(Q | o) from P(Q) is given with its standard error; each
//           draw's is at least 0, so the estimate is as well.
// Source    Cover & Thomas, Elements of Information Theory, 2nd ed., 2.3-2.8 (I(Q; O) = E KL(P(Q | o) || P(Q)), data processing);
//           Lindley, Ann. Math. Statist. 27, 1956 (the information that an experiment provides).
// Input     a network whose queries are atoms; `outcome`: variables of it, none of them queried
// Output    nats. Outcomes that together have less than a probability of 1e-9 are left out.
// Errors    kRefused: a queried formula, Jeffrey evidence, an outcome that is queried. kTooWide: too many joint values on the
//           frontier. What inference says otherwise.
// Cost      one run of inference, plus frontier values x different beliefs x factors
// Random    Rng(seed, stream) of the inference options where outcomes are drawn
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>

#include "grounding/network.h"
#include "inference/inference.h"

namespace sherlog {

struct InformationOptions {
  InferenceOptions inference;
  std::size_t max_joint = 4096;     // joint values of the frontier, and of a group of dependent outcome variables
  std::size_t max_outcomes = 4096;  // different beliefs; beyond it outcomes are drawn
  std::uint32_t draws = 20000;      // then
};

struct Information {
  Termination termination = Termination::kCompleted;
  std::string message;
  std::string method;          // of inference; empty where none was needed
  double expected_drop = 0;    // I(Q; O), nats
  std::optional<double> mcse;  // where outcomes were drawn
  std::size_t outcomes = 0;    // different beliefs that were summed over, or draws
};

Information expected_information(const GroundNetwork& network, std::span<const VariableId> outcome,
                                 const InformationOptions& options, Monitor& monitor);

}  // namespace sherlog
