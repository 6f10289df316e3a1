#include "inference/conflict.h"

#include <algorithm>
#include <iterator>
#include <utility>

#include "inference/propagation.h"

namespace sherlog {
namespace {

constexpr std::uint64_t kFirstProof = 200'000;  // decisions for the first proof
constexpr std::uint64_t kPerTest = 5'000;       // for leaving out one constraint
constexpr double kSeconds = 1.0;                // for minimisation

// Atoms of the constraints, those used most first.
std::vector<Literal> atoms_by_use(const Propagation& propagation) {
  std::vector<Literal> atoms;
  for (const Literal literal : propagation.mentioned()) {
    if (literal.is_atom()) atoms.push_back(literal);
  }
  std::stable_sort(atoms.begin(), atoms.end(),
                   [&](Literal a, Literal b) { return propagation.use_count(a) > propagation.use_count(b); });
  return atoms;
}

void merge_into(std::vector<std::uint32_t>& set, const std::vector<std::uint32_t>& more) {
  std::vector<std::uint32_t> merged;
  std::set_union(set.begin(), set.end(), more.begin(), more.end(), std::back_inserter(merged));
  set = std::move(merged);
}

}  // namespace

std::optional<Satisfiability> check_constraints(const GroundNetwork& network,
                                                std::span<const std::uint32_t> constraints, std::uint64_t max_decisions,
                                                const StopCondition& stop) {
  Propagation propagation(network, constraints);
  Satisfiability result;
  if (!propagation.run()) {
    result.core = propagation.conflict();
    return result;
  }
  const std::vector<Literal> atoms = atoms_by_use(propagation);
  struct Decision {
    Literal literal;
    std::size_t next;  // atom to look at afterwards
    bool turned;
  };
  std::vector<Decision> decisions;
  std::size_t next = 0;
  for (std::uint64_t count = 0; count < max_decisions; ++count) {
    if (count % 1024 == 1023 && stop.reached()) return std::nullopt;
    while (next < atoms.size() && propagation.truth(atoms[next]) != Truth::kOpen) ++next;
    if (next == atoms.size()) {
      result.possible = true;
      result.core.clear();
      return result;
    }
    decisions.push_back({atoms[next], next, false});
    if (propagation.decide(atoms[next])) continue;
    while (true) {
      merge_into(result.core, propagation.conflict());
      while (!decisions.empty() && decisions.back().turned) {
        propagation.backtrack();
        decisions.pop_back();
      }
      if (decisions.empty()) return result;
      propagation.backtrack();
      Decision& last = decisions.back();
      last.turned = true;
      next = last.next;
      if (propagation.decide(~last.literal)) break;
    }
  }
  return std::nullopt;
}

std::vector<std::uint32_t> small_conflict(const GroundNetwork& network, std::span<const std::uint32_t> contradictory,
                                          const StopCondition& stop) {
  const StopCondition own(stop.monitor(), kSeconds);
  const auto done = [&] { return own.reached() || stop.reached(); };
  std::vector<std::uint32_t> core(contradictory.begin(), contradictory.end());
  std::sort(core.begin(), core.end());
  core.erase(std::unique(core.begin(), core.end()), core.end());
  const auto first = check_constraints(network, core, kFirstProof, own);
  if (first && !first->possible) core = first->core;
  for (std::size_t i = core.size(); i-- > 0 && !done();) {
    std::vector<std::uint32_t> rest = core;
    rest.erase(rest.begin() + static_cast<std::ptrdiff_t>(i));
    const auto tested = check_constraints(network, rest, kPerTest, own);
    if (!tested || tested->possible) continue;
    core = tested->core;
    i = std::min(i, core.size());
  }
  return core;
}

}  // namespace sherlog
