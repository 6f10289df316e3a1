#include "inference/sampler.h"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <memory>
#include <new>
#include <thread>

#include "inference/at_most_one.h"
#include "inference/block_cover.h"
#include "inference/block_recognition.h"
#include "inference/chain_diagnostics.h"
#include "inference/conflict.h"
#include "inference/defined_atoms.h"
#include "inference/ergodicity.h"
#include "inference/group_move.h"
#include "inference/parallel.h"
#include "inference/propagation.h"
#include "inference/sample_sat.h"
#include "inference/slice.h"
#include "inference/unlocking.h"

namespace sherlog {
namespace {

constexpr std::size_t kRecordBytes = std::size_t{1} << 28;  // for draws kept for the diagnostics, all chains together
constexpr std::uint64_t kStartFlips = 200;                  // of local search for a first world, for each variable
constexpr int kStartTries = 20;
constexpr std::uint64_t kConflictDecisions = 1000000;
constexpr double kMostTimeForBurnIn =
    0.3;  // of what a limit leaves; a run that needs more of it is marked as cut short
constexpr std::size_t kQueriesPerPart = 64;  // of the work on diagnostics

// What all chains share: read only once made.
struct Plan {
  struct Component {
    std::vector<VariableId> variables;
    std::vector<VariableId> single;  // those that no group move covers
    BlockCover cover;
    std::unique_ptr<SliceStep> slice;
    std::unique_ptr<GroupMoves> groups;
    Unlocking unlocking;
    std::uint32_t unlock_every = 1;
    std::vector<std::uint32_t> demanded;  // nodes with a hard demand
    bool queried = false;
    bool jump = false;  // hard formulas may lock single moves in, and no joint draw is known to lead out
    std::uint32_t slice_every = 1;
    double block_budget = 0.0;  // table entries a sweep
  };
  GroundNetwork network;  // pairwise exclusions folded into at-most-one gates
  std::vector<std::uint32_t> queries;
  std::vector<Literal> query_literals;  // likewise
  bool possible = true;                 // false: the rewriting met a contradiction
  bool stopped = false;                 // not complete: a limit was reached
  bool independent = true;              // every component is drawn as a whole
  std::vector<std::uint32_t> decided;   // queries that the rewriting found to be constant
  std::vector<Component> components;
  std::vector<VariableId> variables;
  std::vector<std::uint32_t> numbers;  // of variables within their components
  std::unique_ptr<WorldIndex> index;
  DefinedAtoms defined;
};

// Rewrites cliques of pairwise exclusions. Component numbers may change, variables do not.
GroundNetwork fold(const GroundNetwork& network, std::span<const ComponentId> components, const StopCondition& stop) {
  AtMostOne all;
  for (ComponentId c : components) {
    if (network.component_constraints(c).size() < 3) continue;
    AtMostOne found = find_at_most_one(network, c, &stop);
    std::ranges::move(found.groups, std::back_inserter(all.groups));
    all.covered.insert(all.covered.end(), found.covered.begin(), found.covered.end());
  }
  return all.groups.empty() ? network : fold_at_most_one(network, all);
}

void sort_unique(std::vector<ComponentId>& components) {
  std::ranges::sort(components);
  components.erase(std::unique(components.begin(), components.end()), components.end());
}

// Table entries of joint draws for each use of an atom in a sweep: where at-most-one groups move as a whole, joint draws add little.
constexpr double kBlockShare = 1.0;
constexpr double kBlockShareOfGroups = 0.25;
// Likewise for the joint draws that lead from one part of the worlds to another: few moves matter more, so they may cost
// several sweeps, and come now and then however much they cost.
constexpr double kUnlockShare = 4.0, kMostUnlockEvery = 16.0;
// A slice step costs several sweeps: it comes every few of them, less often where groups move as a whole, but every time where only
// its jumps lead everywhere.
constexpr std::uint32_t kSliceEvery = 4;
constexpr std::uint32_t kSliceEveryOfGroups = 16;
// Work between two looks at the clock, in variables.
constexpr std::uint32_t kVariablesPerStopCheck = 1024;

// The moves of a component that is not one block.
void plan_moves(const Plan& plan, Kernel kernel, Plan::Component& part) {
  const WorldIndex& index = *plan.index;
  part.groups = std::make_unique<GroupMoves>(index, part.variables);
  if (kernel == Kernel::kMcSat)
    part.slice = std::make_unique<SliceStep>(index, part.variables, plan.numbers, part.jump);
  part.slice_every = part.groups->empty() ? kSliceEvery : kSliceEveryOfGroups;
  for (VariableId v : part.variables) {
    const bool covered = part.groups->covers(v);
    if (!covered) part.single.push_back(v);
    // A unit of work: one use of an atom by a gate.
    double uses = 1.0;
    for (std::uint32_t i = 0; i < plan.network.candidate_count(v); ++i) {
      uses += static_cast<double>(index.uses(plan.network.first_atom(v).value + i).size());
    }
    part.block_budget += uses * (covered ? kBlockShareOfGroups : kBlockShare);
  }
  const double affordable = std::max(part.block_budget * kUnlockShare, 1.0);
  part.unlock_every = static_cast<std::uint32_t>(std::clamp(part.unlocking.cost / affordable, 1.0, kMostUnlockEvery));
}

void plan_component(const MethodContext& context, Kernel kernel, ComponentId c, ErgodicityBudget& budget, Plan& plan) {
  const GroundNetwork& n = plan.network;
  Plan::Component part;
  for (std::uint32_t i : n.component_constraints(c)) {
    const std::uint32_t node = plan.index->node(n.constraints()[i].literal);
    if (plan.index->demand(node) != 0) part.demanded.push_back(node);
  }
  part.queried = !n.component_queries(c).empty();
  for (VariableId v : n.component_variables(c)) {
    if (plan.defined.contains(v)) continue;
    plan.numbers[v.index()] = static_cast<std::uint32_t>(part.variables.size());
    part.variables.push_back(v);
  }
  part.cover = cover_component(*plan.index, part.variables, plan.numbers, context.options.seed, context.stop);
  if (!part.cover.whole) {
    plan.independent = plan.independent && !part.queried;
    if (kernel == Kernel::kMcSat && !n.component_constraints(c).empty()) {
      part.unlocking = unlock(*plan.index, c, plan.numbers, budget, context.stop);
      part.jump = !part.unlocking.is_complete;
    }
    plan_moves(plan, kernel, part);
  }
  plan.variables.insert(plan.variables.end(), part.variables.begin(), part.variables.end());
  const auto queries = n.component_queries(c);
  plan.queries.insert(plan.queries.end(), queries.begin(), queries.end());
  plan.components.push_back(std::move(part));
}

std::unique_ptr<Plan> make_plan(const MethodContext& context, Kernel kernel) {
  auto made = std::make_unique<Plan>();
  Plan& plan = *made;
  // Variables of the asked components, and biases, in the numbers of the rewritten network.
  std::optional<RecognisedBlocks> blocks = recognise_blocks(context.network);
  const GroundNetwork& source = blocks ? blocks->network : context.network;
  plan.possible = !blocks || blocks->possible;
  if (!plan.possible) return made;
  const auto renamed = [&](AtomId a) { return blocks ? blocks->atom[a.index()] : a; };
  std::vector<double> bias(context.atom_bias.empty() ? 0 : source.atom_count(), 0.0);
  for (std::uint32_t a = 0; a < context.atom_bias.size(); ++a) bias[renamed(AtomId(a)).index()] = context.atom_bias[a];
  std::vector<VariableId> asked;
  std::vector<ComponentId> components;
  for (ComponentId c : context.components) {
    for (VariableId v : context.network.component_variables(c)) {
      asked.push_back(source.variable_of(renamed(context.network.first_atom(v))));
      components.push_back(source.component_of(asked.back()));
    }
  }
  sort_unique(components);
  plan.network = fold(source, components, context.stop);
  plan.stopped = context.stop.reached();
  if (plan.stopped) return made;
  const GroundNetwork& n = plan.network;
  plan.index = std::make_unique<WorldIndex>(n, bias);
  components.clear();
  for (VariableId v : asked) components.push_back(n.component_of(v));
  sort_unique(components);
  std::vector<VariableId> moving;
  for (ComponentId c : components) {
    const auto own = n.component_variables(c);
    moving.insert(moving.end(), own.begin(), own.end());
  }
  plan.defined.collapse(*plan.index, moving);
  plan.numbers.assign(n.variable_count(), kNoNumber);
  ErgodicityBudget budget;
  budget.stop = &context.stop;
  std::size_t since_check = 0;
  for (ComponentId c : components) {
    since_check += n.component_variables(c).size();
    if (since_check > kVariablesPerStopCheck) {
      since_check = 0;
      plan.stopped = context.stop.reached();
      if (plan.stopped) return made;
    }
    plan_component(context, kernel, c, budget, plan);
  }
  plan.stopped = context.stop.reached();
  std::ranges::sort(plan.queries);
  for (std::uint32_t q : plan.queries) plan.query_literals.push_back(n.queries()[q].literal);
  for (std::uint32_t q = 0; q < n.queries().size(); ++q) {
    if (n.queries()[q].literal.is_constant()) plan.decided.push_back(q);
  }
  return made;
}

class Chain {
 public:
  Chain(const Plan& plan, const InferenceOptions& options, std::uint32_t number, const StopCondition& stop)
      : plan_(plan),
        stop_(stop),
        world_(*plan.index),
        rng_(options.seed, number),
        number_(number),
        parts_(plan.components.size()) {
    // What was not asked about stays where it is.
    for (const Constraint& c : plan.network.constraints()) world_.set_demand(plan.index->node(c.literal), 0);
  }

  // A first world that meets the hard formulas. 0: found, else the number of the component (plus one) that seems to have none.
  std::size_t start() {
    scatter();
    for (std::size_t c = 0; c < parts_.size(); ++c) {
      const auto& component = plan_.components[c];
      if (out_of_time(component.variables.size())) return c + 1;
      if (component.cover.whole && !component.cover.blocks[0].draw(world_, rng_, blocks_)) return c + 1;
      // Demands come one component after the other: whatever is broken then belongs to this one.
      for (std::uint32_t node : component.demanded) world_.set_demand(node, plan_.index->demand(node));
      if (component.cover.whole) continue;
      bool found = world_.broken().empty();
      for (int attempt = 0; !found && attempt < kStartTries && !stop_.reached(); ++attempt) {
        if (attempt > 0) {
          for (VariableId v : component.variables) world_.set(v, rng_.below(plan_.network.value_count(v)));
        }
        found = sample_sat(world_, rng_, component.variables, kStartFlips * component.variables.size() + 10000, &stop_);
      }
      if (!found) return c + 1;
    }
    return 0;
  }

  // False where the limit came before the end.
  bool sweep() {
    ++sweeps_;
    for (std::size_t c = 0; c < parts_.size(); ++c) {
      const auto& component = plan_.components[c];
      if (!component.queried) continue;  // its first world is all that is needed of it
      if (component.cover.whole) {
        component.cover.blocks[0].draw(world_, rng_, blocks_);
        if (out_of_time(component.variables.size())) return false;
      } else if (!move(component, parts_[c])) {
        return false;
      }
    }
    plan_.defined.draw(world_, rng_);
    return true;
  }

  const World& world() const { return world_; }

 private:
  struct Part {
    std::size_t next_block = 0;
    double credit = 0.0;
  };

  // Whether to end, asked once for every few variables.
  bool out_of_time(std::size_t variables) {
    if ((since_check_ += variables) < kVariablesPerStopCheck) return false;
    since_check_ = 0;
    return stop_.reached();
  }

  bool move(const Plan::Component& component, Part& part) {
    if (component.slice && (component.jump || sweeps_ % component.slice_every == 0))
      component.slice->step(world_, rng_, slice_, &stop_);
    for (VariableId v : component.single) {
      gibbs_step(world_, v, rng_, false, weights_);
      if (out_of_time(1)) return false;
    }
    component.groups->sweep(world_, rng_, groups_, &stop_);
    if (sweeps_ % component.unlock_every == 0) {
      for (const JointBlock& block : component.unlocking.blocks) {
        block.draw(world_, rng_, blocks_);
        if (out_of_time(block.variables().size())) return false;
      }
    }
    const std::vector<JointBlock>& blocks = component.cover.blocks;
    if (!blocks.empty()) part.credit += component.block_budget;
    // A block is drawn once its cost has been saved up.
    while (!blocks.empty() && part.credit >= blocks[part.next_block].cost()) {
      const JointBlock& block = blocks[part.next_block];
      block.draw(world_, rng_, blocks_);
      part.credit -= block.cost();
      part.next_block = (part.next_block + 1) % blocks.size();
      if (out_of_time(block.variables().size())) return false;
    }
    return !out_of_time(component.variables.size());
  }

  // Chains 0 and 1 (2 and 3, ...) start from opposite values; the first pair from all false and all true.
  void scatter() {
    Rng shared(0x5ca77e5, number_ / 2);
    for (VariableId v : plan_.variables) {
      const std::uint32_t values = plan_.network.value_count(v);
      // Both numbers are drawn by both chains of a pair, so that they stay in step.
      const std::uint32_t one = shared.below(values), step = 1 + shared.below(std::max(values, 2u) - 1);
      std::uint32_t value = number_ < 2 ? values - 1 : one;
      if (number_ % 2 == 1) value = number_ == 1 ? 0 : (one + step) % values;
      world_.set(v, value);
    }
  }

  const Plan& plan_;
  const StopCondition& stop_;
  World world_;
  Rng rng_;
  std::uint32_t number_;
  std::vector<Part> parts_;
  JointBlock::Workspace blocks_;
  SliceStep::Scratch slice_;
  GroupMoves::Scratch groups_;
  std::vector<double> weights_;
  std::uint32_t sweeps_ = 0;
  std::size_t since_check_ = 0;
};

// How many draws each chain keeps (all together as many as were asked for), and every which of them goes to the diagnostics.
struct Schedule {
  std::uint32_t chains = 0;
  std::uint32_t draws = 0;   // of each chain
  std::uint32_t longer = 0;  // so many of the first chains keep one more
  std::uint32_t thin = 1;

  std::uint32_t draws_of(std::uint32_t chain) const { return draws + (chain < longer ? 1 : 0); }
};

Schedule make_schedule(const InferenceOptions& options, std::size_t queries) {
  Schedule schedule;
  schedule.chains = std::min(options.chains, options.samples);  // each keeps a draw
  schedule.draws = options.samples / schedule.chains;
  schedule.longer = options.samples % schedule.chains;
  const std::size_t budget = std::min(kRecordBytes, options.max_memory / 4);
  const double bytes = static_cast<double>(queries) * options.samples / 8.0;
  schedule.thin = static_cast<std::uint32_t>(
      std::max(1.0, std::ceil(bytes / static_cast<double>(std::max<std::size_t>(budget, 1)))));
  return schedule;
}

struct ChainRecord {
  std::unique_ptr<BinaryRecorder> recorder;
  std::vector<std::uint32_t> counts;  // true draws by query, where not every draw goes to the recorder
  std::uint32_t draws = 0;
  std::size_t failed_component = 0;
  bool hurried = false;  // the burn-in was cut short to have draws at all
};

void record_draw(const Plan& plan, const World& world, std::uint32_t thin, ChainRecord& record) {
  const bool keep = record.draws % thin == 0;
  for (std::size_t q = 0; q < plan.query_literals.size(); ++q) {
    const bool value = world.is_true(plan.query_literals[q]);
    if (keep) record.recorder->record(q, value);
    if (thin > 1) record.counts[q] += value ? 1u : 0u;
  }
  if (keep) record.recorder->next_draw();
  ++record.draws;
}

void run_chain(const Plan& plan, const MethodContext& context, std::uint32_t number, const Schedule& schedule,
               std::atomic<std::uint64_t>& done, ChainRecord& record) {
  if (context.stop.reached()) return;
  Chain chain(plan, context.options, number, context.stop);
  record.failed_component = chain.start();
  if (record.failed_component != 0) return;
  const std::uint32_t draws = schedule.draws_of(number);
  if (schedule.thin > 1) record.counts.assign(plan.queries.size(), 0);
  record.recorder = std::make_unique<BinaryRecorder>(plan.queries.size(), draws / schedule.thin + 1);
  // Independent draws need no burn-in.
  std::uint64_t burn_in = plan.independent ? 0 : context.options.burn_in;
  const std::uint64_t total = burn_in + draws;
  const double hurry =
      context.stop.seconds() + kMostTimeForBurnIn * (context.stop.max_seconds() - context.stop.seconds());
  for (std::uint64_t i = 0; i < burn_in + draws && !context.stop.reached(); ++i) {
    if (!chain.sweep()) break;
    if (i >= burn_in) {
      record_draw(plan, chain.world(), schedule.thin, record);
    } else if (context.stop.seconds() > hurry) {
      record.hurried = true;
      burn_in = i + 1;
    }
    const std::uint64_t so_far = ++done;
    if ((so_far & 63u) == 0) {
      context.stop.monitor().progress("sampling", static_cast<double>(so_far),
                                      static_cast<double>(total) * schedule.chains);
    }
  }
  record.recorder->finish();
}

// Calls work(i) for i = 0..count-1 on so many threads.
template <class Work>
void in_parallel(std::size_t count, std::uint32_t threads, Work&& work) {
  std::atomic<std::size_t> next{0};
  run_on_threads(std::min<std::size_t>(threads, count), [&] {
    for (std::size_t i = next++; i < count; i = next++) work(i);
  });
}

// Nobody found a world: either there is none, and then propagation or search can say why, or it is only hard to find.
MethodResult explain_failure(const MethodContext& context) {
  MethodResult result;
  // The rewritten component's atoms are renumbered: all asked components' constraints are looked at.
  std::vector<std::uint32_t> constraints;
  for (ComponentId c : context.components) {
    const auto own = context.network.component_constraints(c);
    constraints.insert(constraints.end(), own.begin(), own.end());
  }
  const auto found = check_constraints(context.network, constraints, kConflictDecisions, context.stop);
  if (found && !found->possible) {
    result.termination = Termination::kNoPossibleWorld;
    result.conflict = small_conflict(context.network, found->core, context.stop);
    result.message = "the hard formulas contradict each other";
  } else {
    result.termination = context.stop.reached() ? context.stop.reason() : Termination::kTimeLimit;
    result.message =
        "no world that meets the hard formulas was found; 'exact' or 'map' may settle whether there is one";
  }
  return result;
}

void summarize_queries(const Plan& plan, const std::vector<ChainRecord>& records, std::uint32_t threads,
                       const StopCondition& stop, std::vector<Marginal>& marginals) {
  for (std::uint32_t q : plan.decided) {
    marginals[q].probability = plan.network.queries()[q].literal == Literal::constant(true) ? 1.0 : 0.0;
  }
  std::uint32_t kept = UINT32_MAX;
  for (const ChainRecord& r : records) kept = std::min(kept, r.recorder->draws());
  const std::size_t parts = (plan.queries.size() + kQueriesPerPart - 1) / kQueriesPerPart;
  in_parallel(parts, threads, [&](std::size_t part) {
    // Out of time, or of patience: the quick summary.
    const bool quick = stop.reached();
    std::vector<std::span<const std::uint64_t>> chains;
    for (std::size_t q = part * kQueriesPerPart; q < std::min(plan.queries.size(), (part + 1) * kQueriesPerPart); ++q) {
      chains.clear();
      double count = 0.0, draws = 0.0;
      for (const ChainRecord& r : records) {
        chains.push_back(r.recorder->of(q));
        count += r.counts.empty() ? r.recorder->count(q) : r.counts[q];
        draws += r.draws;
      }
      const BinarySummary summary = summarize(chains, kept, quick);
      marginals[plan.queries[q]] = {draws > 0.0 ? count / draws : 0.0, summary.mcse, summary.ess, summary.rhat};
    }
  });
}

}  // namespace

MethodResult sample(const MethodContext& context, Kernel kernel) {
  MethodResult result;
  // What is not computed is no number, least of all 0.
  result.marginals.assign(context.network.queries().size(),
                          Marginal{std::numeric_limits<double>::quiet_NaN(), {}, {}, {}});
  if (context.components.empty()) return result;
  const auto stopped = [&] {
    result.termination = context.stop.reached() ? context.stop.reason() : Termination::kTimeLimit;
    result.message = "stopped before the first draw";
    return std::move(result);
  };
  if (kernel == Kernel::kGibbs) {
    ErgodicityBudget budget;
    budget.stop = &context.stop;
    const auto locked = std::ranges::find_if(context.components, [&](ComponentId c) {
      return !context.network.component_constraints(c).empty() &&
             !single_moves_reach_every_world(context.network, c, budget);
    });
    if (context.stop.reached()) return stopped();
    if (locked != context.components.end()) {
      result.termination = Termination::kRefused;
      const Constraint& example = context.network.constraints()[context.network.component_constraints(*locked).front()];
      result.message = fmt::format(
          "gibbs cannot reach every possible world by changing one variable at a time, because of hard formulas such "
          "as '{}'; "
          "use --method mcsat, or exact",
          context.network.literal_text(example.literal, 120));
      return result;
    }
  }
  const std::unique_ptr<const Plan> plan = make_plan(context, kernel);
  if (!plan->possible) {
    MethodResult failure = explain_failure(context);
    failure.marginals = std::move(result.marginals);
    return failure;
  }
  if (plan->stopped) return stopped();
  const Schedule schedule = make_schedule(context.options, plan->queries.size());
  std::vector<ChainRecord> records(schedule.chains);
  std::atomic<std::uint64_t> done{0};
  const std::uint32_t hardware = std::max(1u, std::thread::hardware_concurrency());
  const std::uint32_t threads = context.options.threads == 0 ? hardware : context.options.threads;
  in_parallel(records.size(), threads, [&](std::size_t c) {
    run_chain(*plan, context, static_cast<std::uint32_t>(c), schedule, done, records[c]);
  });
  // A limit may have kept some chains from starting: those that have draws speak.
  const auto failed = std::ranges::count_if(records, [](const ChainRecord& r) { return r.failed_component != 0; });
  std::erase_if(records, [](const ChainRecord& r) { return r.draws == 0; });
  if (records.empty() && failed > 0 && !context.stop.reached()) {
    MethodResult failure = explain_failure(context);
    failure.marginals = std::move(result.marginals);
    return failure;
  }
  if (records.empty()) return stopped();
  summarize_queries(*plan, records, threads, context.stop, result.marginals);
  for (const ChainRecord& r : records) result.samples += r.draws;
  if (context.stop.reached() && result.samples < context.options.samples) {
    result.termination = context.stop.reason();
    result.message = fmt::format("stopped after {} of {} draws", result.samples, context.options.samples);
  } else if (std::ranges::any_of(records, [](const ChainRecord& r) { return r.hurried; })) {
    result.termination = Termination::kTimeLimit;
    result.message = "the burn-in was cut short to keep the limit";
  }
  if (std::ranges::any_of(plan->components, [](const Plan::Component& c) { return c.jump && c.queried; })) {
    result.warnings.push_back(
        "hard formulas tie variables too widely to be drawn as a whole: a search leads from one kind of world to "
        "another, "
        "and may find some kinds more often than their share, which no diagnostic shows; compare with 'exact'");
  }
  if (result.termination == Termination::kCompleted && failed > 0) {
    result.warnings.push_back(
        fmt::format("{} of {} chains found no first world that meets the hard formulas: {} of {} draws were kept",
                    failed, schedule.chains, result.samples, context.options.samples));
  }
  return result;
}

}  // namespace sherlog
