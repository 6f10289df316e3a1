#include "perception_bridge/identity_belief.h"

#include <algorithm>
#include <cmath>

#include "inference/assignment.h"

namespace sherlog {

double IdentityBelief::appeared(std::size_t n) const {
  if (!appeared_.empty() && appeared_[n] >= 0) return appeared_[n];
  double known = 0;
  for (std::size_t o = 0; o < old_; ++o) known += same(o, n);
  return std::max(0.0, 1.0 - known);
}

ClusterExplanation IdentityBelief::unseen(std::size_t o, bool out_of_view) const {
  // Below this they differ by rounding.
  constexpr double kSame = 1e-9;
  const bool are_stated = !disappeared_.empty() && !hidden_.empty() && disappeared_[o] >= 0 && hidden_[o] >= 0;
  const double rather_hidden = are_stated ? hidden_[o] - disappeared_[o] : 0;
  const bool is_hidden = std::abs(rather_hidden) > kSame ? rather_hidden > 0 : out_of_view;
  return is_hidden ? ClusterExplanation::kHidden : ClusterExplanation::kDisappear;
}

Resolution decide(const IdentityBelief& belief, const std::vector<bool>& out_of_view) {
  const std::size_t old_clusters = belief.old_clusters(), new_clusters = belief.new_clusters();
  std::vector<double> gains;  // by new and old cluster
  for (std::size_t n = 0; n < new_clusters; ++n) {
    const double alone = belief.appeared(n);
    for (std::size_t o = 0; o < old_clusters; ++o) gains.push_back(belief.same(o, n) - alone);
  }
  Resolution decided;
  decided.association = best_assignment(gains, new_clusters, old_clusters).column_of;
  for (std::size_t o = 0; o < old_clusters; ++o) {
    decided.explanation.push_back(belief.unseen(o, out_of_view[o]));
  }
  for (std::size_t n = 0; n < new_clusters; ++n) {
    if (!decided.association[n]) continue;
    const std::uint32_t o = *decided.association[n];
    const auto& pair = belief.pair(o, n);
    decided.explanation[o] = static_cast<ClusterExplanation>(std::ranges::max_element(pair) - pair.begin());
  }
  return decided;
}

Resolution decide(const IdentityBelief& belief, const FourTablesTrial& trial) {
  std::vector<bool> out_of_view;
  for (const Observation& old : trial.old_clusters) out_of_view.push_back(old.out_of_view);
  return decide(belief, out_of_view);
}

}  // namespace sherlog
