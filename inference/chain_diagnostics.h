// Are the chains to be believed? R-hat, effective sample size and Monte Carlo standard error of a binary quantity.
//
// Idea      A marginal is the mean of the truth of an atom or formula over the draws, so a draw is one bit and 64 of them are
//           a word: autocovariances are counts of set bits in a word and its shifted neighbour. Ranks of a binary
//           quantity take two values, so rank normalisation is an affine map, under which R-hat and ESS do not change; and
//           folding around the median gives the same series or its complement. The figures below are therefore the
//           rank-normalised ones (bulk and folded) without ranking anything.
// Source    Vehtari, Gelman, Simpson, Carpenter & Buerkner, Bayesian Analysis 16(2), 2021: split R-hat eqs. (1)-(4),
//           ESS eqs. (10)-(13) with Geyer's initial monotone sequence. Checked against R's package `posterior`.
//           A slow chain's autocorrelations, which are not lost in noise within 128 lags, are summed over means of batches
//           instead (its time is then long against a batch).
// Cost      O(chains * draws / 64) for each lag; lags stop where the autocorrelation is lost in noise, at 128 at the latest.
#pragma once

#include <bit>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

namespace sherlog {

struct BinarySummary {
  double mean = 0.0;
  std::optional<double> rhat;  // none for fewer than 4 draws a chain; 1 where every draw is the same
  std::optional<double> ess;
  double mcse = 0.0;
};

// R-hat is cut here: chains that never agree would give infinity.
inline constexpr double kLargestRhat = 99.0;

// One bit a draw, first draw in the lowest bit of the first word; every chain has `draws` of them.
// `quick`: batches only, for whom time is short; a fast chain's sample size is then rough.
BinarySummary summarize(std::span<const std::span<const std::uint64_t>> chains, std::uint32_t draws,
                        bool quick = false);

// The draws of one chain for many quantities.
class BinaryRecorder {
 public:
  BinaryRecorder(std::size_t quantities, std::uint32_t capacity)
      : words_((capacity + 63) / 64), bits_(quantities * words_, 0), current_(quantities, 0) {}

  void record(std::size_t quantity, bool value) { current_[quantity] |= std::uint64_t{value} << (draws_ & 63u); }
  // After every quantity was recorded once.
  void next_draw() {
    if ((++draws_ & 63u) == 0) flush((draws_ >> 6) - 1);
  }
  void finish() {
    if ((draws_ & 63u) != 0) flush(draws_ >> 6);
  }
  std::uint32_t draws() const { return draws_; }
  std::uint32_t count(std::size_t quantity) const {
    std::uint32_t sum = 0;
    for (std::uint64_t word : of(quantity)) sum += static_cast<std::uint32_t>(std::popcount(word));
    return sum;
  }
  std::span<const std::uint64_t> of(std::size_t quantity) const { return {bits_.data() + quantity * words_, words_}; }

 private:
  void flush(std::size_t word) {
    for (std::size_t q = 0; q < current_.size(); ++q) {
      bits_[q * words_ + word] = current_[q];
      current_[q] = 0;
    }
  }
  std::size_t words_;
  std::vector<std::uint64_t> bits_;
  std::vector<std::uint64_t> current_;
  std::uint32_t draws_ = 0;
};

}  // namespace sherlog
