#include "inference/bounded_search.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

// Code for four doubles at once where the processor has it. They are added lane by lane whatever it has, and products
// are never fused with sums: the bits are the same everywhere.
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__AVX2__)
#define SHERLOG_WIDE_LANES 1
#endif

#if defined(__GNUC__) && !defined(__clang__)  // the others do so unasked
#define SHERLOG_UNROLL _Pragma("GCC unroll 8")
#else
#define SHERLOG_UNROLL
#endif

namespace sherlog {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr std::size_t kLanes = BoundedProblem::kLanes;
using Pack = double __attribute__((vector_size(kLanes * sizeof(double)), aligned(sizeof(double)), may_alias));

constexpr std::uint64_t kStopInterval = 1 << 21;  // steps: some milliseconds
// What a visit costs beyond multiplications, in steps.
constexpr std::uint64_t kNodeSteps = 40, kUpdateSteps = 12, kValueSteps = 4;

}  // namespace

class BoundedSearch::Walker {
 public:
  Walker(const BoundedProblem& problem, const StopCondition& stop, std::uint64_t max_steps)
      : problem_(problem), stop_(stop), max_steps_(max_steps), bottom_(problem.order.size() - 2) {
    make_levels();
    mass_.resize(values_.size());
    beliefs_.resize(problem.ratios.size());
    next_.resize(problem.order.size());
    chosen_.resize(problem.order.size());
    prefix_.resize(problem.order.size());
    total_.resize(problem.order.size());
    kept_.resize(problem.width[bottom_] + 1);
    row_weight_.resize(problem.width[bottom_], 0.0);
    transpose_matrix();
  }

  double find_some() {
    double log_value = dive();
    if (log_value > -kInfinity) return log_value;
    begin(1.0);
    if (walk_plain(Mode::kFirst, 0.0)) return -kInfinity;
    return stopped() ? -kInfinity : log_of_chosen() + std::log(total_[bottom_]);
  }

  bool run(double scale, double threshold, std::uint64_t steps, bool with_beliefs) {
    begin(scale);
    max_steps_ = steps_ + steps;
    next_check_ = std::min(steps_ + kStopInterval, max_steps_ + 1);
    if (with_beliefs) {
      std::ranges::fill(mass_, 0.0);
      std::ranges::fill(beliefs_, 0.0);
    }
    const bool completed = walk_best(with_beliefs ? Mode::kBeliefs : Mode::kSum, threshold);
    if (with_beliefs) finish_matrix();
    return completed;
  }

  double total() const { return total_[0]; }
  double dropped() const { return dropped_; }
  bool stopped() const { return out_of_steps_ || termination_ != Termination::kCompleted; }
  Termination termination() const { return out_of_steps_ ? Termination::kTooWide : termination_; }
  double full_steps() const {
    double nodes = 1.0, steps = 0.0;
    for (std::size_t depth = 0; depth < bottom_; ++depth) {
      const Level& level = levels_[depth];
      double child = 0.0;
      for (const Update& update : level.updates) child += static_cast<double>(update.packs * kLanes + kUpdateSteps);
      const auto size = static_cast<double>(level.size);
      steps += nodes * (size * (child + kValueSteps) + kNodeSteps);
      nodes *= size;
    }
    const std::size_t rows = levels_[bottom_].size;
    return steps + nodes * static_cast<double>((rows + 4) * problem_.width.back() + kValueSteps * rows + kNodeSteps);
  }
  std::uint64_t steps() const { return steps_; }
  std::uint64_t nodes() const { return nodes_; }
  double mass(std::size_t position, std::size_t value) const { return mass_[slots_[position].begin + value]; }
  double belief(std::size_t ratio_index) const { return beliefs_[ratio_index]; }

 private:
  enum class Mode { kSum, kBeliefs, kFirst };  // kFirst: ends at the first possible assignment

  // A variable's m with its sum at some depth; a variable on which no table starts to act keeps that of the depth
  // before. Slots 0, 1, ... are those of the root.
  struct Slot {
    std::size_t begin = 0;  // in values_ and mass_
    double sum = 1.0;
  };
  // Assigning a level's variable makes these tables act on another one.
  struct Update {
    std::uint32_t factor_begin = 0, factor_end = 0;
    std::size_t from = 0, to = 0;  // slots
    std::size_t packs = 0;
    double rest = 1.0;  // in the node at hand: sums of this and the later updates' variables, and of those without one
  };
  struct Level {
    std::vector<Update> updates;
    std::vector<std::size_t> others;  // slots of later variables without an update
    std::size_t own = 0;              // slot of the level's variable
    std::size_t size = 0;
    double rest = 1.0;   // in the node at hand: of all later variables
    double other = 1.0;  // of `others`
  };

  void make_levels() {
    const std::size_t n = problem_.order.size();
    std::vector<std::size_t> current(n);
    const auto new_slot = [&](std::size_t position) {
      slots_.push_back({values_.size(), 1.0});
      values_.resize(values_.size() + problem_.width[position], 0.0);
      return slots_.size() - 1;
    };
    for (std::size_t p = 0; p < n; ++p) {
      current[p] = new_slot(p);
      std::ranges::copy(problem_.base[p], values_.begin() + static_cast<std::ptrdiff_t>(slots_[p].begin));
    }
    levels_.resize(n - 1);
    for (std::uint32_t f = 0; f < problem_.factors.size();) {
      const auto& factor = problem_.factors[f];
      Update update{f, f, 0, 0, problem_.width[factor.last()] / kLanes, 1.0};
      while (f < problem_.factors.size() && problem_.factors[f].second_last() == factor.second_last() &&
             problem_.factors[f].last() == factor.last())
        ++f;
      update.factor_end = f;
      levels_[factor.second_last()].updates.push_back(update);
    }
    for (std::size_t p = 0; p + 1 < n; ++p) {
      Level& level = levels_[p];
      level.own = current[p];
      level.size = problem_.size[p];
      std::vector<bool> updated(n, false);
      for (Update& update : level.updates) {
        const std::size_t last = problem_.factors[update.factor_begin].last();
        updated[last] = true;
        update.from = current[last];
        update.to = current[last] = new_slot(last);
      }
      for (std::size_t q = p + 1; q < n; ++q) {
        if (!updated[q]) level.others.push_back(current[q]);
      }
    }
    last_slot_ = levels_.back().updates.empty() ? current[n - 1] : levels_.back().updates[0].from;
  }

  void begin(double scale) {
    dropped_ = 0.0;
    prefix_[0] = scale;
    open(0);
  }

  // Starts a node: what its children's bounds have in common.
  [[gnu::always_inline]] void open(std::size_t depth) {
    total_[depth] = 0.0;
    next_[depth] = 0;
    Level& level = levels_[depth];
    double rest = 1.0;
    for (const std::size_t slot : level.others) rest *= slots_[slot].sum;
    level.other = rest;
    for (std::size_t i = level.updates.size(); i-- > 0;) {
      rest *= slots_[level.updates[i].from].sum;
      level.updates[i].rest = rest;
    }
    level.rest = rest;
  }

  const double* row(const BoundedProblem::Factor& factor) const { return problem_.ratios.data() + place(factor); }
  [[gnu::always_inline]] std::size_t place(const BoundedProblem::Factor& factor) const {
    std::size_t at = factor.begin;
    for (std::size_t d = 0; d + 1 < factor.positions.size(); ++d)
      at += factor.strides[d] * chosen_[factor.positions[d]];
    return at;
  }

  static double sum_of(const Pack& p) { return (p[0] + p[1]) + (p[2] + p[3]); }

  // The chosen value's row times what the variable knew; returns the sum.
  [[gnu::always_inline]] double apply(const Update& update) {
    const double* from = values_.data() + slots_[update.from].begin;
    double* to = values_.data() + slots_[update.to].begin;
    Pack sum{};
    for (std::uint32_t f = update.factor_begin; f < update.factor_end; ++f) {
      const double* ratios = problem_.ratios.data() + place(problem_.factors[f]);
      sum = Pack{};
      for (std::size_t i = 0; i < update.packs; ++i) {
        const Pack product = reinterpret_cast<const Pack*>(from)[i] * reinterpret_cast<const Pack*>(ratios)[i];
        reinterpret_cast<Pack*>(to)[i] = product;
        sum += product;
      }
      from = to;
    }
    return sum_of(sum);
  }

  // Assigns `value` to the depth's variable. False: its bound is not above the threshold, it was dropped.
  template <Mode kMode>
  [[gnu::always_inline]] bool enter(std::size_t depth, std::size_t value, double threshold) {
    Level& level = levels_[depth];
    const double own = values_[slots_[level.own].begin + value];
    const double prefix = kMode == Mode::kFirst ? (own > 0.0 ? 1.0 : 0.0) : prefix_[depth] * own;
    double bound = prefix * level.rest;
    if (!(bound > threshold)) {
      dropped_ += bound;
      return false;
    }
    chosen_[depth] = value;
    double known = prefix;
    for (std::size_t i = 0; i < level.updates.size(); ++i) {
      const Update& update = level.updates[i];
      const double sum = apply(update);
      steps_ += update.packs * kLanes + kUpdateSteps;
      slots_[update.to].sum = sum;
      known *= sum;
      bound = known * (i + 1 < level.updates.size() ? level.updates[i + 1].rest : level.other);
      if (!(bound > threshold)) {
        dropped_ += bound;
        return false;
      }
    }
    prefix_[depth + 1] = prefix;
    if constexpr (kMode == Mode::kBeliefs) {
      for (const Update& update : level.updates) {
        Pack* mass = reinterpret_cast<Pack*>(mass_.data() + slots_[update.to].begin);
        for (std::size_t i = 0; i < update.packs; ++i) mass[i] = Pack{};
      }
    }
    return true;
  }

  // Hands a finished child's beliefs up.
  [[gnu::always_inline]] void hand_up(std::size_t depth) {
    const Level& level = levels_[depth];
    mass_[slots_[level.own].begin + chosen_[depth]] += total_[depth + 1];
    for (const Update& update : level.updates) {
      const Pack* mass = reinterpret_cast<const Pack*>(mass_.data() + slots_[update.to].begin);
      Pack* above = reinterpret_cast<Pack*>(mass_.data() + slots_[update.from].begin);
      for (std::size_t i = 0; i < update.packs; ++i) above[i] += mass[i];
      for (std::uint32_t f = update.factor_begin; f < update.factor_end; ++f) {
        Pack* beliefs = reinterpret_cast<Pack*>(beliefs_.data() + place(problem_.factors[f]));
        for (std::size_t i = 0; i < update.packs; ++i) beliefs[i] += mass[i];
      }
    }
  }

  // The last two variables, when all others are assigned.
  template <Mode kMode>
  [[gnu::always_inline]] double sum_pair(double threshold) {
    const Level& level = levels_[bottom_];
    const double* own = values_.data() + slots_[level.own].begin;
    const double prefix = prefix_[bottom_], last_sum = slots_[last_slot_].sum;
    std::size_t kept = 0;
    double dropped = 0.0;
    for (std::size_t x = 0; x < level.size; ++x) {
      const double weight = kMode == Mode::kFirst ? (own[x] > 0.0 ? 1.0 : 0.0) : prefix * own[x];
      const double bound = weight * last_sum;
      // Without a branch: which of them are kept is hard to foresee.
      const double keep = static_cast<double>(bound > threshold);
      row_weight_[x] = keep * weight;
      dropped += (1.0 - keep) * bound;
      kept_[kept] = x;
      kept += static_cast<std::size_t>(bound > threshold);
    }
    dropped_ += dropped;
    steps_ += (kept + 4) * problem_.width.back() + kValueSteps * level.size + kNodeSteps;
    if (level.updates.empty()) return sum_apart<kMode>();
    return transposed_.empty() ? sum_rows<kMode>(kept) : sum_matrix<kMode>(kept);
  }

  // No table joins the two.
  template <Mode kMode>
  [[gnu::always_inline]] double sum_apart() {
    const std::size_t own = slots_[levels_[bottom_].own].begin, last = slots_[last_slot_].begin;
    const double last_sum = slots_[last_slot_].sum;
    double weight = 0.0;
    for (std::size_t x = 0; x < levels_[bottom_].size; ++x) {
      weight += row_weight_[x];
      if (kMode == Mode::kBeliefs) mass_[own + x] += row_weight_[x] * last_sum;
    }
    for (std::size_t v = 0; v < problem_.size.back() && kMode == Mode::kBeliefs; ++v)
      mass_[last + v] += weight * values_[last + v];
    return weight * last_sum;
  }

  // One table joins them, and no other variable has a say in it: row weights * matrix * m of the last. The matrix stays
  // the same all the time, so what its entries weigh is multiplied by them in the end, see finish_matrix.
  template <Mode kMode>
  [[gnu::always_inline]] double sum_matrix(std::size_t kept) {
    const std::size_t own = slots_[levels_[bottom_].own].begin, last = slots_[last_slot_].begin;
    const std::size_t begin = problem_.factors[levels_[bottom_].updates[0].factor_begin].begin;
    const std::size_t width = problem_.width.back(), own_width = problem_.width[bottom_];
    // In chunks as large as registers can hold.
    double total = 0.0;
    std::size_t c = 0;
    for (; c + 6 * kLanes <= width; c += 6 * kLanes) total += sum_columns<kMode, 6>(kept, begin + c, last + c);
    for (; c + 2 * kLanes <= width; c += 2 * kLanes) total += sum_columns<kMode, 2>(kept, begin + c, last + c);
    for (; c < width; c += kLanes) total += sum_columns<kMode, 1>(kept, begin + c, last + c);
    if constexpr (kMode == Mode::kBeliefs) {
      c = 0;
      for (; c + 6 * kLanes <= own_width; c += 6 * kLanes) add_rows<6>(c, own + c, last);
      for (; c + 2 * kLanes <= own_width; c += 2 * kLanes) add_rows<2>(c, own + c, last);
      for (; c < own_width; c += kLanes) add_rows<1>(c, own + c, last);
    }
    return total;
  }

  template <Mode kMode, std::size_t kPacks>
  [[gnu::always_inline]] double sum_columns(std::size_t kept, std::size_t begin, std::size_t last_begin) {
    const std::size_t width = problem_.width.back();
    Pack last[kPacks], sum[kPacks] = {};
    const Pack* source = packs(values_, last_begin);
    SHERLOG_UNROLL for (std::size_t i = 0; i < kPacks; ++i) last[i] = source[i];
    for (std::size_t k = 0; k < kept; ++k) {
      const std::size_t row = begin + kept_[k] * width;
      const double weight = row_weight_[kept_[k]];
      const Pack* ratios = packs(problem_.ratios, row);
      SHERLOG_UNROLL for (std::size_t i = 0; i < kPacks; ++i) sum[i] += ratios[i] * weight;
      if constexpr (kMode == Mode::kBeliefs) {
        Pack* beliefs = packs(beliefs_, row);
        SHERLOG_UNROLL for (std::size_t i = 0; i < kPacks; ++i) beliefs[i] += last[i] * weight;
      }
    }
    Pack total{};
    Pack* mass = packs(mass_, last_begin);
    SHERLOG_UNROLL for (std::size_t i = 0; i < kPacks; ++i) {
      const Pack product = sum[i] * last[i];
      total += product;
      if (kMode == Mode::kBeliefs) mass[i] += product;
    }
    return sum_of(total);
  }

  // What the second last variable's values weigh: row weights times matrix * m of the last.
  template <std::size_t kPacks>
  [[gnu::always_inline]] void add_rows(std::size_t column, std::size_t own_begin, std::size_t last_begin) {
    Pack sum[kPacks] = {};
    const std::size_t own_width = problem_.width[bottom_];
    for (std::size_t v = 0; v < problem_.size.back(); ++v) {
      const double weight = values_[last_begin + v];
      const Pack* ratios = packs(transposed_, v * own_width + column);
      SHERLOG_UNROLL for (std::size_t i = 0; i < kPacks; ++i) sum[i] += ratios[i] * weight;
    }
    Pack* mass = packs(mass_, own_begin);
    const Pack* weights = packs(row_weight_, column);
    SHERLOG_UNROLL for (std::size_t i = 0; i < kPacks; ++i) mass[i] += weights[i] * sum[i];
  }

  static Pack* packs(std::vector<double>& v, std::size_t at) { return reinterpret_cast<Pack*>(v.data() + at); }
  static const Pack* packs(const std::vector<double>& v, std::size_t at) {
    return reinterpret_cast<const Pack*>(v.data() + at);
  }

  void finish_matrix() {
    const auto& updates = levels_[bottom_].updates;
    if (!single_matrix()) return;
    const std::size_t begin = problem_.factors[updates[0].factor_begin].begin;
    for (std::size_t i = 0; i < problem_.size[bottom_] * problem_.width.back(); ++i)
      beliefs_[begin + i] *= problem_.ratios[begin + i];
  }
  bool single_matrix() const {
    const auto& updates = levels_[bottom_].updates;
    return !updates.empty() && updates[0].factor_end - updates[0].factor_begin == 1 &&
           problem_.factors[updates[0].factor_begin].positions.size() == 2;
  }
  void transpose_matrix() {
    if (!single_matrix()) return;
    const std::size_t begin = problem_.factors[levels_[bottom_].updates[0].factor_begin].begin;
    const std::size_t width = problem_.width.back(), own_width = problem_.width[bottom_];
    transposed_.assign(problem_.size.back() * own_width, 0.0);
    for (std::size_t x = 0; x < problem_.size[bottom_]; ++x) {
      for (std::size_t v = 0; v < problem_.size.back(); ++v)
        transposed_[v * own_width + x] = problem_.ratios[begin + x * width + v];
    }
  }

  // Tables join them, and others have a say: row by row.
  template <Mode kMode>
  [[gnu::always_inline]] double sum_rows(std::size_t kept) {
    const Update& update = levels_[bottom_].updates[0];
    double total = 0.0;
    for (std::size_t k = 0; k < kept; ++k) {
      const std::size_t x = kept_[k];
      chosen_[bottom_] = x;
      const double mass = apply(update) * row_weight_[x];
      total += mass;
      if (kMode == Mode::kBeliefs) add_row(update, row_weight_[x], mass, x);
    }
    return total;
  }

  void add_row(const Update& update, double weight, double mass, std::size_t x) {
    const double* product = values_.data() + slots_[update.to].begin;
    double* above = mass_.data() + slots_[update.from].begin;
    mass_[slots_[levels_[bottom_].own].begin + x] += mass;
    for (std::size_t i = 0; i < update.packs * kLanes; ++i) above[i] += product[i] * weight;
    for (std::uint32_t f = update.factor_begin; f < update.factor_end; ++f) {
      double* beliefs = beliefs_.data() + place(problem_.factors[f]);
      for (std::size_t i = 0; i < update.packs * kLanes; ++i) beliefs[i] += product[i] * weight;
    }
  }

  // Every few milliseconds. False: an end is wanted.
  bool may_go_on() {
    next_check_ = std::min(steps_ + kStopInterval, max_steps_ + 1);
    out_of_steps_ = steps_ > max_steps_;
    if (!out_of_steps_ && stop_.reached()) termination_ = stop_.reason();
    return !stopped();
  }

  // Depth first; false: stopped, or (kFirst) found.
  template <Mode kMode>
  [[gnu::always_inline]] bool walk(double threshold) {
    std::size_t depth = 0;
    while (true) {
      bool entered = false;
      if (steps_ >= next_check_ && !may_go_on()) return false;
      if (depth == bottom_) {
        total_[depth] = sum_pair<kMode>(threshold);
        if (kMode == Mode::kFirst && total_[depth] > 0.0) return false;
        ++nodes_;
      } else {
        const std::size_t size = levels_[depth].size;
        if (next_[depth] == 0) steps_ += kValueSteps * size + kNodeSteps;
        while (next_[depth] < size && !entered) entered = enter<kMode>(depth, next_[depth]++, threshold);
      }
      if (entered) {
        open(++depth);
        continue;
      }
      if (depth == 0) return !stopped();
      --depth;
      total_[depth] += total_[depth + 1];
      if (kMode == Mode::kBeliefs) hand_up(depth);
    }
  }

  bool walk_best(Mode mode, double threshold) {
#ifdef SHERLOG_WIDE_LANES
    if (__builtin_cpu_supports("avx2")) return walk_wide(mode, threshold);
#endif
    return walk_plain(mode, threshold);
  }
  bool walk_plain(Mode mode, double threshold) {
    if (mode == Mode::kFirst) return walk<Mode::kFirst>(threshold);
    return mode == Mode::kBeliefs ? walk<Mode::kBeliefs>(threshold) : walk<Mode::kSum>(threshold);
  }
#ifdef SHERLOG_WIDE_LANES
  [[gnu::target("avx2")]] bool walk_wide(Mode mode, double threshold) {
    return mode == Mode::kBeliefs ? walk<Mode::kBeliefs>(threshold) : walk<Mode::kSum>(threshold);
  }
#endif

  double dive() {
    begin(1.0);
    for (std::size_t depth = 0; depth < bottom_; ++depth) {
      double best_bound = 0.0;
      std::size_t best = 0;
      for (std::size_t x = 0; x < levels_[depth].size; ++x) {
        prefix_[depth] = 1.0;
        if (!enter<Mode::kSum>(depth, x, 0.0)) continue;
        double bound = prefix_[depth + 1] * levels_[depth].other;
        for (const Update& update : levels_[depth].updates) bound *= slots_[update.to].sum;
        if (bound > best_bound) {
          best_bound = bound;
          best = x;
        }
      }
      if (best_bound <= 0.0) return -kInfinity;
      enter<Mode::kSum>(depth, best, 0.0);
      open(depth + 1);
    }
    prefix_[bottom_] = 1.0;
    return log_of_chosen() + std::log(sum_pair<Mode::kSum>(0.0));
  }

  // Of the values chosen on the way down, without those of the last two variables.
  double log_of_chosen() const {
    double sum = 0.0;
    for (std::size_t p = 0; p < bottom_; ++p) sum += std::log(values_[slots_[levels_[p].own].begin + chosen_[p]]);
    return sum;
  }

  const BoundedProblem& problem_;
  const StopCondition& stop_;
  std::uint64_t max_steps_;
  const std::size_t bottom_;   // depth at which two variables are left
  std::vector<Level> levels_;  // by position
  std::vector<Slot> slots_;
  std::size_t last_slot_ = 0;    // of the last variable when all but two are assigned
  std::vector<double> values_;   // m, by slot
  std::vector<double> mass_;     // by slot: what the node's subtree has summed up so far, by value of that variable
  std::vector<double> beliefs_;  // by ratio: the same for table entries
  std::vector<std::size_t> next_, chosen_;  // by position
  std::vector<double> prefix_, total_;      // by depth
  std::vector<std::size_t> kept_;           // values of the second last variable that are not dropped
  std::vector<double> row_weight_;          // prefix times m of that variable; 0 where dropped
  std::vector<double> transposed_;          // the table of the last two variables, where that is all that joins them
  double dropped_ = 0.0;
  std::uint64_t steps_ = 0, nodes_ = 0, next_check_ = 0;
  bool out_of_steps_ = false;
  Termination termination_ = Termination::kCompleted;
};

BoundedSearch::BoundedSearch(const BoundedProblem& problem, const StopCondition& stop, std::uint64_t max_steps)
    : walker_(std::make_unique<Walker>(problem, stop, max_steps)) {}
BoundedSearch::~BoundedSearch() = default;

double BoundedSearch::find_some() { return walker_->find_some(); }
bool BoundedSearch::run(double scale, double threshold, std::uint64_t steps, bool with_beliefs) {
  return walker_->run(scale, threshold, steps, with_beliefs);
}
double BoundedSearch::total() const { return walker_->total(); }
double BoundedSearch::dropped() const { return walker_->dropped(); }
double BoundedSearch::mass(std::size_t position, std::size_t value) const { return walker_->mass(position, value); }
double BoundedSearch::belief(std::size_t ratio_index) const { return walker_->belief(ratio_index); }
bool BoundedSearch::stopped() const { return walker_->stopped(); }
Termination BoundedSearch::termination() const { return walker_->termination(); }
double BoundedSearch::full_steps() const { return walker_->full_steps(); }
std::uint64_t BoundedSearch::steps() const { return walker_->steps(); }
std::uint64_t BoundedSearch::nodes() const { return walker_->nodes(); }

}  // namespace sherlog
