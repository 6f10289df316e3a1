#include "rgbd/depth/pyramid_inpainting.h"

#include <algorithm>
#include <limits>
#include <opencv2/core/hal/intrin.hpp>

namespace sherlog::rgbd {
namespace {

using Depth = std::uint16_t;

// Windows are sorted as signed numbers, which processors have minima and maxima of: depth less 2^15, a gap the least.
using Signed = std::int16_t;
using EightSigned = cv::v_int16x8;
constexpr Signed kGap = std::numeric_limits<Signed>::min();
Signed to_signed(Depth depth) { return static_cast<Signed>(depth ^ 0x8000); }
Depth from_signed(Signed value) { return static_cast<Depth>(static_cast<Depth>(value) ^ 0x8000); }

// A row with a gap before it and one behind, so that every window has three columns.
void pad(const Depth* row, int width, std::vector<Signed>& padded) {
  padded.assign(static_cast<std::size_t>(width) + 2, kGap);
  if (row != nullptr) std::transform(row, row + width, padded.begin() + 1, to_signed);
}

// The same few operations on one value and on eight.
Signed low_of(Signed a, Signed b) { return std::min(a, b); }
Signed high_of(Signed a, Signed b) { return std::max(a, b); }
Signed minus_one_if_gap(Signed a) { return static_cast<Signed>(a == kGap ? -1 : 0); }
Signed sum_of(Signed a, Signed b) { return static_cast<Signed>(a + b); }
Signed choose_below(Signed count, Signed limit, Signed a, Signed b) { return count < limit ? a : b; }

EightSigned low_of(const EightSigned& a, const EightSigned& b) { return cv::v_min(a, b); }
EightSigned high_of(const EightSigned& a, const EightSigned& b) { return cv::v_max(a, b); }
EightSigned minus_one_if_gap(const EightSigned& a) { return a == cv::v_setall_s16(kGap); }
EightSigned sum_of(const EightSigned& a, const EightSigned& b) { return cv::v_add_wrap(a, b); }
EightSigned choose_below(const EightSigned& count, Signed limit, const EightSigned& a, const EightSigned& b) {
  return cv::v_select(count < cv::v_setall_s16(limit), a, b);
}

template <class Value>
inline void order(Value& a, Value& b) {
  const Value low = low_of(a, b);
  b = high_of(a, b);
  a = low;
}

// Middle of the valid ones of nine.
template <class Value>
inline Value middle_of_nine(Value a, Value b, Value c, Value d, Value e, Value f, Value g, Value h, Value i) {
  Value gaps = minus_one_if_gap(a);  // less than zero, so many as there are
  for (const Value* v : {&b, &c, &d, &e, &f, &g, &h, &i}) gaps = sum_of(gaps, minus_one_if_gap(*v));
  // 25 comparators in 7 layers, the fewest there can be.
  order(a, d), order(b, h), order(c, f), order(e, i);
  order(a, h), order(c, e), order(d, i), order(f, g);
  order(a, c), order(b, d), order(e, f), order(h, i);
  order(b, e), order(d, g), order(f, h);
  order(a, b), order(c, e), order(d, f), order(g, i);
  order(c, d), order(e, f), order(g, h);
  order(b, c), order(d, e), order(f, g);
  // With k gaps the valid ones are number k ... 8; the nearer middle is number (k + 8) / 2.
  Value middle = choose_below(gaps, -1, f, e);
  middle = choose_below(gaps, -3, g, middle);
  middle = choose_below(gaps, -5, h, middle);
  return choose_below(gaps, -7, i, middle);
}

// Nearer middle of the valid ones of four, or a gap.
inline Depth middle_of_four(Depth a, Depth b, Depth c, Depth d) {
  const auto gaps = static_cast<Depth>((a == 0) + (b == 0) + (c == 0) + (d == 0));
  const auto sort_two = [](Depth& low, Depth& high) {
    const Depth least = std::min(low, high);
    high = std::max(low, high);
    low = least;
  };
  sort_two(a, b), sort_two(c, d), sort_two(a, c), sort_two(b, d), sort_two(b, c);
  Depth middle = b;
  middle = gaps >= 1 ? c : middle;  // of three the second, of two the first
  return gaps >= 3 ? d : middle;
}

inline Depth mean_of_four(Depth a, Depth b, Depth c, Depth d) {
  const std::uint32_t count = static_cast<std::uint32_t>((a != 0) + (b != 0) + (c != 0) + (d != 0));
  const std::uint32_t sum = std::uint32_t{a} + b + c + d;
  return count == 0 ? Depth{0} : static_cast<Depth>((sum + count / 2) / count);
}

template <class Middle>
void halve(const DepthImage& depth, DepthImage& halved, Middle middle) {
  halved.create((depth.rows + 1) / 2, (depth.cols + 1) / 2);
  const int pairs = depth.cols / 2;
  for (int y = 0; y < halved.rows; ++y) {
    const Depth* upper = depth[2 * y];
    const bool has_lower = 2 * y + 1 < depth.rows;
    const Depth* lower = depth[has_lower ? 2 * y + 1 : 2 * y];
    const auto keep = static_cast<Depth>(has_lower ? 0xFFFF : 0);
    const auto below = [&](int x) { return static_cast<Depth>(lower[x] & keep); };
    Depth* out = halved[y];
    for (int x = 0; x < pairs; ++x) out[x] = middle(upper[2 * x], upper[2 * x + 1], below(2 * x), below(2 * x + 1));
    if (pairs < halved.cols) out[pairs] = middle(upper[2 * pairs], Depth{0}, below(2 * pairs), Depth{0});
  }
}

// Calls row(above, here, below, out) with padded rows.
template <class Row>
void over_windows(const DepthImage& depth, DepthImage& result, Row row) {
  result.create(depth.size());
  std::vector<Signed> above, here, below;
  pad(nullptr, depth.cols, above);
  pad(depth.rows > 0 ? depth[0] : nullptr, depth.cols, here);
  for (int y = 0; y < depth.rows; ++y) {
    pad(y + 1 < depth.rows ? depth[y + 1] : nullptr, depth.cols, below);
    row(above.data(), here.data(), below.data(), result[y]);
    above.swap(here);
    here.swap(below);
  }
}

}  // namespace

void selective_median(const DepthImage& depth, DepthImage& smoothed) {
  const int width = depth.cols;
  over_windows(depth, smoothed, [width](const Signed* a, const Signed* b, const Signed* c, Depth* out) {
    int x = 0;
    const auto eight = [](const Signed* row) { return cv::v_load(row); };
    for (; x + EightSigned::nlanes <= width; x += EightSigned::nlanes) {
      const EightSigned middle =
          middle_of_nine(eight(a + x), eight(a + x + 1), eight(a + x + 2), eight(b + x), eight(b + x + 1),
                         eight(b + x + 2), eight(c + x), eight(c + x + 1), eight(c + x + 2));
      cv::v_store(out + x, cv::v_reinterpret_as_u16(middle) ^ cv::v_setall_u16(0x8000));
    }
    for (; x < width; ++x) {
      out[x] =
          from_signed(middle_of_nine(a[x], a[x + 1], a[x + 2], b[x], b[x + 1], b[x + 2], c[x], c[x + 1], c[x + 2]));
    }
  });
}

void selective_halving(const DepthImage& depth, DepthImage& halved) { halve(depth, halved, middle_of_four); }
void selective_mean_halving(const DepthImage& depth, DepthImage& halved) { halve(depth, halved, mean_of_four); }

void selective_binomial(const DepthImage& depth, DepthImage& smoothed) {
  const int width = depth.cols;
  over_windows(depth, smoothed, [width](const Signed* a, const Signed* b, const Signed* c, Depth* __restrict out) {
    const auto row_sum = [](const Signed* r, int x) {
      return static_cast<std::uint32_t>(from_signed(r[x]) + 2 * from_signed(r[x + 1]) + from_signed(r[x + 2]));
    };
    const auto row_weight = [](const Signed* r, int x) {
      return static_cast<std::uint32_t>((r[x] != kGap) + 2 * (r[x + 1] != kGap) + (r[x + 2] != kGap));
    };
    for (int x = 0; x < width; ++x) {
      const std::uint32_t weight = row_weight(a, x) + 2 * row_weight(b, x) + row_weight(c, x);
      const std::uint32_t sum = row_sum(a, x) + 2 * row_sum(b, x) + row_sum(c, x);
      out[x] = weight == 0 ? Depth{0} : static_cast<Depth>((sum + weight / 2) / weight);
    }
  });
}

void PyramidInpainting::apply(const DepthImage& depth, DepthImage& filled) {
  const bool median = filter_ == InpaintingFilter::kMedian;
  std::size_t count = 1;
  for (cv::Size size = depth.size(); size.width > 1 || size.height > 1; ++count) {
    size = {(size.width + 1) / 2, (size.height + 1) / 2};
  }
  levels_.resize(count);
  filled_.resize(count);
  levels_[0] = depth;
  for (std::size_t level = 0; level + 1 < count; ++level) {
    (median ? selective_median : selective_binomial)(levels_[level], smoothed_);
    (median ? selective_halving : selective_mean_halving)(smoothed_, levels_[level + 1]);
  }
  if (count == 1) {
    depth.copyTo(filled);
    return;
  }
  // From the top down: a gap takes what its pixel of the next level has by now.
  for (std::size_t level = count - 1; level-- > 0;) {
    const DepthImage& own = levels_[level];
    const DepthImage& upper = level + 2 == count ? levels_[level + 1] : filled_[level + 1];
    DepthImage& target = level == 0 ? filled : filled_[level];
    target.create(own.size());
    for (int y = 0; y < own.rows; ++y) {
      const Depth *in = own[y], *coarse = upper[y / 2];
      Depth* out = target[y];
      for (int x = 0; x + 1 < own.cols; x += 2) {
        const Depth value = coarse[x / 2];
        out[x] = in[x] != 0 ? in[x] : value;
        out[x + 1] = in[x + 1] != 0 ? in[x + 1] : value;
      }
      if (own.cols % 2 != 0) out[own.cols - 1] = in[own.cols - 1] != 0 ? in[own.cols - 1] : coarse[own.cols / 2];
    }
  }
}

void inpaint_by_diffusion(const DepthImage& depth, DepthImage& filled) {
  depth.copyTo(filled);
  for (int y = filled.rows - 1; y >= 0; --y) {
    for (int x = 0; x < filled.cols; ++x) {
      if (filled(y, x) != 0) continue;
      const Depth left = x > 0 ? filled(y, x - 1) : Depth{0};
      const Depth lower = y + 1 < filled.rows ? filled(y + 1, x) : Depth{0};
      const Depth corner = x > 0 && y + 1 < filled.rows ? filled(y + 1, x - 1) : Depth{0};
      filled(y, x) = mean_of_four(left, lower, corner, 0);
    }
  }
}

}  // namespace sherlog::rgbd
