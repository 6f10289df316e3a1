#include "perception_bridge/track_score.h"

#include <algorithm>
#include <cmath>

namespace sherlog {

void GroupedShare::add(std::uint32_t right, std::uint32_t total) {
  if (total == 0) return;
  const std::uint64_t r = right, t = total;
  right_ += r;
  total_ += t;
  ++groups_;
  right_squared_ += r * r;
  right_total_ += r * t;
  total_squared_ += t * t;
}

double GroupedShare::rate() const {
  return total_ == 0 ? 1.0 : static_cast<double>(right_) / static_cast<double>(total_);
}

GroupedShare::Interval GroupedShare::interval() const {
  constexpr double kZ = 1.959963984540054;
  if (total_ == 0) return {};
  const double n = static_cast<double>(total_), p = rate();
  // Wilson's interval as if each thing were on its own.
  const double z2 = kZ * kZ;
  const double middle = (p + z2 / (2 * n)) / (1 + z2 / n);
  const double half = kZ / (1 + z2 / n) * std::sqrt(p * (1 - p) / n + z2 / (4 * n * n));
  Interval wilson{std::max(0.0, middle - half), std::min(1.0, middle + half)};
  if (groups_ < 2 || right_ == total_ || right_ == 0) return wilson;
  const double squares = static_cast<double>(right_squared_) - 2 * p * static_cast<double>(right_total_) +
                         p * p * static_cast<double>(total_squared_);
  const double groups = static_cast<double>(groups_);
  const double deviation = kZ * std::sqrt(std::max(0.0, squares) * groups / (groups - 1)) / n;
  return {std::max(0.0, std::min(wilson.low, p - deviation)), std::min(1.0, std::max(wilson.high, p + deviation))};
}

void TrackScore::add(const FourTablesTrial& trial, const Resolution& answer) {
  std::vector<bool> acted(trial.config.objects, false);
  for (const SimulatedAction& action : trial.actions) acted[action.object] = true;
  std::uint32_t associated = 0;
  std::uint32_t right = 0, total = 0, acted_right = 0, acted_total = 0, shown_right = 0, shown_total = 0;
  const auto count = [&](std::uint32_t object, bool is_right, bool hidden) {
    ++total;
    right += is_right ? 1u : 0u;
    if (!acted[object]) return;
    ++acted_total;
    acted_right += is_right ? 1u : 0u;
    if (hidden) return;
    ++shown_total;
    shown_right += is_right ? 1u : 0u;
  };
  for (std::size_t o = 0; o < trial.old_clusters.size(); ++o) {
    count(trial.old_clusters[o].object, answer.explanation[o] == trial.truth.explanation[o],
          trial.truth.explanation[o] == ClusterExplanation::kHidden);
    const bool disappeared = answer.explanation[o] == ClusterExplanation::kDisappear;
    disappeared_out_of_view += disappeared && trial.old_clusters[o].out_of_view ? 1u : 0u;
  }
  for (std::size_t n = 0; n < trial.new_clusters.size(); ++n) {
    associated += answer.association[n] == trial.truth.association[n] ? 1u : 0u;
    const bool said = !answer.association[n], true_one = !trial.truth.association[n];
    if (said || true_one) count(trial.new_clusters[n].object, said == true_one, false);
  }
  association.add(associated, static_cast<std::uint32_t>(trial.new_clusters.size()));
  explanation.add(right, total);
  acted_on.add(acted_right, acted_total);
  acted_on_shown.add(shown_right, shown_total);
}

}  // namespace sherlog
