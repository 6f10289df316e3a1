// The baseline of the pose paper: graph segmentation of a frame, and labels from frame to frame by overlap.
//
// Idea      Pixels are joined along edges to their eight neighbours, the least difference first, as long as the
//           difference is not above what either side holds already plus k / size. Segments of the next frame take the
//           label of the one that they share most pixels with, each label once.
// Source    Felzenszwalb, Huttenlocher: Efficient graph-based image segmentation, IJCV 59, 2004. The paper runs it over
//           space and time; one frame at a time with matching is what a live system could have.
// Cost      O(pixels log pixels) a frame
#pragma once

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <set>
#include <tuple>
#include <vector>

#include "rgbd/depth/disparity.h"

namespace sherlog::rgbd {

struct GraphSegmentationOptions {
  float scale = 30000;     // k, steps times pixels: less cuts people into pieces
  int least_pixels = 100;  // smaller segments are merged with the neighbour that differs least
};

class GraphSegmentation {
 public:
  explicit GraphSegmentation(const GraphSegmentationOptions& options = {}) : options_(options) {}

  // Number of the segment of each pixel from 1, 0 outside of the mask.
  cv::Mat1i segment(const DisparityImage& disparity, const MaskImage& mask) {
    start(disparity.total());
    std::vector<Edge> edges;
    const int width = disparity.cols;
    for (int y = 0; y < disparity.rows; ++y) {
      for (int x = 0; x < width; ++x) {
        if (mask(y, x) == 0) continue;
        for (const auto& [dx, dy] : {std::pair{1, 0}, {0, 1}, {1, 1}, {-1, 1}}) {
          const int u = x + dx, v = y + dy;
          if (u < 0 || u >= width || v >= disparity.rows || mask(v, u) == 0) continue;
          edges.push_back({std::abs(disparity(y, x) - disparity(v, u)), y * width + x, v * width + u});
        }
      }
    }
    std::ranges::stable_sort(edges, {}, &Edge::weight);
    for (const Edge& edge : edges) {
      const int a = find(edge.a), b = find(edge.b);
      if (a != b && edge.weight <= std::min(limit(a), limit(b))) join(a, b, edge.weight);
    }
    for (const Edge& edge : edges) {
      const int a = find(edge.a), b = find(edge.b);
      if (a != b && std::min(size_[at(a)], size_[at(b)]) < options_.least_pixels) join(a, b, edge.weight);
    }
    cv::Mat1i labels(disparity.size(), 0);
    std::map<int, int> numbers;
    for (int i = 0; i < static_cast<int>(disparity.total()); ++i) {
      const int y = i / width, x = i % width;
      if (mask(y, x) != 0) labels(y, x) = numbers.emplace(find(i), static_cast<int>(numbers.size()) + 1).first->second;
    }
    return labels;
  }

  // The same with labels that last.
  cv::Mat1i next(const DisparityImage& disparity, const MaskImage& mask) {
    cv::Mat1i labels = segment(disparity, mask);
    std::map<std::pair<int, int>, int> shared;
    std::set<int> numbers;
    for (int y = 0; y < labels.rows; ++y) {
      for (int x = 0; x < labels.cols; ++x) {
        if (labels(y, x) == 0) continue;
        numbers.insert(labels(y, x));
        if (!previous_.empty() && previous_(y, x) != 0) ++shared[{labels(y, x), previous_(y, x)}];
      }
    }
    std::vector<std::tuple<int, int, int>> overlaps;  // less pixels, own number, label before
    for (const auto& [pair, pixels] : shared) overlaps.emplace_back(-pixels, pair.first, pair.second);
    std::ranges::sort(overlaps);
    std::map<int, int> names;
    std::set<int> taken;
    for (const auto& [less, number, label] : overlaps) {
      if (names.contains(number) || taken.contains(label)) continue;
      names[number] = label;
      taken.insert(label);
    }
    for (const int number : numbers) {
      if (!names.contains(number)) names[number] = ++last_label_;
    }
    for (int& label : labels) label = label == 0 ? 0 : names[label];
    previous_ = labels;
    return labels;
  }

 private:
  struct Edge {
    float weight = 0;
    int a = 0, b = 0;
  };
  static std::size_t at(int i) { return static_cast<std::size_t>(i); }
  void start(std::size_t count) {
    parent_.resize(count);
    std::iota(parent_.begin(), parent_.end(), 0);
    size_.assign(count, 1);
    inside_.assign(count, 0.0F);
  }
  int find(int i) {
    while (parent_[at(i)] != i) i = parent_[at(i)] = parent_[at(parent_[at(i)])];
    return i;
  }
  float limit(int root) const { return inside_[at(root)] + options_.scale / static_cast<float>(size_[at(root)]); }
  void join(int a, int b, float weight) {
    if (size_[at(a)] < size_[at(b)]) std::swap(a, b);
    parent_[at(b)] = a;
    size_[at(a)] += size_[at(b)];
    inside_[at(a)] = std::max(weight, std::max(inside_[at(a)], inside_[at(b)]));
  }

  GraphSegmentationOptions options_;
  std::vector<int> parent_, size_;
  std::vector<float> inside_;  // the greatest difference that joined it
  cv::Mat1i previous_;
  int last_label_ = 0;
};

}  // namespace sherlog::rgbd
