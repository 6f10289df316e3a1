// A hash index over things that are stored elsewhere: open addressing with linear probing, 8 bytes a slot.
//
// Idea      Evidence has millions of atoms and constants that live in flat arrays. A node-based map would cost an allocation
//           for each; here only (hash, position) is kept and the caller compares. Nothing is ever removed.
// Cost      at most 2/3 full; find and insert in constant expected time
#pragma once

#include <cstdint>
#include <limits>
#include <vector>

namespace sherlog {

class FlatIndex {
 public:
  static constexpr std::uint32_t kNone = std::numeric_limits<std::uint32_t>::max();

  // The position for which `equal(position)` holds among those with this hash, or kNone.
  template <class Equal>
  std::uint32_t find(std::uint64_t hash, const Equal& equal) const {
    if (slots_.empty()) return kNone;
    const std::size_t mask = slots_.size() - 1;
    const std::uint32_t part = folded(hash);
    for (std::size_t i = part & mask;; i = (i + 1) & mask) {
      const Slot& slot = slots_[i];
      if (slot.position == kNone) return kNone;
      if (slot.hash == part && equal(slot.position)) return slot.position;
    }
  }

  // Adds a position that `find` did not find.
  void insert(std::uint64_t hash, std::uint32_t position) {
    if ((count_ + 1) * 3 > slots_.size() * 2) grow();
    place({folded(hash), position});
    ++count_;
  }

 private:
  struct Slot {
    std::uint32_t hash = 0;
    std::uint32_t position = kNone;
  };

  static std::uint32_t folded(std::uint64_t hash) { return static_cast<std::uint32_t>(hash ^ (hash >> 32)); }

  void place(const Slot& slot) {
    const std::size_t mask = slots_.size() - 1;
    std::size_t i = slot.hash & mask;
    while (slots_[i].position != kNone) i = (i + 1) & mask;
    slots_[i] = slot;
  }

  void grow() {
    std::vector<Slot> old(slots_.empty() ? 16 : slots_.size() * 2);
    old.swap(slots_);
    for (const Slot& slot : old) {
      if (slot.position != kNone) place(slot);
    }
  }

  std::vector<Slot> slots_;
  std::size_t count_ = 0;
};

}  // namespace sherlog
