// GroundNetwork to InferenceResult: the one entry point, its options and what every method returns.
#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "grounding/network.h"
#include "mln/monitor.h"

namespace sherlog {

struct InferenceOptions {
  std::string method = "auto";  // a name of the registry, see methods()
  std::uint64_t seed = 1;
  std::uint32_t threads = 0;  // 0: as many as the machine has; the answer does not depend on it
  double max_seconds = std::numeric_limits<double>::infinity();
  std::size_t max_memory = std::numeric_limits<std::size_t>::max();  // bytes
  // Sampling
  std::uint32_t samples = 20000;  // kept draws in all chains together
  std::uint32_t chains = 4;
  std::uint32_t burn_in = 200;  // sweeps a chain
  // Exact
  double max_table_log2 = 24;  // the largest table of an elimination, in log2 of its entries
  double search_gap = 1e-10;   // share of a sum that a bounded search may leave out
  // MAP
  std::uint64_t flips = 1000000;  // MaxWalkSAT, a restart
  std::uint32_t restarts = 4;
};

// A bad option is answered with its name, its value and the bound that it broke; empty where all are good.
std::string validate(const InferenceOptions& options);

struct Marginal {
  double probability = 0.0;
  std::optional<double> mcse;  // Monte Carlo standard error
  std::optional<double> ess;   // bulk effective sample size
  std::optional<double> rhat;  // rank-normalised split R-hat
};

struct MapSolution {
  std::vector<std::uint32_t> values;  // by variable, see GroundNetwork::value_count
  double log_score = 0.0;             // of the whole world, constant_score included
  bool optimal = false;               // proved
  double gap = 0.0;                   // upper bound minus log_score, nats; infinity where no bound is known
};

struct ChainDiagnostics {
  bool converged = false;                   // every R-hat below 1.01 and every ESS above 100 a chain
  std::optional<double> rhat_max, ess_min;  // of the marginals that have them
  std::size_t not_converged = 0;            // how many queried atoms miss that
};

struct InferenceResult {
  std::string method;  // the one that ran
  Termination termination = Termination::kCompleted;
  std::string message;  // a sentence where not completed, or where something is to be said
  std::optional<double> log_partition;
  std::vector<Marginal> marginals;  // in the order of network.queries(); empty for MAP
  std::optional<MapSolution> map;
  std::optional<ChainDiagnostics> diagnostics;
  std::uint64_t samples = 0;  // draws kept in all chains together; fewer than asked for where a limit cut them short
  std::vector<std::uint32_t> conflict;  // kNoPossibleWorld: constraints (indices) that no world meets together, small
  std::vector<std::string> warnings;
  double seconds = 0.0;
  std::uint64_t seed = 0;
  InferenceOptions options;
};

// Errors: an unknown method or a bad option is kRefused with a message. The network is not changed.
InferenceResult infer(const GroundNetwork& network, const InferenceOptions& options, Monitor& monitor);

// ---------------------------------------------------------------------------------------------------------------------
// For those who write a method. A method answers for some components of a network and leaves the others alone.

struct MethodContext {
  const GroundNetwork& network;
  std::span<const ComponentId> components;  // to be answered
  const InferenceOptions& options;
  const StopCondition& stop;
  // Added to the weight of each atom's truth (by atom), or empty: how Jeffrey evidence is fitted.
  std::span<const double> atom_bias;
};

struct MethodResult {
  Termination termination = Termination::kCompleted;
  std::string message;
  std::optional<double> log_partition;  // log sum over the worlds of the given components of exp(features)
  std::vector<Marginal> marginals;      // one for each query of the network; entries of other components are left alone
  std::vector<std::uint32_t> values;    // MAP: by variable of the network; entries of other components are left alone
  double map_score = 0.0;               // sum of the features of the given components at `values`
  double map_bound = 0.0;               // no world scores more
  std::uint64_t samples = 0;            // draws kept in all chains together
  std::vector<std::uint32_t> conflict;  // where kNoPossibleWorld, if known
  std::vector<std::string> warnings;
};

struct Method {
  const char* name;
  const char* summary;
  bool finds_map;  // a most probable world instead of marginals
  MethodResult (*run)(const MethodContext&);
};

// The registry: to add a method, write its pair of files and add its line in registry.cpp.
std::span<const Method> methods();
const Method* find_method(std::string_view name);

}  // namespace sherlog
