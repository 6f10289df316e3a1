#include "rgbd/nearest/nearest_map.h"

#include <algorithm>

namespace sherlog::rgbd {

bool NearestMap::assign(std::span<const Pixel> keypoints) {
  if (keypoints.empty() || !order_along_curve(map_, keypoints, sorted_)) return false;
  const auto index = [&](std::size_t k) { return sorted_[k] >> 32; };
  const auto last = std::ranges::unique(sorted_, {}, [](std::uint64_t entry) { return entry >> 32; });
  sorted_.erase(last.begin(), last.end());

  const std::uint32_t *indices = map_.indices.data(), *pixels = map_.pixels.data();
  std::uint32_t* nearest = nearest_.data();
  std::size_t position = 0;
  for (std::size_t k = 0; k < sorted_.size(); ++k) {
    const auto number = static_cast<std::uint32_t>(sorted_[k]);
    std::size_t end = map_.indices.size();
    if (k + 1 < sorted_.size()) {
      const auto middle = static_cast<std::uint32_t>((index(k) + index(k + 1)) / 2);  // the last of this one
      end = static_cast<std::size_t>(std::upper_bound(indices + position, indices + map_.indices.size(), middle) -
                                     indices);
    }
    for (; position < end; ++position) nearest[pixels[position]] = number;
  }
  return true;
}

}  // namespace sherlog::rgbd
