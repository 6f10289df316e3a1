// The entropy of the queried blocks of a ground network: how much is not known of what is asked.
//
// Idea      Each variable's own entropy comes from its marginals; their sum is an upper bound of the joint one. Where all
//           variables of the network are queried, the joint entropy is H = log Z - E[score], and E[score] is the derivative
//           of log Z by a common factor of all weights. It is taken by central differences, extrapolated once
//           (Richardson), good to about 1e-9: asking for the probability of each feature instead would carry all of them
//           through the elimination, and a scene of four things would be too wide for that (2^30 instead of 2^19 entries).
// Source    Cover & Thomas, Elements of Information Theory, 2nd ed., 2.2 and 12.1 (exponential families)
// Errors    what inference says; without a joint entropy where hidden variables or sampling stand in the way
// Cost      one run of inference, and five more for the joint entropy
#pragma once

#include <optional>
#include <string>

#include "grounding/network.h"
#include "inference/inference.h"

namespace sherlog {

struct QueryEntropy {
  Termination termination = Termination::kCompleted;
  std::string message;
  std::optional<double> joint;  // of all queried variables together, nats
  double marginal = 0.0;        // the sum of each one's own: at least the joint one
  InferenceResult result;       // the run of inference behind it
};

QueryEntropy query_entropy(const GroundNetwork& network, const InferenceOptions& options, Monitor& monitor);

}  // namespace sherlog
