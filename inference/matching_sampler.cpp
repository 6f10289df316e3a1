#include "inference/matching_sampler.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <thread>

#include "inference/assignment.h"
#include "inference/parallel.h"
#include "inference/rng.h"

namespace sherlog {
namespace {

constexpr std::uint32_t kBatches = 25;  // of each chain
constexpr std::size_t kExchanges = 4;   // offered by each column in a sweep
constexpr double kNoError = 2e-4;       // a standard error below this
constexpr std::uint32_t kAlone = 0xffffffffu;

struct Weights {
  std::size_t rows, columns;
  std::vector<double> log_pair;   // column by column
  std::vector<double> pair;       // exp, scaled so that the largest of a column is 1
  std::vector<double> alone;      // by column, likewise
  std::vector<double> log_total;  // by column: of all rows and being alone, not scaled
  // To draw a row of a column, or being alone (after the last row), by its weight: a place at random, and there the place itself
  // with this probability, else the other one (Walker's alias method). Column by column, rows + 1 places each.
  struct Place {
    double own;
    std::uint32_t other;
  };
  std::vector<Place> places;
};

void add_places(std::span<const double> weights, double total, std::vector<Weights::Place>& places) {
  const std::size_t first = places.size(), count = weights.size();
  std::vector<std::uint32_t> small, large;
  std::vector<double> share(count);
  for (std::uint32_t i = 0; i < count; ++i) {
    share[i] = weights[i] / total * static_cast<double>(count);
    (share[i] < 1 ? small : large).push_back(i);
    places.push_back({1, i});
  }
  while (!small.empty() && !large.empty()) {
    const std::uint32_t s = small.back(), l = large.back();
    small.pop_back();
    places[first + s] = {share[s], l};
    share[l] -= 1 - share[s];
    if (share[l] >= 1) continue;
    large.pop_back();
    small.push_back(l);
  }
  // What is left of the small ones should be 1, but for rounding; what has no weight must not be drawn.
  for (const std::uint32_t i : small) {
    if (weights[i] <= 0)
      places[first + i].own = 0, places[first + i].other =
                                     static_cast<std::uint32_t>(std::ranges::max_element(weights) - weights.begin());
  }
}

Weights weights_of(std::span<const double> log_weights, std::size_t rows, std::size_t columns) {
  Weights w{rows, columns, std::vector<double>(rows * columns), std::vector<double>(rows * columns), {}, {}, {}};
  std::vector<double> choices(rows + 1);
  for (std::size_t c = 0; c < columns; ++c) {
    double largest = 0;
    for (std::size_t r = 0; r < rows; ++r) {
      w.log_pair[c * rows + r] = log_weights[r * columns + c];
      largest = std::max(largest, w.log_pair[c * rows + r]);
    }
    for (std::size_t r = 0; r < rows; ++r) w.pair[c * rows + r] = std::exp(w.log_pair[c * rows + r] - largest);
    w.alone.push_back(std::exp(-largest));
    double sum = w.alone.back();
    for (std::size_t r = 0; r < rows; ++r) sum += choices[r] = w.pair[c * rows + r];
    choices[rows] = w.alone.back();
    w.log_total.push_back(largest + std::log(sum));
    add_places(choices, sum, w.places);
  }
  return w;
}

class Chain {
 public:
  Chain(const Weights& weights, std::span<const std::uint32_t> start, std::uint64_t seed, std::uint32_t chain)
      : w_(weights),
        rng_(seed, chain),
        row_of_(start.begin(), start.end()),
        column_of_(weights.rows, kAlone),
        scratch_(weights.rows) {
    for (std::uint32_t c = 0; c < row_of_.size(); ++c) {
      if (row_of_[c] != kAlone) column_of_[row_of_[c]] = c;
    }
  }

  // `sums`: probabilities are added, column by column; nothing where null.
  void sweep(double* sums) {
    for (std::uint32_t c = 0; c < w_.columns; ++c) redraw(c, sums);
    for (std::size_t i = 0; w_.rows > 0 && i < kExchanges * w_.columns; ++i) offer_exchange();
  }

 private:
  void redraw(std::uint32_t c, double* sums) {
    if (row_of_[c] != kAlone) column_of_[row_of_[c]] = kAlone;
    const double* pair = w_.pair.data() + c * w_.rows;
    double total = w_.alone[c];
    for (std::size_t r = 0; r < w_.rows; ++r) {
      scratch_[r] = column_of_[r] != kAlone ? 0.0 : pair[r];
      total += scratch_[r];
    }
    if (total > 0) {
      const double scale = 1 / total;
      if (sums != nullptr) add(c, scale, sums);
      double point = rng_.uniform() * total;
      std::uint32_t drawn = kAlone;
      for (std::uint32_t row = 0; row < w_.rows; ++row) {
        if (scratch_[row] <= 0) continue;
        drawn = row;
        point -= scratch_[row];
        if (point < 0) break;
      }
      if (point >= 0 && w_.alone[c] > 0) drawn = kAlone;
      row_of_[c] = drawn;
    }
    if (row_of_[c] != kAlone) column_of_[row_of_[c]] = c;
  }

  void add(std::uint32_t c, double scale, double* sums) const {
    double* column = sums + c * w_.rows;
    for (std::size_t r = 0; r < w_.rows; ++r) column[r] += scratch_[r] * scale;
  }

  double log_weight(std::uint32_t c, std::uint32_t r) const { return r == kAlone ? 0.0 : w_.log_pair[c * w_.rows + r]; }

  // Column a wants a row, drawn by its weights alone, that column b holds: b gets what a had (Metropolis-Hastings). Going back, a
  // wants its old row, or, where it was alone, b wants the row again.
  void offer_exchange() {
    const std::uint32_t a = rng_.below(static_cast<std::uint32_t>(w_.columns));
    const auto places = static_cast<std::uint32_t>(w_.rows + 1);
    const std::uint32_t place = rng_.below(places);
    const Weights::Place& drawn = w_.places[std::size_t{a} * places + place];
    const std::uint32_t wanted = rng_.uniform() < drawn.own ? place : drawn.other;
    if (wanted >= w_.rows || column_of_[wanted] == kAlone || row_of_[a] == wanted) return;
    const std::uint32_t b = column_of_[wanted], had = row_of_[a];
    const double log_ratio =
        had == kAlone ? w_.log_total[a] - w_.log_total[b] : log_weight(b, had) - log_weight(b, wanted);
    if (log_ratio < 0 && rng_.uniform() >= std::exp(log_ratio)) return;
    std::swap(row_of_[a], row_of_[b]);
    column_of_[wanted] = a;
    if (had != kAlone) column_of_[had] = b;
  }

  const Weights& w_;
  Rng rng_;
  std::vector<std::uint32_t> row_of_;     // by column
  std::vector<std::uint32_t> column_of_;  // by row
  std::vector<double> scratch_;
};

double mean(std::span<const double> x) {
  double sum = 0;
  for (double v : x) sum += v;
  return sum / static_cast<double>(x.size());
}
double variance(std::span<const double> x, double m) {
  double sum = 0;
  for (double v : x) sum += (v - m) * (v - m);
  return x.size() < 2 ? 0.0 : sum / static_cast<double>(x.size() - 1);
}

// Of batch means, chain by chain, kBatches each.
Marginal summary(const std::vector<double>& batches, double draws) {
  Marginal m;
  const double overall = mean(batches);
  m.probability = std::clamp(overall, 0.0, 1.0);
  m.mcse = std::sqrt(variance(batches, overall) / static_cast<double>(batches.size()));
  // Of draws of the pair itself, whose variance is p (1 - p); an error that nobody can see needs no more of them.
  const double spread = m.probability * (1 - m.probability);
  if (*m.mcse < kNoError || spread <= 0) {
    m.ess = draws;
    m.rhat = 1.0;
    return m;
  }
  m.ess = std::min(draws, spread / (*m.mcse * *m.mcse));
  std::vector<double> means;
  for (std::size_t i = 0; i + kBatches <= batches.size(); i += kBatches) {
    means.push_back(mean(std::span<const double>(batches.data() + i, kBatches)));
  }
  m.rhat = std::sqrt(1 + variance(means, overall) / spread);
  return m;
}

}  // namespace

SampledMatching sample_matchings(std::span<const double> log_weights, std::size_t rows, std::size_t columns,
                                 const InferenceOptions& options, const StopCondition& stop) {
  const Weights weights = weights_of(log_weights, rows, columns);
  std::vector<double> gains(rows * columns);
  for (std::size_t c = 0; c < columns; ++c) {
    for (std::size_t r = 0; r < rows; ++r) gains[c * rows + r] = weights.log_pair[c * rows + r];
  }
  std::vector<std::uint32_t> start;
  for (const auto& row : best_assignment(gains, columns, rows).column_of) start.push_back(row.value_or(kAlone));
  const std::uint32_t length = std::max(1u, options.samples / (options.chains * kBatches));  // sweeps a batch
  // Batch sums by chain and batch; a batch that was not finished does not count.
  std::vector<std::vector<double>> sums(std::size_t{options.chains} * kBatches);
  std::atomic<std::uint32_t> next{0};
  const std::uint32_t threads =
      options.threads != 0 ? options.threads : std::max(1u, std::thread::hardware_concurrency());
  run_on_threads(std::min(threads, options.chains), [&] {
    for (std::uint32_t chain = next++; chain < options.chains; chain = next++) {
      Chain state(weights, start, options.seed, chain);
      for (std::uint32_t s = 0; s < std::min(options.burn_in, options.samples) && !stop.reached(); ++s)
        state.sweep(nullptr);
      for (std::uint32_t b = 0; b < kBatches; ++b) {
        std::vector<double> batch(rows * columns, 0.0);
        for (std::uint32_t s = 0; s < length; ++s) {
          if ((s & 63u) == 0 && stop.reached()) return;
          state.sweep(batch.data());
        }
        sums[chain * kBatches + b] = std::move(batch);
      }
    }
  });
  SampledMatching out;
  const bool all = std::ranges::none_of(sums, &std::vector<double>::empty);
  if (!all) std::erase_if(sums, [](const std::vector<double>& batch) { return batch.empty(); });
  if (sums.empty()) return out;
  out.samples = std::uint64_t{length} * sums.size();
  std::vector<double> means(sums.size());
  const auto add = [&](std::size_t first_row, std::size_t last_row, std::size_t first_column, std::size_t last_column) {
    for (std::size_t b = 0; b < sums.size(); ++b) {
      double sum = 0;
      for (std::size_t c = first_column; c < last_column; ++c) {
        for (std::size_t r = first_row; r < last_row; ++r) sum += sums[b][c * rows + r];
      }
      means[b] = sum / length;
    }
    if (all) {
      out.paired.push_back(summary(means, static_cast<double>(out.samples)));
      return;
    }
    Marginal m;  // chains of different lengths: an average, and no more is claimed
    m.probability = std::clamp(mean(means), 0.0, 1.0);
    m.mcse = std::sqrt(variance(means, m.probability) / static_cast<double>(means.size()));
    out.paired.push_back(m);
  };
  for (std::size_t r = 0; r < rows; ++r) {
    for (std::size_t c = 0; c < columns; ++c) add(r, r + 1, c, c + 1);
    add(r, r + 1, 0, columns);
  }
  for (std::size_t c = 0; c < columns; ++c) add(0, rows, c, c + 1);
  add(0, 0, 0, 0);  // the corner says nothing
  return out;
}

}  // namespace sherlog
