#include "inference/chain_diagnostics.h"

#include <algorithm>
#include <cmath>

namespace sherlog {
namespace {

// Autocorrelations are followed bit by bit up to this lag; one that is not lost in noise by then is judged by the means of
// batches, at most so many for half a chain.
constexpr std::uint32_t kMostLags = 128;
constexpr std::uint32_t kMostBatches = 64;
// Chains that differ so much have few independent draws, whatever their short lags say.
constexpr double kRhatForBatches = 1.5;

// Sets bits counted in parallel inside a word, and up to 31 words before they are added up.
class BitCounter {
 public:
  void add(std::uint64_t word) {
    if (word == 0) return;
    word -= word >> 1 & 0x5555555555555555u;
    word = (word & 0x3333333333333333u) + (word >> 2 & 0x3333333333333333u);
    bytes_ += (word + (word >> 4)) & 0x0f0f0f0f0f0f0f0fu;
    if (++pending_ == 31) fold();
  }
  std::uint32_t total() {
    fold();
    return total_;
  }

 private:
  void fold() {
    const std::uint64_t pairs = (bytes_ & 0x00ff00ff00ff00ffu) + (bytes_ >> 8 & 0x00ff00ff00ff00ffu);
    total_ += static_cast<std::uint32_t>(pairs * 0x0001000100010001u >> 48);
    bytes_ = 0;
    pending_ = 0;
  }
  std::uint64_t bytes_ = 0;
  std::uint32_t pending_ = 0, total_ = 0;
};

// Half a chain: `size` bits, those beyond are 0.
class Half {
 public:
  // From bit `begin` of `words` on.
  Half(std::span<const std::uint64_t> words, std::uint32_t begin, std::uint32_t size)
      : bits_((size + 63) / 64 + 1, 0), size_(size) {
    const std::uint32_t first = begin >> 6, shift = begin & 63u;
    for (std::uint32_t i = 0; i + 1 < bits_.size(); ++i) {
      bits_[i] = words[first + i] >> shift;
      if (shift != 0 && first + i + 1 < words.size()) bits_[i] |= words[first + i + 1] << (64 - shift);
    }
    if (size % 64 != 0) bits_[bits_.size() - 2] &= (std::uint64_t{1} << size % 64) - 1;
    heads_ = tails_ = count_ = count(0, static_cast<std::uint32_t>(bits_.size()));
  }

  double mean() const { return static_cast<double>(count_) / size_; }
  bool bit(std::uint32_t i) const { return (bits_[i >> 6] >> (i & 63u) & 1u) != 0; }
  // Set bits in so many words.
  std::uint32_t count(std::uint32_t word_begin, std::uint32_t word_end) const {
    BitCounter counter;
    for (std::uint32_t i = word_begin; i < word_end; ++i) counter.add(bits_[i]);
    return counter.total();
  }

  // (1/n) sum over i of (x_i - mean)(x_{i+lag} - mean) of lag 1, 2, ... at each call.
  double next_autocovariance() {
    ++lag_;
    heads_ -= bit(size_ - lag_) ? 1u : 0u;  // of the first n - lag draws
    tails_ -= bit(lag_ - 1) ? 1u : 0u;      // of the last n - lag draws
    const std::uint32_t skip = lag_ >> 6, shift = lag_ & 63u;
    const auto words = static_cast<std::uint32_t>(bits_.size()) - 1;
    BitCounter both;
    for (std::uint32_t i = 0; i + skip < words; ++i) {
      if (bits_[i] == 0) continue;
      const std::uint64_t high = shift == 0 ? 0 : bits_[i + skip + 1] << (64 - shift);
      both.add(bits_[i] & (bits_[i + skip] >> shift | high));
    }
    const double m = mean();
    return (both.total() - m * (heads_ + tails_) + m * m * (size_ - lag_)) / size_;
  }

 private:
  std::vector<std::uint64_t> bits_;  // one word of zeros at the end
  std::uint32_t size_, lag_ = 0;
  std::uint32_t count_ = 0, heads_ = 0, tails_ = 0;
};

// Half a chain as means of consecutive batches.
class Batches {
 public:
  Batches(const Half& half, std::uint32_t size) {
    const std::uint32_t words = std::max(1u, (size / 64 + kMostBatches - 1) / kMostBatches);
    for (std::uint32_t i = 0; (i + words) * 64 <= size; i += words)
      means_.push_back(half.count(i, i + words) / (64.0 * words));
    for (double x : means_) mean_ += x / static_cast<double>(means_.size());
  }
  std::uint32_t size() const { return static_cast<std::uint32_t>(means_.size()); }
  double mean() const { return mean_; }
  double autocovariance(std::uint32_t lag) const {
    double sum = 0.0;
    for (std::size_t i = 0; i + lag < means_.size(); ++i) sum += (means_[i] - mean_) * (means_[i + lag] - mean_);
    return sum / static_cast<double>(means_.size());
  }
  double next_autocovariance() { return autocovariance(++lag_); }

 private:
  std::vector<double> means_;
  double mean_ = 0.0;
  std::uint32_t lag_ = 0;
};

// Eq. (10)-(13): draws over the integrated autocorrelation time, Geyer's sequences cut it where it turns to noise. Nothing where they
// do not within `most_lags`.
template <class Series>
std::optional<double> effective_sample_size(std::vector<Series>& halves, std::uint32_t n, double within,
                                            double var_plus, std::uint32_t most_lags) {
  const auto next_rho = [&] {
    double mean_covariance = 0.0;
    for (Series& s : halves) mean_covariance += s.next_autocovariance();
    mean_covariance /= static_cast<double>(halves.size());
    return 1.0 - (within - mean_covariance) / var_plus;
  };
  std::vector<double> rho_hat{1.0, next_rho()};
  std::uint32_t t = 0;
  double even = 1.0, odd = rho_hat[1];
  while (t + 5 < n && even + odd > 0.0) {
    if (t > most_lags) return {};
    t += 2;
    even = next_rho();
    odd = next_rho();
    if (even + odd >= 0.0) {
      rho_hat.push_back(even);
      rho_hat.push_back(odd);
    } else {
      rho_hat.push_back(std::max(even, 0.0));
    }
  }
  const std::uint32_t last = t;
  rho_hat.resize(last + 2, 0.0);
  if (even > 0.0) rho_hat[last] = even;
  for (std::uint32_t k = 2; k + 2 <= last; k += 2) {
    const double before = rho_hat[k - 2] + rho_hat[k - 1];
    if (rho_hat[k] + rho_hat[k + 1] > before) rho_hat[k] = rho_hat[k + 1] = before / 2;
  }
  double sum = 0.0;
  for (std::uint32_t k = 0; k < std::max(last, 1u); ++k) sum += rho_hat[k];
  const double draws = static_cast<double>(n) * static_cast<double>(halves.size());
  const double tau = std::max(-1.0 + 2.0 * sum + (last > 0 ? rho_hat[last] : 0.0), 1.0 / std::log10(draws));
  return draws / tau;
}

// The variance of the mean, from the batches' own effective sample size: what the draws would need to be worth to give it.
double batched_sample_size(const std::vector<Half>& halves, std::uint32_t draws, double var_plus) {
  std::vector<Batches> batches;
  batches.reserve(halves.size());
  for (const Half& half : halves) batches.emplace_back(half, draws);
  const double n = batches.front().size(), m = static_cast<double>(batches.size());
  double mean = 0.0, within = 0.0, between = 0.0;
  for (const Batches& b : batches) {
    mean += b.mean() / m;
    within += b.autocovariance(0) * n / (n - 1.0) / m;
  }
  for (const Batches& b : batches) between += (b.mean() - mean) * (b.mean() - mean) / (m - 1.0);
  const double batch_plus = within * (n - 1.0) / n + between;
  const double all = draws * m;
  if (!(batch_plus > 0.0)) return all;
  const double size = *effective_sample_size(batches, batches.front().size(), within, batch_plus, UINT32_MAX - 2);
  return std::min(all * std::log10(all), size * var_plus / batch_plus);
}

}  // namespace

BinarySummary summarize(std::span<const std::span<const std::uint64_t>> chains, std::uint32_t draws, bool quick) {
  BinarySummary result;
  if (draws == 0 || chains.empty()) return result;
  double total = 0.0;
  for (const auto& chain : chains) total += Half(chain, 0, draws).mean() * draws;
  const double all = static_cast<double>(draws) * static_cast<double>(chains.size());
  result.mean = total / all;
  double ess = all;
  if (draws >= 8) {
    const std::uint32_t half = draws / 2;
    std::vector<Half> halves;
    for (const auto& chain : chains) {
      halves.emplace_back(chain, 0, half);
      halves.emplace_back(chain, draws - half, half);
    }
    const double n = half, m = static_cast<double>(halves.size());
    double mean = 0.0, within = 0.0, between = 0.0;
    for (const Half& s : halves) {
      mean += s.mean() / m;
      within += s.mean() * (1.0 - s.mean()) * n / (n - 1.0) / m;  // sample variance of n bits
    }
    for (const Half& s : halves) between += (s.mean() - mean) * (s.mean() - mean) / (m - 1.0);
    const double var_plus = within * (n - 1.0) / n + between;  // eq. (3)
    if (var_plus <= 0.0) {
      result.rhat = 1.0;
    } else if (within <= 0.0) {
      result.rhat = kLargestRhat;
      ess = static_cast<double>(chains.size());
    } else {
      result.rhat = std::min(kLargestRhat, std::sqrt(var_plus / within));  // eq. (4)
      // Enough batches to judge by them.
      const bool long_enough = half >= 8 * kMostLags;
      std::optional<double> size;
      if (!long_enough || !(quick || *result.rhat > kRhatForBatches)) {
        size = effective_sample_size(halves, half, within, var_plus, long_enough ? kMostLags : UINT32_MAX - 2);
      }
      ess = size ? *size : batched_sample_size(halves, half, var_plus);
    }
    result.ess = ess;
  }
  // With few successes or failures the plain p(1-p)/ESS promises too much (at none: a certainty); one of each is added.
  const double p = (result.mean * ess + 1.0) / (ess + 2.0);
  result.mcse = std::sqrt(p * (1.0 - p) / ess);
  return result;
}

}  // namespace sherlog
