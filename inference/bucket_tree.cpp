#include "inference/bucket_tree.h"

#include <algorithm>
#include <limits>
#include <utility>

namespace sherlog {

BucketTree::BucketTree(std::span<const std::uint32_t> cardinalities, std::span<const std::vector<std::uint32_t>> scopes,
                       std::span<const std::uint32_t> order)
    : cardinalities_(cardinalities.begin(), cardinalities.end()), stride_of_(cardinalities.size(), 0) {
  const std::size_t n = cardinalities.size();
  std::vector<std::uint32_t> position(n, 0);
  for (std::uint32_t i = 0; i < order.size(); ++i) position[order[i]] = i;

  // Inputs of each bucket: (is message, index), tables first.
  std::vector<std::vector<std::pair<bool, std::uint32_t>>> inbox(n);
  for (std::uint32_t t = 0; t < scopes.size(); ++t) {
    std::uint64_t size = 1;
    std::uint32_t first = std::numeric_limits<std::uint32_t>::max();
    for (const std::uint32_t v : scopes[t]) {
      size *= cardinalities_[v];
      first = std::min(first, position[v]);
    }
    table_sizes_.push_back(size);
    inbox[first].emplace_back(false, t);
  }

  std::vector<std::vector<std::uint32_t>> message_scope(n);
  std::vector<std::uint32_t> stamp(n, 0);
  buckets_.reserve(n);
  for (std::uint32_t b = 0; b < n; ++b) {
    const std::uint32_t v = order[b];
    std::vector<std::uint32_t> joined;
    const auto collect = [&](std::span<const std::uint32_t> scope) {
      for (const std::uint32_t u : scope) {
        if (u == v || stamp[u] == b + 1) continue;
        stamp[u] = b + 1;
        joined.push_back(u);
      }
    };
    for (const auto& [is_message, index] : inbox[b]) collect(is_message ? message_scope[index] : scopes[index]);
    std::sort(joined.begin(), joined.end(),
              [&](std::uint32_t a, std::uint32_t c) { return position[a] > position[c]; });

    Bucket bucket;
    bucket.variable = v;
    bucket.cardinality = cardinalities_[v];
    for (const std::uint32_t u : joined) bucket.message_size *= cardinalities_[u];
    message_scope[b] = joined;
    joined.push_back(v);
    bucket.input_begin = static_cast<std::uint32_t>(inputs_.size());
    for (const auto& [is_message, index] : inbox[b]) {
      place_input(bucket, joined, is_message ? message_scope[index] : scopes[index], is_message, index);
      if (is_message) std::vector<std::uint32_t>().swap(message_scope[index]);
    }
    bucket.input_end = static_cast<std::uint32_t>(inputs_.size());
    if (!message_scope[b].empty()) inbox[position[message_scope[b].back()]].emplace_back(true, b);
    const std::uint64_t size = bucket.message_size * bucket.cardinality;
    largest_joined_ = std::max(largest_joined_, size);
    total_joined_ += size;
    total_messages_ += bucket.message_size;
    buckets_.push_back(bucket);
    std::vector<std::pair<bool, std::uint32_t>>().swap(inbox[b]);
  }
}

void BucketTree::place_input(Bucket& bucket, const std::vector<std::uint32_t>& joined,
                             std::span<const std::uint32_t> scope, bool is_message, std::uint32_t index) {
  Input input;
  input.is_message = is_message;
  input.index = index;
  input.coordinate_begin = static_cast<std::uint32_t>(coordinates_.size());
  std::uint32_t stride = 1;
  for (std::size_t i = scope.size(); i-- > 0;) {
    stride_of_[scope[i]] = stride;
    if (scope[i] == bucket.variable) {
      input.own_stride = stride;
    } else {
      coordinates_.push_back({scope[i], stride});
    }
    stride *= cardinalities_[scope[i]];
  }
  input.coordinate_end = static_cast<std::uint32_t>(coordinates_.size());

  std::array<Loop, 64> fused;  // innermost first
  std::size_t count = 0;
  for (std::size_t d = joined.size(); d-- > 0;) {
    const std::uint32_t cardinality = cardinalities_[joined[d]];
    if (cardinality == 1) continue;
    const std::uint32_t step = stride_of_[joined[d]];
    if (count > 0) {
      Loop& last = fused[count - 1];
      const bool continues = last.stride == 0 ? step == 0 : step == last.stride * last.count;
      if (continues) {
        last.count *= cardinality;
        continue;
      }
    }
    fused[count++] = {cardinality, step};
  }
  if (count == 0) fused[count++] = {1, 0};
  input.loop_begin = static_cast<std::uint32_t>(loops_.size());
  for (std::size_t i = count; i-- > 0;) loops_.push_back(fused[i]);
  input.loop_end = static_cast<std::uint32_t>(loops_.size());
  for (const std::uint32_t v : scope) stride_of_[v] = 0;
  inputs_.push_back(input);
}

}  // namespace sherlog
