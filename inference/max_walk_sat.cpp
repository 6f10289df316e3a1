#include "inference/max_walk_sat.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <memory>

#include "inference/parallel.h"
#include "inference/rng.h"
#include "inference/world.h"

namespace sherlog {
namespace {

constexpr std::uint32_t kNowhere = 0xffffffffu;
constexpr std::uint32_t kMaxMoves = 48;         // looked at in one step; of longer formulas a random window
constexpr std::uint64_t kStepsPerCheck = 1024;  // between looks at the clock
constexpr double kEpsilon = 1e-9;               // scores closer than this are equal: sums drift by rounding

struct Change {
  std::int64_t broken = 0;
  double score = 0.0;
};
bool better(const Change& a, const Change& b) {
  return a.broken != b.broken ? a.broken < b.broken : a.score > b.score + kEpsilon;
}
bool equal(const Change& a, const Change& b) { return a.broken == b.broken && std::abs(a.score - b.score) <= kEpsilon; }

struct Move {
  VariableId variable;
  std::uint32_t value;
};

// Nodes in a list with positions, to draw one at random.
class NodeList {
 public:
  explicit NodeList(std::size_t nodes) : position_(nodes, kNowhere) {}
  void clear() {
    for (std::uint32_t node : nodes_) position_[node] = kNowhere;
    nodes_.clear();
  }
  void set(std::uint32_t node, bool in) {
    const std::uint32_t place = position_[node];
    if (in == (place != kNowhere)) return;
    if (in) {
      position_[node] = static_cast<std::uint32_t>(nodes_.size());
      nodes_.push_back(node);
    } else {
      nodes_[place] = nodes_.back();
      position_[nodes_.back()] = place;
      nodes_.pop_back();
      position_[node] = kNowhere;
    }
  }
  bool empty() const { return nodes_.empty(); }
  std::uint32_t size() const { return static_cast<std::uint32_t>(nodes_.size()); }
  std::uint32_t operator[](std::uint32_t i) const { return nodes_[i]; }

 private:
  std::vector<std::uint32_t> nodes_, position_;
};

// A world with lists of what is unhappy, and moves that can be tried without touching the lists.
class SearchState {
 public:
  explicit SearchState(const WorldIndex& index)
      : index_(index), network_(index.network()), broken_(index.node_count()), unhappy_(index.node_count()) {
    plain_.assign(index.atom_count(), true);
    for (std::uint32_t a = 0; a < index.atom_count(); ++a) {
      for (const auto& use : index.uses(a)) {
        if (!index.uses(index.gate_node(use.gate)).empty()) plain_[a] = false;
      }
    }
    is_or_.resize(network_.gate_count());
    for (std::size_t g = 0; g < is_or_.size(); ++g) is_or_[g] = network_.gate_kind(GateId(g)) == GateKind::kOr ? 1 : 0;
  }

  void assign(std::span<const std::uint32_t> values) {
    values_.assign(values.begin(), values.end());
    truth_.assign(index_.node_count(), 0);
    count_.assign(network_.gate_count(), 0);
    broken_.clear(), unhappy_.clear();
    for (std::size_t v = 0; v < values_.size(); ++v) {
      const VariableId variable(v);
      if (values_[v] < network_.candidate_count(variable))
        truth_[network_.first_atom(variable).index() + values_[v]] = 1;
    }
    for (std::uint32_t g = 0; g < network_.gate_count(); ++g) {
      for (Literal input : network_.gate_inputs(GateId(g))) {
        count_[g] += (truth_[index_.node(input)] != 0) != input.negated() ? 1u : 0u;
      }
      truth_[index_.gate_node(g)] = gate_truth(g) ? 1 : 0;
    }
    score_ = 0.0;
    for (std::uint32_t i = 0; i < index_.node_count(); ++i) {
      if (truth_[i] != 0) score_ += index_.weight(i);
      update_lists(i);
    }
  }

  const std::vector<std::uint32_t>& values() const { return values_; }
  std::uint32_t value(VariableId v) const { return values_[v.index()]; }
  double score() const { return score_; }
  const NodeList& broken() const { return broken_; }
  const NodeList& unhappy() const { return unhappy_; }
  bool truth(std::uint32_t node) const { return truth_[node] != 0; }

  Change probe(const Move& move) {
    const std::uint32_t first = network_.first_atom(move.variable).value;
    const std::uint32_t candidates = network_.candidate_count(move.variable);
    const std::uint32_t old = values_[move.variable.index()];
    Change change;
    if (candidates == 1 && plain_[first]) {
      peek(first, change);
      return change;
    }
    if (old < candidates) flip<false>(first + old, change);
    if (move.value < candidates) flip<false>(first + move.value, change);
    Change undone;
    if (move.value < candidates) flip<false>(first + move.value, undone);
    if (old < candidates) flip<false>(first + old, undone);
    return change;
  }

  void make(const Move& move) {
    const std::uint32_t first = network_.first_atom(move.variable).value;
    const std::uint32_t candidates = network_.candidate_count(move.variable);
    const std::uint32_t old = values_[move.variable.index()];
    Change change;
    if (old < candidates) flip<true>(first + old, change);
    if (move.value < candidates) flip<true>(first + move.value, change);
    values_[move.variable.index()] = move.value;
    score_ += change.score;
  }

 private:
  bool gate_truth(std::uint32_t gate) const { return is_or_[gate] != 0 ? count_[gate] > 0 : count_[gate] != 1; }

  void update_lists(std::uint32_t node) {
    const bool truth = truth_[node] != 0;
    const std::int8_t demand = index_.demand(node);
    if (demand != 0) broken_.set(node, demand == WorldIndex::kImpossibleDemand || truth != (demand > 0));
    const double weight = index_.weight(node);
    if (weight != 0.0) unhappy_.set(node, truth != (weight > 0.0));
  }

  void count_change(std::uint32_t node, bool becomes, Change& change) const {
    change.score += becomes ? index_.weight(node) : -index_.weight(node);
    const std::int8_t demand = index_.demand(node);
    if (demand == 1 || demand == -1) change.broken += becomes == (demand > 0) ? -1 : 1;
  }

  // What flipping an atom whose gates are all roots would do; nothing is written.
  void peek(std::uint32_t atom, Change& change) const {
    const bool becomes = truth_[atom] == 0;
    count_change(atom, becomes, change);
    for (const auto& use : index_.uses(atom)) {
      const std::uint32_t count = count_[use.gate];
      const bool literal = becomes != use.negated;
      if (is_or_[use.gate] != 0) {
        if (literal ? count == 0 : count == 1) count_change(index_.gate_node(use.gate), literal, change);
      } else {
        count_change(index_.gate_node(use.gate), count == 1, change);
      }
    }
  }

  template <bool kCommit>
  void flip(std::uint32_t node, Change& change) {
    const bool now = truth_[node] == 0;
    truth_[node] = now ? 1 : 0;
    count_change(node, now, change);
    if constexpr (kCommit) update_lists(node);
    for (const auto& use : index_.uses(node)) {
      count_[use.gate] += now != use.negated ? 1u : 0xffffffffu;
      const std::uint32_t gate = index_.gate_node(use.gate);
      if (gate_truth(use.gate) != (truth_[gate] != 0)) flip<kCommit>(gate, change);
    }
  }

  const WorldIndex& index_;
  const GroundNetwork& network_;
  std::vector<bool> plain_;  // by atom: no gate above it feeds another gate
  std::vector<std::uint8_t> is_or_;
  std::vector<std::uint32_t> values_;
  std::vector<std::uint8_t> truth_;
  std::vector<std::uint32_t> count_;
  NodeList broken_, unhappy_;
  double score_ = 0.0;
};

// Collects moves that turn a node, by walking down the gates.
class MoveFinder {
 public:
  MoveFinder(const WorldIndex& index, const SearchState& state, Rng& rng)
      : index_(index), network_(index.network()), state_(state), rng_(rng) {
    moves_.reserve(std::size_t{4} * kMaxMoves);
  }

  std::span<const Move> find(std::uint32_t node) {
    moves_.clear();
    turn(node);
    return moves_;
  }

 private:
  void turn(std::uint32_t node) {
    if (moves_.size() >= kMaxMoves) return;
    if (node < index_.atom_count()) return turn_atom(AtomId(node));
    const GateId gate(node - index_.atom_count());
    const auto inputs = network_.gate_inputs(gate);
    const auto n = static_cast<std::uint32_t>(inputs.size());
    // A true OR has to lose every true input; a start at random keeps long ones fair.
    const std::uint32_t start = rng_.below(n);
    const bool need_true_input = network_.gate_kind(gate) == GateKind::kOr && state_.truth(node);
    for (std::uint32_t i = 0; i < n && moves_.size() < kMaxMoves; ++i) {
      const Literal input = inputs[start + i < n ? start + i : start + i - n];
      const std::uint32_t below = index_.node(input);
      if (need_true_input && state_.truth(below) == input.negated()) continue;
      turn(below);
      if (need_true_input) return;
    }
  }

  void turn_atom(AtomId atom) {
    const VariableId v = network_.variable_of(atom);
    if (!state_.truth(atom.value)) {
      moves_.push_back({v, network_.value_of(atom)});
      return;
    }
    const std::uint32_t count = network_.value_count(v), current = network_.value_of(atom);
    if (count < 2) return;
    const std::uint32_t start = rng_.below(count);
    for (std::uint32_t i = 0; i < count && moves_.size() < kMaxMoves; ++i) {
      const std::uint32_t value = start + i < count ? start + i : start + i - count;
      if (value != current) moves_.push_back({v, value});
    }
  }

  const WorldIndex& index_;
  const GroundNetwork& network_;
  const SearchState& state_;
  Rng& rng_;
  std::vector<Move> moves_;
};

void descend_in(SearchState& state, const GroundNetwork& network, const StopCondition& stop) {
  bool changed = true;
  // Each change makes the pair (broken, score) better by more than kEpsilon, so this ends.
  while (changed && !stop.reached()) {
    changed = false;
    for (std::uint32_t i = 0; i < network.variable_count(); ++i) {
      if (i % kStepsPerCheck == kStepsPerCheck - 1 && stop.reached()) return;
      const VariableId v(i);
      Change best;
      Move best_move{v, state.value(v)};
      for (std::uint32_t value = 0, n = network.value_count(v); value < n; ++value) {
        if (value == state.value(v)) continue;
        const Change change = state.probe({v, value});
        if (better(change, best)) best = change, best_move.value = value;
      }
      if (best_move.value == state.value(v)) continue;
      state.make(best_move);
      changed = true;
    }
  }
}

// The best world so far, kept by replaying what was changed since.
class BestWorld {
 public:
  explicit BestWorld(std::size_t variables) : limit_(variables / 2 + 16) { log_.reserve(limit_); }
  void start(const SearchState& state) {
    values_ = state.values();
    log_.clear(), overflow_ = false;
    broken_ = state.broken().size(), score_ = state.score();
  }
  // Returns whether it was better.
  bool note(const SearchState& state, const Move& move) {
    if (log_.size() < limit_) {
      log_.push_back(move);
    } else {
      overflow_ = true;
    }
    const std::size_t broken = state.broken().size();
    if (broken > broken_ || (broken == broken_ && state.score() <= score_ + kEpsilon)) return false;
    if (overflow_) {
      values_ = state.values();
    } else {
      for (const Move& m : log_) values_[m.variable.index()] = m.value;
    }
    log_.clear(), overflow_ = false;
    broken_ = broken, score_ = state.score();
    return true;
  }
  const std::vector<std::uint32_t>& values() const { return values_; }
  std::size_t broken() const { return broken_; }
  double score() const { return score_; }

 private:
  std::size_t limit_;
  std::vector<std::uint32_t> values_;
  std::vector<Move> log_;
  bool overflow_ = false;
  std::size_t broken_ = 0;
  double score_ = 0.0;
};

LocalOptimum summary(const SearchState& state) { return {state.values(), state.broken().size(), state.score(), 0}; }

class Restart {
 public:
  Restart(const WorldIndex& index, const MaxWalkSatOptions& options, const StopCondition& stop, std::uint32_t number)
      : index_(index),
        network_(index.network()),
        options_(options),
        stop_(stop),
        rng_(options.seed, number),
        state_(index),
        finder_(index, state_, rng_),
        best_(network_.variable_count()),
        changed_at_(network_.variable_count(), 0) {}

  LocalOptimum run(const std::vector<std::uint32_t>* start, const std::atomic<std::uint32_t>& finished) {
    state_.assign(start != nullptr ? *start : random_start());
    descend_in(state_, network_, stop_);
    best_.start(state_);
    std::uint64_t step = 1, last_better = 0;
    for (; step <= options_.flips && step - last_better <= options_.patience; ++step) {
      if (step % kStepsPerCheck == 0 && (stop_.reached() || finished.load(std::memory_order_relaxed) != 0)) break;
      if (is_enough()) break;
      const NodeList& list = state_.broken().empty() ? state_.unhappy() : state_.broken();
      if (list.empty()) break;  // every weight has its way
      const auto moves = finder_.find(list[rng_.below(list.size())]);
      if (moves.empty()) continue;
      const Move move = choose(moves, step);
      state_.make(move);
      changed_at_[move.variable.index()] = step;
      if (best_.note(state_, move)) last_better = step;
    }
    state_.assign(best_.values());
    descend_in(state_, network_, stop_);
    LocalOptimum result = summary(state_);
    result.flips = step - 1;
    return result;
  }

 private:
  bool is_enough() const { return best_.broken() == 0 && best_.score() >= options_.enough; }

  std::vector<std::uint32_t> random_start() {
    std::vector<std::uint32_t> values(network_.variable_count());
    for (std::size_t v = 0; v < values.size(); ++v) values[v] = rng_.below(network_.value_count(VariableId(v)));
    return values;
  }

  bool is_tabu(VariableId v, std::uint64_t step) const {
    const std::uint64_t at = changed_at_[v.index()];
    return at != 0 && step - at <= options_.tabu;
  }

  Move choose(std::span<const Move> moves, std::uint64_t step) {
    const auto n = static_cast<std::uint32_t>(moves.size());
    if (n == 1 || rng_.uniform() < options_.noise) return moves[rng_.below(n)];
    const Move* chosen = nullptr;
    Change best;
    std::uint32_t ties = 0;
    for (const Move& move : moves) {
      const bool tabu = is_tabu(move.variable, step);
      const Change change = state_.probe(move);
      const auto broken_then = static_cast<std::int64_t>(state_.broken().size()) + change.broken;
      const auto best_broken = static_cast<std::int64_t>(best_.broken());
      const bool aspires = broken_then < best_broken ||
                           (broken_then == best_broken && state_.score() + change.score > best_.score() + kEpsilon);
      if (tabu && !aspires) continue;
      if (chosen == nullptr || better(change, best)) {
        chosen = &move, best = change, ties = 1;
      } else if (equal(change, best) && rng_.below(++ties) == 0) {
        chosen = &move;
      }
    }
    return chosen != nullptr ? *chosen : moves[rng_.below(n)];
  }

  const WorldIndex& index_;
  const GroundNetwork& network_;
  const MaxWalkSatOptions& options_;
  const StopCondition& stop_;
  Rng rng_;
  SearchState state_;
  MoveFinder finder_;
  BestWorld best_;
  std::vector<std::uint64_t> changed_at_;
};

bool better(const LocalOptimum& a, const LocalOptimum& b) {
  return a.broken != b.broken ? a.broken < b.broken : a.score > b.score + kEpsilon;
}

}  // namespace

LocalOptimum descend(const GroundNetwork& network, std::vector<std::uint32_t> start, const StopCondition& stop) {
  const WorldIndex index(network);
  SearchState state(index);
  state.assign(start);
  descend_in(state, network, stop);
  return summary(state);
}

LocalOptimum max_walk_sat(const GroundNetwork& network, const MaxWalkSatOptions& options, const StopCondition& stop,
                          std::span<const std::vector<std::uint32_t>> starts) {
  const WorldIndex index(network);
  const std::uint32_t restarts = std::max<std::uint32_t>(1, options.restarts);
  std::vector<LocalOptimum> results(restarts);
  // finished[r]: a restart before r found enough, so r need not go on; what r finds cannot matter then.
  std::vector<std::atomic<std::uint32_t>> finished(restarts);
  std::atomic<std::uint32_t> next{0}, done{0};
  const auto work = [&] {
    for (std::uint32_t r = next++; r < restarts; r = next++) {
      Restart restart(index, options, stop, r);
      results[r] = restart.run(r < starts.size() ? &starts[r] : nullptr, finished[r]);
      if (results[r].broken == 0 && results[r].score >= options.enough) {
        for (std::uint32_t later = r + 1; later < restarts; ++later) finished[later] = 1;
      }
      stop.monitor().progress("map", ++done, restarts);
    }
  };
  const std::uint32_t threads = std::clamp<std::uint32_t>(options.threads, 1, restarts);
  run_on_threads(threads, work);
  LocalOptimum best = std::move(results[0]);
  std::uint64_t flips = best.flips;
  for (std::uint32_t r = 1; r < restarts; ++r) {
    flips += results[r].flips;
    if (better(results[r], best)) best = std::move(results[r]);
  }
  best.flips = flips;
  return best;
}

}  // namespace sherlog
