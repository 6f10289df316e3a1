#include "inference/integer_program.h"

#include <CbcEventHandler.hpp>
#include <CbcHeuristic.hpp>
#include <CbcModel.hpp>
#include <CglClique.hpp>
#include <CglGomory.hpp>
#include <CglMixedIntegerRounding2.hpp>
#include <CglProbing.hpp>
#include <ClpEventHandler.hpp>
#include <ClpSimplex.hpp>
#include <OsiClpSolverInterface.hpp>
#include <algorithm>
#include <cmath>
#include <limits>

#include "inference/linear_program.h"

namespace sherlog {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kWhole = 1e-6;  // distance from a whole number that counts as whole
constexpr double kBytesPerEntry =
    120.0;  // matrix by rows and columns, factors and copies inside the solvers, measured roughly

// --- stopping the solvers --------------------------------------------------------------------------------------------

// What may end a run of the solvers. Shared by all copies that they make of their parts.
struct Watch {
  const StopCondition* stop;
  std::uint64_t iterations;  // left
  bool tripped = false;      // then nothing that the solver claims counts, except worlds

  bool trip() {
    tripped = tripped || stop->reached();
    return tripped;
  }
};

class SimplexWatch final : public ClpEventHandler {
 public:
  explicit SimplexWatch(Watch& watch) : watch_(&watch) {}
  ClpEventHandler* clone() const override { return new SimplexWatch(*this); }
  int event(Event which) override {
    if (which != endOfIteration && which != endOfFactorization) return kGoOn;
    if (which == endOfIteration) {
      if (watch_->iterations == 0) watch_->tripped = true;
      if (!watch_->tripped) --watch_->iterations;
    }
    return watch_->trip() ? kStop : kGoOn;
  }

 private:
  static constexpr int kGoOn = -1, kStop = 5;
  Watch* watch_;
};

class TreeWatch final : public CbcEventHandler {
 public:
  explicit TreeWatch(Watch& watch) : watch_(&watch) {}
  CbcEventHandler* clone() const override { return new TreeWatch(*this); }
  CbcAction event(CbcEvent) override { return watch_->trip() ? CbcEventHandler::stop : CbcEventHandler::noAction; }

 private:
  Watch* watch_;
};

int as_int(std::uint64_t n) {
  return static_cast<int>(std::min<std::uint64_t>(n, static_cast<std::uint64_t>(std::numeric_limits<int>::max())));
}

}  // namespace

struct IntegerProgram::Parts {
  const GroundNetwork* network;
  std::size_t columns = 0, rows = 0, entries = 0;
  double constant = 0.0;
  OsiClpSolverInterface solver;
  bool relaxed = false;
  double bound = kInfinity;
  std::vector<std::uint32_t> values;

  // The value with the largest share of each variable; returns whether all shares are whole.
  bool round(const double* solution) {
    bool whole = true;
    values.resize(network->variable_count());
    for (std::size_t v = 0; v < values.size(); ++v) {
      const VariableId variable(v);
      const std::uint32_t n = network->candidate_count(variable);
      double none = 1.0, best = -1.0;
      for (std::uint32_t i = 0; i < n; ++i) {
        const double share = solution[network->first_atom(variable).index() + i];
        none -= share;
        whole = whole && std::abs(share - std::round(share)) <= kWhole;
        if (share > best) best = share, values[v] = i;
      }
      if (network->has_none(variable) && none >= best) values[v] = n;
    }
    return whole;
  }
  double score_of_cost(double cost) const { return constant - cost; }

  void watch(Watch& watch) {
    SimplexWatch handler(watch);  // copied
    solver.getModelPtr()->passInEventHandler(&handler);
  }
  void unwatch() {
    const ClpEventHandler idle;
    solver.getModelPtr()->passInEventHandler(&idle);
  }
  double score(std::span<const std::uint32_t> world) const;
};

// Sum of the features.
double IntegerProgram::Parts::score(std::span<const std::uint32_t> world) const {
  std::vector<std::uint8_t> truth(network->gate_count(), 0);
  const auto is_true = [&](Literal l) {
    if (l.is_gate()) return (truth[l.gate().index()] != 0) != l.negated();
    return (world[network->variable_of(l.atom()).index()] == network->value_of(l.atom())) != l.negated();
  };
  for (std::size_t g = 0; g < truth.size(); ++g) {
    const auto count = std::ranges::count_if(network->gate_inputs(GateId(g)), is_true);
    truth[g] = (network->gate_kind(GateId(g)) == GateKind::kOr ? count > 0 : count != 1) ? 1 : 0;
  }
  double sum = 0.0;
  for (const Feature& f : network->features()) sum += is_true(f.literal) ? f.weight : 0.0;
  return sum;
}

IntegerProgram::IntegerProgram(const GroundNetwork& network) : parts_(std::make_unique<Parts>()) {
  const LinearProgram p = state_linear_program(network);
  Parts& parts = *parts_;
  parts.network = &network;
  parts.columns = p.objective.size();
  parts.rows = p.row_lower.size();
  parts.entries = p.index.size();
  parts.constant = p.constant;
  parts.solver.messageHandler()->setLogLevel(0);
  parts.solver.setHintParam(OsiDoReducePrint, true, OsiHintTry);
  const CoinPackedMatrix matrix(false, static_cast<int>(parts.columns), static_cast<int>(parts.rows),
                                static_cast<CoinBigIndex>(parts.entries), p.value.data(), p.index.data(),
                                p.row_start.data(), nullptr);
  parts.solver.loadProblem(matrix, p.column_lower.data(), p.column_upper.data(), p.objective.data(), p.row_lower.data(),
                           p.row_upper.data());
  for (std::size_t i = 0; i < parts.columns; ++i) {
    if (p.is_whole[i]) parts.solver.setInteger(static_cast<int>(i));
  }
}

IntegerProgram::~IntegerProgram() = default;
std::size_t IntegerProgram::columns() const { return parts_->columns; }
std::size_t IntegerProgram::rows() const { return parts_->rows; }
std::size_t IntegerProgram::entries() const { return parts_->entries; }
std::size_t IntegerProgram::memory_bytes() const {
  return static_cast<std::size_t>(kBytesPerEntry *
                                  static_cast<double>(parts_->entries + parts_->columns + parts_->rows));
}
bool IntegerProgram::is_relaxed() const { return parts_->relaxed; }
double IntegerProgram::bound() const { return parts_->bound; }
const std::vector<std::uint32_t>& IntegerProgram::values() const { return parts_->values; }

IntegerProgramStatus IntegerProgram::relax(const IntegerProgramEffort& effort, const StopCondition& stop) {
  Parts& parts = *parts_;
  Watch watch{&stop, effort.iterations};
  parts.watch(watch);
  parts.solver.initialSolve();
  parts.unwatch();
  if (watch.tripped) return IntegerProgramStatus::kOpen;
  if (parts.solver.isProvenPrimalInfeasible()) return IntegerProgramStatus::kImpossible;
  if (!parts.solver.isProvenOptimal()) return IntegerProgramStatus::kOpen;
  parts.relaxed = true;
  parts.bound = parts.score_of_cost(parts.solver.getObjValue());
  return parts.round(parts.solver.getColSolution()) ? IntegerProgramStatus::kOptimal : IntegerProgramStatus::kOpen;
}

IntegerProgramStatus IntegerProgram::branch_and_cut(std::span<const std::uint32_t> incumbent,
                                                    const IntegerProgramEffort& effort, const StopCondition& stop) {
  Parts& parts = *parts_;
  Watch watch{&stop, effort.iterations};
  parts.watch(watch);
  CbcModel model(parts.solver);
  parts.unwatch();
  model.setLogLevel(0);
  model.messageHandler()->setLogLevel(0);
  model.solver()->messageHandler()->setLogLevel(0);
  CglProbing probing;
  probing.setUsingObjective(1);
  probing.setMaxPass(1);
  probing.setMaxProbe(10);
  probing.setMaxLook(10);
  CglGomory gomory;
  gomory.setLimit(300);
  CglClique clique;
  clique.setStarCliqueReport(false);
  clique.setRowCliqueReport(false);
  CglMixedIntegerRounding2 rounding;
  model.setMaximumCutPasses(1);
  model.addCutGenerator(&probing, -1, "probing");
  model.addCutGenerator(&gomory, -1, "gomory");
  model.addCutGenerator(&clique, -1, "clique");
  model.addCutGenerator(&rounding, -1, "rounding");
  CbcRounding heuristic(model);
  model.addHeuristic(&heuristic);
  TreeWatch handler(watch);
  model.passInEventHandler(&handler);
  model.setMaximumNodes(as_int(effort.nodes));
  if (std::isfinite(stop.max_seconds())) model.setMaximumSeconds(std::max(0.01, stop.max_seconds() - stop.seconds()));
  model.setDblParam(CbcModel::CbcAllowableGap, 0.0);
  model.setDblParam(CbcModel::CbcAllowableFractionGap, 0.0);
  model.setDblParam(CbcModel::CbcCutoffIncrement, 1e-9);
  double incumbent_cost = kInfinity;
  if (!incumbent.empty()) {
    incumbent_cost = parts.constant - parts.score(incumbent);
    parts.values.assign(incumbent.begin(), incumbent.end());
    model.setCutoff(incumbent_cost - 1e-7 * (1.0 + std::abs(incumbent_cost)));
  }
  model.branchAndBound();
  const double* best = model.bestSolution();
  if (best != nullptr && model.getObjValue() < incumbent_cost) {
    parts.round(best);
  }
  // A relaxation that was cut short may pass for one that cannot be met: no proof counts then, nor any bound.
  if (watch.tripped) return IntegerProgramStatus::kOpen;
  if (model.status() == 0) {
    if (best == nullptr && incumbent.empty()) return IntegerProgramStatus::kImpossible;
    const double cost = best != nullptr ? std::min(incumbent_cost, model.getObjValue()) : incumbent_cost;
    parts.bound = std::min(parts.bound, parts.score_of_cost(cost));
    return IntegerProgramStatus::kOptimal;
  }
  // With a cutoff the solver may report bounds beyond it: nothing better than the incumbent is left there.
  const double possible = std::min(model.getBestPossibleObjValue(), incumbent_cost);
  if (std::isfinite(possible)) parts.bound = std::min(parts.bound, parts.score_of_cost(possible));
  return IntegerProgramStatus::kOpen;
}

}  // namespace sherlog
