// A hash table whose keys are tuples of constants, numbered from 0 in order of insertion.
//
// Idea      The tuples lie one after the other in one array; open addressing holds their numbers. Nothing is ever
//           removed.
// Cost      find and insert: expected constant; memory 4 bytes for each constant and 8-16 for each tuple.
#pragma once

#include <algorithm>
#include <cstdint>
#include <span>
#include <vector>

#include "mln/ids.h"

namespace sherlog {

class TupleTable {
 public:
  static constexpr std::uint32_t kNone = 0xffffffffu;

  explicit TupleTable(std::size_t arity = 0) : arity_(arity) {}

  std::size_t size() const { return count_; }
  std::span<const ConstantIndex> tuple(std::uint32_t entry) const { return {flat_.data() + entry * arity_, arity_}; }

  std::uint32_t find(std::span<const ConstantIndex> key) const {
    if (slots_.empty()) return kNone;
    const std::size_t mask = slots_.size() - 1;
    for (std::size_t slot = hash(key) & mask; slots_[slot] != 0; slot = (slot + 1) & mask) {
      if (equals(slots_[slot] - 1, key)) return slots_[slot] - 1;
    }
    return kNone;
  }

  // The number of the tuple; a new one gets size() as it was.
  std::uint32_t insert(std::span<const ConstantIndex> key) {
    if ((std::size_t{count_} + 1) * 2 > slots_.size()) grow();
    const std::size_t mask = slots_.size() - 1;
    std::size_t slot = hash(key) & mask;
    for (; slots_[slot] != 0; slot = (slot + 1) & mask) {
      if (equals(slots_[slot] - 1, key)) return slots_[slot] - 1;
    }
    flat_.insert(flat_.end(), key.begin(), key.end());
    slots_[slot] = ++count_;
    return count_ - 1;
  }

  std::size_t memory_bytes() const { return (flat_.capacity() + slots_.capacity()) * sizeof(std::uint32_t); }

 private:
  // FNV's multiply-and-add by words, then the finaliser of MurmurHash3.
  static std::size_t hash(std::span<const ConstantIndex> key) {
    std::uint64_t h = 0xcbf29ce484222325ULL;
    for (ConstantIndex c : key) h = (h ^ c) * 0x9e3779b97f4a7c15ULL;
    h ^= h >> 33;
    h *= 0xff51afd7ed558ccdULL;
    return static_cast<std::size_t>(h ^ (h >> 33));
  }

  bool equals(std::uint32_t entry, std::span<const ConstantIndex> key) const {
    return std::equal(key.begin(), key.end(), flat_.begin() + static_cast<std::ptrdiff_t>(entry * arity_));
  }

  void grow() {
    std::vector<std::uint32_t> bigger(std::max<std::size_t>(16, slots_.size() * 2), 0);
    const std::size_t mask = bigger.size() - 1;
    for (std::uint32_t entry = 0; entry < count_; ++entry) {
      std::size_t slot = hash(tuple(entry)) & mask;
      while (bigger[slot] != 0) slot = (slot + 1) & mask;
      bigger[slot] = entry + 1;
    }
    slots_ = std::move(bigger);
  }

  std::size_t arity_;
  std::uint32_t count_ = 0;
  std::vector<ConstantIndex> flat_;
  std::vector<std::uint32_t> slots_;  // entry + 1, or 0; a power of two, at most half full
};

}  // namespace sherlog
