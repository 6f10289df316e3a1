// The Hilbert curve over a square of 2^R x 2^R cells: neighbours on the curve are neighbours in the plane.
//
// Idea      The square is four squares in the order of a U, each with the curve of one level less, turned or mirrored. Going
//           down the levels, two bits of the index are two bits of the place. R = 0 is one cell.
// Source    Stommel, Edelkamp, Wiedemeyer, Beetz: Fractal approximate nearest neighbour search in log-log time,
//           BMVC 2013, section 3.
// Cost      index and pixel O(R); HilbertMap O(4^R) once for an image size
#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace sherlog::rgbd {

struct Pixel {
  std::int32_t x = 0, y = 0;
  bool operator==(const Pixel&) const = default;
};

inline constexpr std::int32_t kLargestImageSide = 16384;  // indices stay below 2^28

// R = ceil(log2 max(width, height)), the least whose square holds the image.
std::uint32_t hilbert_order(std::int32_t width, std::int32_t height);
// Place on the curve of a cell and back. Requires 0 <= x, y < 2^order and index < 4^order.
std::uint32_t hilbert_index(std::uint32_t order, Pixel pixel);
Pixel hilbert_pixel(std::uint32_t order, std::uint32_t index);

// Both maps of an image, as tables: made once for a size. The curve covers a square; indices outside of the image have no
// pixel and are left out of `pixels` and `indices`.
struct HilbertMap {
  std::int32_t width = 0, height = 0;
  std::uint32_t order = 0;
  std::vector<std::uint32_t> index_of;  // by pixel y * width + x: index on the curve
  std::vector<std::uint32_t> pixels;    // in the order of the curve: y * width + x
  std::vector<std::uint32_t> indices;   // of the same: index on the curve, increasing

  bool contains(Pixel p) const { return p.x >= 0 && p.y >= 0 && p.x < width && p.y < height; }
  std::uint32_t index(Pixel p) const {
    return index_of[static_cast<std::size_t>(p.y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(p.x)];
  }
  std::uint64_t cell_count() const { return std::uint64_t{1} << (2 * order); }  // C
};

// Requires 1 <= width, height <= kLargestImageSide.
HilbertMap make_hilbert_map(std::int32_t width, std::int32_t height);

// Keypoints in the order of the curve: index on the curve << 32 | number. False, and nothing is changed: one lies outside.
bool order_along_curve(const HilbertMap& map, std::span<const Pixel> keypoints, std::vector<std::uint64_t>& order);

}  // namespace sherlog::rgbd
