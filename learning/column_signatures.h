// Columns of a sparse matrix that are equal, found by random sums of their entries.
//
// Idea      Each row has a random 64-bit factor; a column's signature is the sum of factor * entry modulo 2^64, which is
//           exact for whole counts. Equal columns have equal signatures; different ones do with probability 2^-64 or so.
#pragma once

#include <algorithm>
#include <cstdint>
#include <span>
#include <vector>

namespace sherlog {

inline std::uint64_t row_factor(std::uint64_t row) {  // SplitMix64
  std::uint64_t z = (row + 1) * 0x9e3779b97f4a7c15ULL;
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ULL;
  z = (z ^ (z >> 27)) * 0x94d049bb133111ebULL;
  return z ^ (z >> 31);
}

inline std::uint64_t signature_term(std::uint64_t factor, double count) {
  return factor * static_cast<std::uint64_t>(static_cast<std::int64_t>(count));
}

// Groups of two and more columns of one signature; those of signature 0 (nothing ever changes) are left out.
inline std::vector<std::vector<std::uint32_t>> equal_signatures(std::span<const std::uint64_t> signatures) {
  std::vector<std::uint32_t> order;
  for (std::uint32_t c = 0; c < signatures.size(); ++c) {
    if (signatures[c] != 0) order.push_back(c);
  }
  std::ranges::stable_sort(order, {}, [&](std::uint32_t c) { return signatures[c]; });
  std::vector<std::vector<std::uint32_t>> groups;
  for (std::size_t i = 0; i < order.size();) {
    std::size_t end = i;
    while (end < order.size() && signatures[order[end]] == signatures[order[i]]) ++end;
    if (end - i > 1)
      groups.emplace_back(order.begin() + static_cast<std::ptrdiff_t>(i),
                          order.begin() + static_cast<std::ptrdiff_t>(end));
    i = end;
  }
  std::ranges::sort(groups);
  return groups;
}

}  // namespace sherlog
