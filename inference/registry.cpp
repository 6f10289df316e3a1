#include "inference/exact.h"
#include "inference/gibbs.h"
#include "inference/inference.h"
#include "inference/map.h"
#include "inference/matching.h"
#include "inference/mcsat.h"

namespace sherlog {
namespace {

// To add a method, write its pair of files and add its line here. "auto" is not a method but a choice among these, made in
// inference.cpp.
constexpr Method kMethods[] = {
    {"exact", "marginals and log Z by variable elimination; refuses components that are too wide", false, run_exact},
    {"matching", "marginals of one-to-one matchings such as object identity, exact or sampled; refuses what is none",
     false, run_matching},
    {"mcsat", "marginals by MC-SAT with Gibbs and joint-block moves; any model", false, run_mcsat},
    {"gibbs", "marginals by Gibbs sampling over blocks; refuses hard formulas that lock single moves in", false,
     run_gibbs},
    {"map", "a most probable world, with a proof of optimality where one is found", true, run_map},
};

}  // namespace

std::span<const Method> methods() { return kMethods; }

const Method* find_method(std::string_view name) {
  for (const Method& method : kMethods) {
    if (name == method.name) return &method;
  }
  return nullptr;
}

}  // namespace sherlog
