#include "inference/chain_diagnostics.h"

#include <algorithm>
#include <bit>
#include <cmath>

namespace sherlog {
namespace {

// Half a chain: `size` bits from bit `begin` on.
struct Series {
  std::span<const std::uint64_t> words;
  std::uint32_t begin = 0;
  std::uint32_t size = 0;
  double mean = 0.0;

  // 64 bits from bit i of the series on, those beyond its end are 0.
  std::uint64_t at(std::uint32_t i) const {
    if (i >= size) return 0;
    const std::uint32_t bit = begin + i;
    const std::uint32_t word = bit >> 6, shift = bit & 63u;
    std::uint64_t value = words[word] >> shift;
    if (shift != 0 && word + 1 < words.size()) value |= words[word + 1] << (64 - shift);
    const std::uint32_t left = size - i;
    return left >= 64 ? value : value & ((std::uint64_t{1} << left) - 1);
  }
  std::uint32_t count(std::uint32_t from, std::uint32_t to) const {
    std::uint32_t sum = 0;
    for (std::uint32_t i = from; i < to; i += 64) {
      std::uint64_t value = at(i);
      if (to - i < 64) value &= (std::uint64_t{1} << (to - i)) - 1;
      sum += static_cast<std::uint32_t>(std::popcount(value));
    }
    return sum;
  }
  // (1/n) sum over i of (x_i - mean)(x_{i+lag} - mean), with sums of bits.
  double autocovariance(std::uint32_t lag) const {
    std::uint32_t both = 0;
    for (std::uint32_t i = 0; i + lag < size; i += 64) {
      both += static_cast<std::uint32_t>(std::popcount(at(i) & at(i + lag)));
    }
    const double heads = count(0, size - lag), tails = count(lag, size);
    return (both - mean * (heads + tails) + mean * mean * (size - lag)) / size;
  }
};

// Eq. (10)-(13): draws over the integrated autocorrelation time, Geyer's sequences cut it where it turns to noise.
double effective_sample_size(const std::vector<Series>& halves, double within, double var_plus) {
  const std::uint32_t n = halves.front().size;
  const auto rho = [&](std::uint32_t lag) {
    double mean_covariance = 0.0;
    for (const Series& s : halves) mean_covariance += s.autocovariance(lag);
    mean_covariance /= static_cast<double>(halves.size());
    return 1.0 - (within - mean_covariance) / var_plus;
  };
  std::vector<double> rho_hat{1.0, rho(1)};
  std::uint32_t t = 0;
  double even = 1.0, odd = rho_hat[1];
  while (t + 5 < n && even + odd > 0.0) {
    t += 2;
    even = rho(t);
    odd = rho(t + 1);
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

}  // namespace

BinarySummary summarize(std::span<const std::span<const std::uint64_t>> chains, std::uint32_t draws) {
  BinarySummary result;
  if (draws == 0 || chains.empty()) return result;
  double total = 0.0;
  for (const auto& chain : chains) total += Series{chain, 0, draws, 0.0}.count(0, draws);
  const double all = static_cast<double>(draws) * static_cast<double>(chains.size());
  result.mean = total / all;
  double ess = all;
  if (draws >= 8) {
    const std::uint32_t half = draws / 2;
    std::vector<Series> halves;
    for (const auto& chain : chains) {
      halves.push_back({chain, 0, half, 0.0});
      halves.push_back({chain, draws - half, half, 0.0});
    }
    const double n = half, m = static_cast<double>(halves.size());
    double mean = 0.0, within = 0.0, between = 0.0;
    for (Series& s : halves) {
      s.mean = s.count(0, half) / n;
      mean += s.mean / m;
      within += s.mean * (1.0 - s.mean) * n / (n - 1.0) / m;  // sample variance of n bits
    }
    for (const Series& s : halves) between += (s.mean - mean) * (s.mean - mean) / (m - 1.0);
    const double var_plus = within * (n - 1.0) / n + between;  // eq. (3)
    if (var_plus <= 0.0) {
      result.rhat = 1.0;
    } else if (within <= 0.0) {
      result.rhat = kLargestRhat;
      ess = static_cast<double>(chains.size());
    } else {
      result.rhat = std::min(kLargestRhat, std::sqrt(var_plus / within));  // eq. (4)
      ess = effective_sample_size(halves, within, var_plus);
    }
    result.ess = ess;
  }
  // With few successes or failures the plain p(1-p)/ESS promises too much (at none: a certainty); one of each is added.
  const double p = (result.mean * ess + 1.0) / (ess + 2.0);
  result.mcse = std::sqrt(p * (1.0 - p) / ess);
  return result;
}

}  // namespace sherlog
