// An ordered set of the numbers below 2^bits with its neighbours found in O(log log 2^bits).
//
// Idea      A set over 2^b numbers is 2^(b/2) sets over the low halves and one set of the high halves that occur. The least
//           member is kept apart and stands in none of them, so that each operation goes on in one of the parts only.
//           Sets over 64 numbers are the bits of a word. All parts lie in one array.
// Source    van Emde Boas: Preserving order in a forest in less than logarithmic time, FOCS 1975.
// Cost      insert, erase, contains, successor, predecessor O(log bits); memory about 2^bits / 6 bytes
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

namespace sherlog::rgbd {

class VanEmdeBoasSet {
 public:
  // Requires 1 <= bits <= 28.
  explicit VanEmdeBoasSet(std::uint32_t bits);

  // All require x < 2^bits.
  void insert(std::uint32_t x) { insert(0, bits_, x); }
  void erase(std::uint32_t x) { erase(0, bits_, x); }
  bool contains(std::uint32_t x) const;
  // The least member that is at least x; the greatest that is at most x.
  std::optional<std::uint32_t> successor(std::uint32_t x) const;
  std::optional<std::uint32_t> predecessor(std::uint32_t x) const;
  bool empty() const { return is_empty(0, bits_); }

 private:
  // A part is told by its first word and its bits. Its words: {min, max}, the set of high halves, the sets of low halves.
  struct Split {
    std::uint32_t high, low;
    std::size_t summary_words, cluster_words;
  };
  static constexpr std::uint32_t kWordBits = 6;
  static constexpr std::uint32_t kNone = 0xffffffffu;

  static std::size_t words_of(std::uint32_t bits);
  const Split& split(std::uint32_t bits) const { return splits_[bits]; }
  std::size_t cluster(std::size_t part, const Split& s, std::uint32_t high) const {
    return part + 1 + s.summary_words + high * s.cluster_words;
  }
  std::uint32_t min(std::size_t part, std::uint32_t bits) const;  // kNone: empty
  std::uint32_t max(std::size_t part, std::uint32_t bits) const;
  bool is_empty(std::size_t part, std::uint32_t bits) const { return min(part, bits) == kNone; }
  void set_range(std::size_t part, std::uint32_t least, std::uint32_t greatest) {
    words_[part] = std::uint64_t{greatest} << 32 | least;
  }

  void insert(std::size_t part, std::uint32_t bits, std::uint32_t x);
  void erase(std::size_t part, std::uint32_t bits, std::uint32_t x);
  std::uint32_t above(std::size_t part, std::uint32_t bits, std::uint32_t x) const;  // least member > x, or kNone
  std::uint32_t below(std::size_t part, std::uint32_t bits, std::uint32_t x) const;  // greatest member < x, or kNone

  std::uint32_t bits_;
  std::vector<Split> splits_;  // by bits
  std::vector<std::uint64_t> words_;
};

}  // namespace sherlog::rgbd
