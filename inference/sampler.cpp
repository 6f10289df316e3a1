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

namespace sherlog {
namespace {

constexpr std::size_t kRecordBytes = std::size_t{1} << 29;  // for draws kept for the diagnostics, all chains together
constexpr std::uint64_t kStartFlips = 200;                  // of local search for a first world, for each variable
constexpr int kStartTries = 20;
constexpr std::uint64_t kConflictDecisions = 1000000;

// What all chains share: read only once made.
struct Plan {
  struct Component {
    std::vector<VariableId> variables;
    BlockCover cover;
    std::vector<std::uint32_t> demanded;  // nodes with a hard demand
    bool queried = false;
    bool jump = false;  // hard formulas may lock single moves in
  };
  GroundNetwork network;  // pairwise exclusions folded into at-most-one gates
  std::vector<std::uint32_t> queries;
  bool possible = true;                // false: the rewriting met a contradiction
  std::vector<std::uint32_t> decided;  // queries that the rewriting found to be constant
  std::vector<Component> components;
  std::vector<VariableId> variables;
  std::unique_ptr<WorldIndex> index;
  DefinedAtoms defined;
};

// Rewrites cliques of pairwise exclusions. Component numbers may change, variables do not.
GroundNetwork fold(const GroundNetwork& network, std::span<const ComponentId> components) {
  AtMostOne all;
  for (ComponentId c : components) {
    if (network.component_constraints(c).size() < 3) continue;
    AtMostOne found = find_at_most_one(network, c);
    std::ranges::move(found.groups, std::back_inserter(all.groups));
    all.covered.insert(all.covered.end(), found.covered.begin(), found.covered.end());
  }
  return all.groups.empty() ? network : fold_at_most_one(network, all);
}

void sort_unique(std::vector<ComponentId>& components) {
  std::ranges::sort(components);
  components.erase(std::unique(components.begin(), components.end()), components.end());
}

Plan make_plan(const MethodContext& context, Kernel kernel) {
  Plan plan;
  // Variables of the asked components, and biases, in the numbers of the rewritten network.
  std::optional<RecognisedBlocks> blocks = recognise_blocks(context.network);
  const GroundNetwork& source = blocks ? blocks->network : context.network;
  plan.possible = !blocks || blocks->possible;
  if (!plan.possible) return plan;
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
  plan.network = fold(source, components);
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
  for (ComponentId c : components) {
    Plan::Component part;
    const auto all = n.component_variables(c);
    for (std::uint32_t i : n.component_constraints(c)) {
      const std::uint32_t node = plan.index->node(n.constraints()[i].literal);
      if (plan.index->demand(node) != 0) part.demanded.push_back(node);
    }
    part.queried = !n.component_queries(c).empty();
    std::ranges::copy_if(all, std::back_inserter(part.variables),
                         [&](VariableId v) { return !plan.defined.contains(v); });
    const auto& variables = part.variables;
    part.cover = cover_component(*plan.index, variables, context.options.seed, context.stop);
    part.jump = kernel == Kernel::kMcSat && !part.cover.whole && !n.component_constraints(c).empty() &&
                !single_moves_reach_every_world(n, c);
    plan.variables.insert(plan.variables.end(), variables.begin(), variables.end());
    const auto queries = n.component_queries(c);
    plan.queries.insert(plan.queries.end(), queries.begin(), queries.end());
    plan.components.push_back(std::move(part));
  }
  std::ranges::sort(plan.queries);
  for (std::uint32_t q = 0; q < n.queries().size(); ++q) {
    if (n.queries()[q].literal.is_constant()) plan.decided.push_back(q);
  }
  return plan;
}

class Chain {
 public:
  Chain(const Plan& plan, const InferenceOptions& options, Kernel kernel, std::uint32_t number)
      : plan_(plan), world_(*plan.index), rng_(options.seed, number), number_(number), kernel_(kernel) {
    for (const Constraint& c : plan.network.constraints()) {
      // What was not asked about stays where it is.
      world_.set_demand(plan.index->node(c.literal), 0);
    }
    for (const auto& component : plan.components) {
      parts_.push_back({component.cover.blocks, nullptr, nullptr});
      if (component.cover.whole) continue;
      Part& part = parts_.back();
      part.groups = std::make_unique<GroupMoves>(*plan.index, component.variables);
      if (kernel == Kernel::kMcSat)
        part.slice = std::make_unique<SliceStep>(*plan.index, component.variables, component.jump);
      part.slice_every = part.groups->empty() ? kSliceEvery : kSliceEveryOfGroups;
      // A unit of work: one use of an atom by a gate.
      for (VariableId v : component.variables) {
        double uses = 1.0;
        for (std::uint32_t i = 0; i < plan.network.candidate_count(v); ++i) {
          uses += static_cast<double>(plan.index->uses(plan.network.first_atom(v).value + i).size());
        }
        part.block_budget += uses * (part.groups->covers(v) ? kBlockShareOfGroups : kBlockShare);
      }
    }
  }

  // A first world that meets the hard formulas. `opposite`: start as far from that world as possible. 0: found, else the
  // number of the component (plus one) that seems to have none.
  std::size_t start(const StopCondition& stop) {
    scatter();
    for (std::size_t c = 0; c < parts_.size(); ++c) {
      const auto& component = plan_.components[c];
      if (component.cover.whole && !parts_[c].blocks[0].draw(world_, rng_)) return c + 1;
      // Demands come one component after the other: whatever is broken then belongs to this one.
      for (std::uint32_t node : component.demanded) world_.set_demand(node, plan_.index->demand(node));
      if (component.cover.whole) continue;
      bool found = world_.broken().empty();
      for (int attempt = 0; !found && attempt < kStartTries && !stop.reached(); ++attempt) {
        if (attempt > 0) {
          for (VariableId v : component.variables) world_.set(v, rng_.below(plan_.network.value_count(v)));
        }
        found = sample_sat(world_, rng_, component.variables, kStartFlips * component.variables.size() + 10000, &stop);
      }
      if (!found) return c + 1;
    }
    return 0;
  }

  void sweep() {
    ++sweeps_;
    for (std::size_t c = 0; c < parts_.size(); ++c) {
      Part& part = parts_[c];
      const auto& component = plan_.components[c];
      if (!component.queried) continue;  // its first world is all that is needed of it
      if (component.cover.whole) {
        part.blocks[0].draw(world_, rng_);
        continue;
      }
      if (part.slice && (component.jump || sweeps_ % part.slice_every == 0)) part.slice->step(world_, rng_);
      for (VariableId v : component.variables) {
        if (!part.groups->covers(v)) gibbs_step(world_, v, rng_, false, scratch_);
      }
      part.groups->sweep(world_, rng_);
      if (part.blocks.empty()) continue;
      // A block is drawn once its cost has been saved up.
      for (part.credit += part.block_budget; part.credit >= part.blocks[part.next_block].cost();) {
        JointBlock& block = part.blocks[part.next_block];
        block.draw(world_, rng_);
        part.credit -= block.cost();
        part.next_block = (part.next_block + 1) % part.blocks.size();
      }
    }
    plan_.defined.draw(world_, rng_);
  }

  World& world() { return world_; }

 private:
  struct Part {
    std::vector<JointBlock> blocks;
    std::unique_ptr<SliceStep> slice;
    std::unique_ptr<GroupMoves> groups;
    std::size_t next_block = 0;
    std::uint32_t slice_every = 1;
    double block_budget = 0.0;  // table entries a sweep
    double credit = 0.0;
  };
  // Table entries of joint draws for each use of an atom in a sweep: where at-most-one groups move as a whole, joint draws add little.
  static constexpr double kBlockShare = 1.0;
  static constexpr double kBlockShareOfGroups = 0.25;
  // A slice step costs several sweeps: it comes every few of them, less often where groups move as a whole, but every time where only
  // its jumps lead everywhere.
  static constexpr std::uint32_t kSliceEvery = 4;
  static constexpr std::uint32_t kSliceEveryOfGroups = 16;

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
  World world_;
  Rng rng_;
  std::uint32_t number_;
  Kernel kernel_;
  std::vector<Part> parts_;
  std::vector<double> scratch_;
  std::uint32_t sweeps_ = 0;
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
  std::vector<std::uint32_t> counts;  // true draws by query
  std::uint32_t draws = 0;
  std::size_t failed_component = 0;
};

void run_chain(const Plan& plan, const MethodContext& context, Kernel kernel, std::uint32_t number,
               const Schedule& schedule, std::atomic<std::uint64_t>& done, ChainRecord& record) {
  Chain chain(plan, context.options, kernel, number);
  record.counts.assign(plan.queries.size(), 0);
  const std::uint32_t draws = schedule.draws_of(number);
  record.recorder = std::make_unique<BinaryRecorder>(plan.queries.size(), draws / schedule.thin + 1);
  record.failed_component = chain.start(context.stop);
  if (record.failed_component != 0) return;
  const std::uint64_t total = std::uint64_t{context.options.burn_in} + draws;
  for (std::uint64_t i = 0; i < total && !context.stop.reached(); ++i) {
    chain.sweep();
    if (i >= context.options.burn_in) {
      const bool keep = record.draws % schedule.thin == 0;
      for (std::size_t q = 0; q < plan.queries.size(); ++q) {
        const bool value = chain.world().is_true(plan.network.queries()[plan.queries[q]].literal);
        record.counts[q] += value ? 1u : 0u;
        if (keep) record.recorder->record(q, value);
      }
      if (keep) record.recorder->next_draw();
      ++record.draws;
    }
    const std::uint64_t so_far = ++done;
    if ((so_far & 63u) == 0) {
      context.stop.monitor().progress("sampling", static_cast<double>(so_far),
                                      static_cast<double>(total) * schedule.chains);
    }
  }
  record.recorder->finish();
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

void summarize_queries(const Plan& plan, const std::vector<ChainRecord>& records, std::vector<Marginal>& marginals) {
  for (std::uint32_t q : plan.decided) {
    marginals[q].probability = plan.network.queries()[q].literal == Literal::constant(true) ? 1.0 : 0.0;
  }
  std::uint32_t kept = UINT32_MAX;
  for (const ChainRecord& r : records) kept = std::min(kept, r.recorder->draws());
  for (std::size_t q = 0; q < plan.queries.size(); ++q) {
    std::vector<std::span<const std::uint64_t>> chains;
    double count = 0.0, draws = 0.0;
    for (const ChainRecord& r : records) {
      chains.push_back(r.recorder->of(q));
      count += r.counts[q];
      draws += r.draws;
    }
    const BinarySummary summary = summarize(chains, kept);
    marginals[plan.queries[q]] = {draws > 0.0 ? count / draws : 0.0, summary.mcse, summary.ess, summary.rhat};
  }
}

}  // namespace

MethodResult sample(const MethodContext& context, Kernel kernel) {
  MethodResult result;
  // What is not computed is no number, least of all 0.
  result.marginals.assign(context.network.queries().size(),
                          Marginal{std::numeric_limits<double>::quiet_NaN(), {}, {}, {}});
  if (context.components.empty()) return result;
  if (kernel == Kernel::kGibbs) {
    for (ComponentId c : context.components) {
      if (context.network.component_constraints(c).empty() || single_moves_reach_every_world(context.network, c))
        continue;
      result.termination = Termination::kRefused;
      const Constraint& example = context.network.constraints()[context.network.component_constraints(c).front()];
      result.message = fmt::format(
          "gibbs cannot reach every possible world by changing one variable at a time, because of hard formulas such "
          "as '{}'; "
          "use --method mcsat, or exact",
          context.network.literal_text(example.literal, 120));
      return result;
    }
  }
  const Plan plan = make_plan(context, kernel);
  if (!plan.possible) {
    MethodResult failure = explain_failure(context);
    failure.marginals = std::move(result.marginals);
    return failure;
  }
  const Schedule schedule = make_schedule(context.options, plan.queries.size());
  std::vector<ChainRecord> records(schedule.chains);
  std::atomic<std::uint32_t> next{0};
  std::atomic<std::uint64_t> done{0};
  const auto work = [&] {
    for (std::uint32_t c = next++; c < records.size(); c = next++)
      run_chain(plan, context, kernel, c, schedule, done, records[c]);
  };
  const std::uint32_t hardware = std::max(1u, std::thread::hardware_concurrency());
  const std::uint32_t threads =
      std::min(context.options.threads == 0 ? hardware : context.options.threads, schedule.chains);
  run_on_threads(threads, work);

  // A limit may have kept some chains from starting: those that have draws speak.
  const auto failed = std::ranges::count_if(records, [](const ChainRecord& r) { return r.failed_component != 0; });
  std::erase_if(records, [](const ChainRecord& r) { return r.draws == 0; });
  if (records.empty() && failed > 0) {
    MethodResult failure = explain_failure(context);
    failure.marginals = std::move(result.marginals);
    return failure;
  }
  if (records.empty()) {
    result.termination = context.stop.reached() ? context.stop.reason() : Termination::kTimeLimit;
    result.message = "stopped before the first draw";
    return result;
  }
  summarize_queries(plan, records, result.marginals);
  for (const ChainRecord& r : records) result.samples += r.draws;
  if (context.stop.reached() && result.samples < context.options.samples) {
    result.termination = context.stop.reason();
    result.message = fmt::format("stopped after {} of {} draws", result.samples, context.options.samples);
  } else if (failed > 0) {
    result.warnings.push_back(
        fmt::format("{} of {} chains found no first world that meets the hard formulas: {} of {} draws were kept",
                    failed, schedule.chains, result.samples, context.options.samples));
  }
  return result;
}

}  // namespace sherlog
