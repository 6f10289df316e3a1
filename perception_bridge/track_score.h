// How right resolutions are: shares of clusters with 95 % intervals.
#pragma once

#include <cstdint>
#include <vector>

#include "perception_bridge/four_tables.h"

namespace sherlog {

// A share of things that come in groups: things of one trial are right or wrong together, so the interval comes from the spread
// between trials (the linearised variance of a ratio of means: Cochran, Sampling Techniques, 1977, section 6.3).
class GroupedShare {
 public:
  void add(std::uint32_t right, std::uint32_t total);
  std::uint64_t right() const { return right_; }
  std::uint64_t total() const { return total_; }
  double rate() const;  // 1 where there is nothing
  struct Interval {
    double low = 0, high = 1;
  };
  // 95 %; Wilson's where all trials agree, and never narrower than what whole groups say.
  Interval interval() const;

 private:
  std::uint64_t right_ = 0, total_ = 0, groups_ = 0;
  std::uint64_t right_squared_ = 0, right_total_ = 0, total_squared_ = 0;
};

struct TrackScore {
  GroupedShare association;  // of new clusters: their old one, or none, is the true one
  // Of all explanations that the truth or the answer gives: each old cluster's, and that a new one has appeared. A new cluster
  // that has appeared in one of both only counts as wrong.
  GroupedShare explanation;
  GroupedShare acted_on;  // the same, of clusters whose object was put, removed, moved or changed
  GroupedShare
      acted_on_shown;  // the same without those that are hidden in truth: what could be seen of them is in view
  // One for each old cluster outside the view that is said to have disappeared.
  std::uint64_t disappeared_out_of_view = 0;

  void add(const FourTablesTrial& trial, const Resolution& answer);
};

}  // namespace sherlog
