#include "rgbd/nearest/keypoint_queue.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace sherlog::rgbd {

KeypointQueue::KeypointQueue(const HilbertMap& map)
    : map_(map), occupied_(std::max(2 * map.order, 1u)), first_(map.cell_count()) {}

bool KeypointQueue::assign(std::span<const Pixel> keypoints) {
  std::vector<std::uint64_t> order;
  if (!order_along_curve(map_, keypoints, order)) return false;
  for (const std::uint64_t entry : sorted_) occupied_.erase(static_cast<std::uint32_t>(entry >> 32));
  sorted_ = std::move(order);
  for (std::size_t i = sorted_.size(); i-- > 0;) {
    const auto index = static_cast<std::uint32_t>(sorted_[i] >> 32);
    first_[index] = static_cast<std::uint32_t>(i);
    occupied_.insert(index);
  }
  return true;
}

void KeypointQueue::nearest(Pixel q, std::size_t k, std::vector<std::uint32_t>& found) const {
  const std::uint64_t here = map_.index(q);
  const auto behind = occupied_.successor(static_cast<std::uint32_t>(here));
  std::size_t next = behind ? first_[*behind] : sorted_.size();  // the first at or behind the query
  std::size_t before = next;                                     // one past the last before it
  for (std::size_t i = 0; i < std::min(k, sorted_.size()); ++i) {
    bool forward = before == 0;
    if (before > 0 && next < sorted_.size()) {
      forward = (sorted_[next] >> 32) - here < here - (sorted_[before - 1] >> 32);
    }
    found.push_back(static_cast<std::uint32_t>(forward ? sorted_[next++] : sorted_[--before]));
  }
}

std::vector<double> local_directions(const KeypointQueue& queue, std::span<const Pixel> keypoints, std::size_t k) {
  std::vector<double> directions;
  std::vector<std::uint32_t> near;
  for (const Pixel p : keypoints) {
    near.clear();
    queue.nearest(p, k, near);
    double x = 0.0, y = 0.0;
    for (const std::uint32_t n : near) x += keypoints[n].x, y += keypoints[n].y;
    x /= static_cast<double>(near.size()), y /= static_cast<double>(near.size());
    double xx = 0.0, xy = 0.0, yy = 0.0;
    for (const std::uint32_t n : near) {
      const double dx = keypoints[n].x - x, dy = keypoints[n].y - y;
      xx += dx * dx, xy += dx * dy, yy += dy * dy;
    }
    // Principal axis of the scatter. A round one has no direction.
    directions.push_back(xx == yy && xy == 0.0 ? 0.0 : 0.5 * std::atan2(2.0 * xy, xx - yy));
  }
  return directions;
}

}  // namespace sherlog::rgbd
