#include "rgbd/pose/segmentation.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <random>
#include <utility>

namespace sherlog::rgbd {
namespace {

template <class A, class B>
float squared_distance(const A& a, const B& b) {
  const float dx = a.x - b.x, dz = a.depth - b.depth;
  return dx * dx + dz * dz;
}

}  // namespace

void SpatioTemporalSegmentation::increase_k(std::span<const Keypoint> points) {
  std::ranges::stable_sort(segments_, std::greater<>{}, &Segment::age);
  for (Segment& segment : segments_) segment.count = 0;
  crowded_out_.clear();
  const float r2 = options_.radius * options_.radius;
  for (const Keypoint& point : points) {
    const auto is_near = [&](const Segment& segment) { return squared_distance(point, segment) < r2; };
    if (const auto near = std::ranges::find_if(segments_, is_near); near != segments_.end()) {
      ++near->count;
    } else if (segments_.size() < options_.most_means) {
      segments_.push_back(wake_or_make(point));
    } else if (const auto group = std::ranges::find_if(crowded_out_, is_near); group != crowded_out_.end()) {
      ++group->count;
    } else {
      crowded_out_.push_back({.x = point.x, .depth = point.depth, .count = 1});
    }
  }
}

std::size_t SpatioTemporalSegmentation::crowded_out() const {
  const auto is_group = [&](const Segment& group) { return group.count >= options_.least_group; };
  return static_cast<std::size_t>(std::ranges::count_if(crowded_out_, is_group));
}

Segment SpatioTemporalSegmentation::wake_or_make(const Keypoint& point) {
  const auto known = std::ranges::max_element(resting_, {}, [&](const Resting& rest) {
    return squared_distance(point, rest.segment) < options_.radius * options_.radius ? rest.segment.age : -1.0;
  });
  Segment segment{.x = point.x, .depth = point.depth, .born = frame_, .count = 1};
  if (known == resting_.end() || squared_distance(point, known->segment) >= options_.radius * options_.radius) {
    segment.label = ++last_label_;
    return segment;
  }
  segment.age = known->segment.age;
  segment.label = known->segment.label;
  segment.born = known->segment.born;
  resting_.erase(known);
  return segment;
}

void SpatioTemporalSegmentation::rest(const Segment& segment) {
  const std::uint64_t lived = frame_ - segment.born;
  if (lived > 0) resting_.push_back({segment, frame_ + std::min<std::uint64_t>(lived, options_.patience)});
}

double SpatioTemporalSegmentation::least_age(const Keypoint& point) const {
  double oldest = 0;
  for (const Segment& segment : segments_) {
    if (squared_distance(point, segment) < options_.radius * options_.radius) oldest = std::max(oldest, segment.age);
  }
  return std::min(options_.tenure * oldest, options_.settled);
}

std::vector<std::size_t> SpatioTemporalSegmentation::local_neighbourhood(
    std::span<const Keypoint> points, std::span<const std::vector<std::size_t>> permutations) const {
  std::vector<std::size_t> assigned(points.size(), kNone);
  const float r2 = options_.radius * options_.radius;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const double least = least_age(points[i]);
    for (const std::size_t j : permutations[i % permutations.size()]) {
      if (segments_[j].age < least || squared_distance(points[i], segments_[j]) >= r2) continue;
      assigned[i] = j;
      break;
    }
  }
  return assigned;
}

void SpatioTemporalSegmentation::mean_shift(std::span<const Keypoint> points, std::span<const std::size_t> assigned) {
  struct Sum {
    double x = 0, depth = 0;
    std::size_t count = 0;
  };
  std::vector<Sum> sums(segments_.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (assigned[i] == kNone) continue;
    Sum& sum = sums[assigned[i]];
    sum.x += static_cast<double>(points[i].x);
    sum.depth += static_cast<double>(points[i].depth);
    ++sum.count;
  }
  for (std::size_t j = 0; j < segments_.size(); ++j) {
    segments_[j].count = sums[j].count;
    if (sums[j].count == 0) continue;
    const auto count = static_cast<double>(sums[j].count);
    segments_[j].x = static_cast<float>(sums[j].x / count);  // Eq. 1
    segments_[j].depth = static_cast<float>(sums[j].depth / count);
  }
}

void SpatioTemporalSegmentation::reduce_k() {
  const float r2 = options_.radius * options_.overlap;
  std::size_t k = segments_.size();
  for (std::size_t i = k; i-- > 0;) {
    // What stands behind k is deleted; a whole segment is swapped, so that nothing of it is left behind.
    const auto remove_i = [&] { std::swap(segments_[i], segments_[--k]); };
    if (segments_[i].count == 0) {
      remove_i();
      continue;
    }
    for (std::size_t j = 0; j < i; ++j) {
      if (segments_[j].count == 0 || squared_distance(segments_[i], segments_[j]) >= r2 * r2) continue;
      if (segments_[i].age < segments_[j].age) {
        remove_i();
        break;
      }
      segments_[j].count = 0;  // deleted when its turn comes
    }
  }
  for (std::size_t i = k; i < segments_.size(); ++i) rest(segments_[i]);
  segments_.resize(k);
}

std::vector<std::vector<std::size_t>> SpatioTemporalSegmentation::permutations(std::uint64_t round) const {
  std::mt19937_64 random((options_.seed * 1000003 + frame_) * 17 + round);
  std::vector<std::vector<std::size_t>> all(kPermutations, std::vector<std::size_t>(segments_.size()));
  for (auto& permutation : all) {
    std::iota(permutation.begin(), permutation.end(), std::size_t{0});
    for (std::size_t i = permutation.size(); i > 1; --i) std::swap(permutation[i - 1], permutation[random() % i]);
  }
  return all;
}

std::vector<std::int32_t> SpatioTemporalSegmentation::next(std::span<const Keypoint> points) {
  ++frame_;
  std::erase_if(resting_, [&](const Resting& rest) { return rest.until < frame_; });
  increase_k(points);
  for (std::size_t round = 0; round < options_.rounds; ++round) {
    const auto orders = permutations(round);
    mean_shift(points, local_neighbourhood(points, orders));
    reduce_k();
  }
  for (Segment& segment : segments_) segment.age += 1 + std::sqrt(static_cast<double>(segment.count));
  std::vector<std::int32_t> labels(points.size(), 0);
  for (std::size_t i = 0; i < points.size(); ++i) {
    const double least = least_age(points[i]);
    float best = options_.radius * options_.radius;
    for (const Segment& segment : segments_) {
      const float distance = squared_distance(points[i], segment);
      if (distance >= best || segment.age < least) continue;
      best = distance;
      labels[i] = segment.label;
    }
  }
  return labels;
}

}  // namespace sherlog::rgbd
