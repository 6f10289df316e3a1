#include "rgbd/nearest/hilbert_curve.h"

#include <algorithm>
#include <utility>

namespace sherlog::rgbd {
namespace {

// Turns a cell of a quadrant of side `side` into the frame of the curve in that quadrant, and back: its own inverse.
void turn(std::int32_t side, std::int32_t quadrant_x, std::int32_t quadrant_y, Pixel& p) {
  if (quadrant_y != 0) return;
  if (quadrant_x != 0) p = {side - 1 - p.x, side - 1 - p.y};
  std::swap(p.x, p.y);
}

// Walks the curve over a square with `side` cells from `corner`; `along` and `across` are the square's sides as the curve
// sees them. Squares without a pixel are passed over as a whole.
class Walk {
 public:
  explicit Walk(HilbertMap& map) : map_(map) {}

  void square(std::int32_t side, Pixel corner, Pixel along, Pixel across, std::uint32_t index) {
    // The corner is where the curve enters; the other three follow from the two sides.
    const std::int32_t reach = side - 1;
    const Pixel far{corner.x + reach * (along.x + across.x), corner.y + reach * (along.y + across.y)};
    if (std::min(corner.x, far.x) >= map_.width || std::min(corner.y, far.y) >= map_.height) return;
    if (side == 1) {
      const auto pixel = static_cast<std::uint32_t>(corner.y * map_.width + corner.x);
      map_.index_of[pixel] = index;
      map_.pixels.push_back(pixel);
      map_.indices.push_back(index);
      return;
    }
    // Up, right, down with `across` upwards: the first quarter is mirrored along the diagonal, the last along the other.
    const std::int32_t half = side / 2;
    const auto quarter = static_cast<std::uint32_t>(half) * static_cast<std::uint32_t>(half);
    const auto at = [&](std::int32_t a, std::int32_t b) {
      return Pixel{corner.x + a * along.x + b * across.x, corner.y + a * along.y + b * across.y};
    };
    square(half, corner, across, along, index);
    square(half, at(0, half), along, across, index + quarter);
    square(half, at(half, half), along, across, index + 2 * quarter);
    square(half, at(side - 1, half - 1), {-across.x, -across.y}, {-along.x, -along.y}, index + 3 * quarter);
  }

 private:
  HilbertMap& map_;
};

}  // namespace

std::uint32_t hilbert_order(std::int32_t width, std::int32_t height) {
  std::uint32_t order = 0;
  while ((std::int32_t{1} << order) < std::max(width, height)) ++order;
  return order;
}

std::uint32_t hilbert_index(std::uint32_t order, Pixel p) {
  std::uint32_t index = 0;
  for (std::int32_t side = (std::int32_t{1} << order) / 2; side > 0; side /= 2) {
    const std::int32_t x = (p.x & side) != 0 ? 1 : 0, y = (p.y & side) != 0 ? 1 : 0;
    // Quarters in the order (0,0), (0,1), (1,1), (1,0).
    index +=
        static_cast<std::uint32_t>(side) * static_cast<std::uint32_t>(side) * static_cast<std::uint32_t>((3 * x) ^ y);
    p = {p.x & (side - 1), p.y & (side - 1)};
    turn(side, x, y, p);
  }
  return index;
}

Pixel hilbert_pixel(std::uint32_t order, std::uint32_t index) {
  Pixel p;
  for (std::uint32_t level = 0; level < order; ++level) {
    const std::int32_t side = std::int32_t{1} << level;
    const std::uint32_t quarter = index & 3u;
    const std::int32_t x = quarter >= 2 ? 1 : 0, y = quarter == 1 || quarter == 2 ? 1 : 0;
    turn(side, x, y, p);
    p = {p.x + x * side, p.y + y * side};
    index >>= 2;
  }
  return p;
}

HilbertMap make_hilbert_map(std::int32_t width, std::int32_t height) {
  HilbertMap map;
  map.width = width;
  map.height = height;
  map.order = hilbert_order(width, height);
  const std::size_t size = static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
  map.index_of.resize(size);
  map.pixels.reserve(size);
  map.indices.reserve(size);
  Walk(map).square(std::int32_t{1} << map.order, {0, 0}, {1, 0}, {0, 1}, 0);
  return map;
}

bool order_along_curve(const HilbertMap& map, std::span<const Pixel> keypoints, std::vector<std::uint64_t>& order) {
  if (!std::ranges::all_of(keypoints, [&](Pixel p) { return map.contains(p); })) return false;
  order.clear();
  for (std::size_t k = 0; k < keypoints.size(); ++k) {
    order.push_back(std::uint64_t{map.index(keypoints[k])} << 32 | k);
  }
  std::ranges::sort(order);
  return true;
}

}  // namespace sherlog::rgbd
