// How a small table is combined with a large one whose variables include its own: the inner loops of elimination.
//
// Idea      The large (joined) table is walked in its own order; the small one is met by strides, neighbouring loops fused.
// See       bucket_tree.h (how the loops are made), elimination.h and elimination_plan.h (their users)
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "inference/bucket_tree.h"

namespace sherlog::table_walk {

// Calls visit(begin, offset, count, stride) for the innermost runs of a joined table, in its order: its entries
// begin..begin+count-1 meet the smaller table's entries offset, offset + stride, ...
template <class Visit>
void walk(std::span<const BucketTree::Loop> loops, Visit&& visit) {
  std::array<std::uint32_t, 64> counter{};
  const BucketTree::Loop inner = loops.back();
  const std::size_t depth = loops.size() - 1;
  std::size_t begin = 0, offset = 0;
  while (true) {
    visit(begin, offset, inner.count, inner.stride);
    begin += inner.count;
    std::size_t d = depth;
    while (d > 0) {
      --d;
      offset += loops[d].stride;
      if (++counter[d] < loops[d].count) break;
      offset -= std::size_t{loops[d].stride} * loops[d].count;
      counter[d] = 0;
      if (d == 0) return;
    }
    if (depth == 0) return;
  }
}

// Offsets into the smaller table for the next entries of the joined one: where inner runs are short, walking them loop by
// loop costs more than the entries, and the same few offsets come again and again.
struct Block {
  static constexpr std::uint32_t kMost = 256, kShortRun = 16;

  // Takes the innermost loops whose entries fit; `rest` gets the loops outside.
  Block(std::span<const BucketTree::Loop> loops, std::span<const BucketTree::Loop>& rest) {
    std::size_t d = loops.size();
    while (d > 0 && size * loops[d - 1].count <= kMost) {
      const BucketTree::Loop loop = loops[--d];
      for (std::uint32_t k = 1; k < loop.count; ++k) {
        for (std::uint32_t i = 0; i < size; ++i) offset[k * size + i] = offset[i] + k * loop.stride;
      }
      size *= loop.count;
    }
    rest = loops.first(d);
  }

  std::uint32_t size = 1;
  std::array<std::uint32_t, kMost> offset{};
};

template <class Combine>
void combine_run(const double* source, double* target, std::uint32_t count, std::uint32_t stride, Combine combine) {
  if (stride == 0) {
    const double value = *source;
    for (std::uint32_t i = 0; i < count; ++i) target[i] = combine(target[i], value);
  } else if (stride == 1) {
    for (std::uint32_t i = 0; i < count; ++i) target[i] = combine(target[i], source[i]);
  } else {
    for (std::uint32_t i = 0; i < count; ++i) target[i] = combine(target[i], source[std::size_t{i} * stride]);
  }
}

template <class Combine>
void combine_into(std::span<const BucketTree::Loop> loops, const double* in, double* out, Combine combine) {
  if (loops.size() > 4 && loops.back().count < Block::kShortRun) {
    std::span<const BucketTree::Loop> rest;
    const Block block(loops, rest);
    const auto visit = [&](std::size_t begin, std::size_t offset, std::uint32_t count, std::uint32_t stride) {
      double* target = out + begin * block.size;
      for (std::uint32_t j = 0; j < count; ++j, target += block.size) {
        const double* source = in + offset + std::size_t{j} * stride;
        for (std::uint32_t i = 0; i < block.size; ++i) target[i] = combine(target[i], source[block.offset[i]]);
      }
    };
    if (rest.empty()) {
      visit(0, 0, 1, 0);
    } else {
      walk(rest, visit);
    }
    return;
  }
  walk(loops, [&](std::size_t begin, std::size_t offset, std::uint32_t count, std::uint32_t stride) {
    combine_run(in + offset, out + begin, count, stride, combine);
  });
}

// Sums a joined table over whatever the smaller table lacks.
inline void sum_onto(std::span<const BucketTree::Loop> loops, const double* joined, double* out) {
  walk(loops, [&](std::size_t begin, std::size_t offset, std::uint32_t count, std::uint32_t stride) {
    const double* source = joined + begin;
    double* target = out + offset;
    if (stride == 0) {
      double sum = 0.0;
      for (std::uint32_t i = 0; i < count; ++i) sum += source[i];
      *target += sum;
    } else {
      for (std::uint32_t i = 0; i < count; ++i) target[std::size_t{i} * stride] += source[i];
    }
  });
}

inline constexpr auto kTimes = [](double a, double b) { return a * b; };
inline constexpr auto kPlus = [](double a, double b) { return a + b; };

inline std::vector<std::uint64_t> starts(std::size_t count, auto size_of) {
  std::vector<std::uint64_t> start(count + 1, 0);
  for (std::size_t i = 0; i < count; ++i) start[i + 1] = start[i] + size_of(i);
  return start;
}

}  // namespace sherlog::table_walk
