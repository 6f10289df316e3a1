#include "rgbd/nearest/van_emde_boas.h"

#include <bit>
#include <utility>

namespace sherlog::rgbd {

std::size_t VanEmdeBoasSet::words_of(std::uint32_t bits) {
  if (bits <= kWordBits) return 1;
  const std::uint32_t low = bits / 2, high = bits - low;
  return 1 + words_of(high) + (std::size_t{1} << high) * words_of(low);
}

VanEmdeBoasSet::VanEmdeBoasSet(std::uint32_t bits) : bits_(bits), splits_(bits + 1) {
  for (std::uint32_t b = kWordBits + 1; b <= bits; ++b) {
    const std::uint32_t low = b / 2, high = b - low;
    splits_[b] = {high, low, words_of(high), words_of(low)};
  }
  words_.resize(words_of(bits));
  // A part is empty where its least member is kNone; in a word of bits, 0 says so already.
  std::vector<std::pair<std::size_t, std::uint32_t>> parts{{0, bits}};
  while (!parts.empty()) {
    const auto [part, b] = parts.back();
    parts.pop_back();
    if (b <= kWordBits) continue;
    set_range(part, kNone, kNone);
    const Split& s = split(b);
    if (s.high > kWordBits) parts.emplace_back(part + 1, s.high);
    if (s.low <= kWordBits) continue;
    for (std::uint32_t h = 0; h < std::uint32_t{1} << s.high; ++h) parts.emplace_back(cluster(part, s, h), s.low);
  }
}

std::uint32_t VanEmdeBoasSet::min(std::size_t part, std::uint32_t bits) const {
  const std::uint64_t word = words_[part];
  if (bits > kWordBits) return static_cast<std::uint32_t>(word);
  return word == 0 ? kNone : static_cast<std::uint32_t>(std::countr_zero(word));
}

std::uint32_t VanEmdeBoasSet::max(std::size_t part, std::uint32_t bits) const {
  const std::uint64_t word = words_[part];
  if (bits > kWordBits) return static_cast<std::uint32_t>(word >> 32);
  return word == 0 ? kNone : 63u - static_cast<std::uint32_t>(std::countl_zero(word));
}

void VanEmdeBoasSet::insert(std::size_t part, std::uint32_t bits, std::uint32_t x) {
  if (bits <= kWordBits) {
    words_[part] |= std::uint64_t{1} << x;
    return;
  }
  std::uint32_t least = min(part, bits), greatest = max(part, bits);
  if (least == kNone) return set_range(part, x, x);
  if (x == least) return;
  if (x < least) std::swap(x, least);
  if (x > greatest) greatest = x;
  set_range(part, least, greatest);
  const Split& s = split(bits);
  const std::uint32_t high = x >> s.low, low = x & ((1u << s.low) - 1);
  const std::size_t into = cluster(part, s, high);
  // A set that was empty takes its first member in one step: only one of the two goes deep.
  if (is_empty(into, s.low)) insert(part + 1, s.high, high);
  insert(into, s.low, low);
}

void VanEmdeBoasSet::erase(std::size_t part, std::uint32_t bits, std::uint32_t x) {
  if (bits <= kWordBits) {
    words_[part] &= ~(std::uint64_t{1} << x);
    return;
  }
  std::uint32_t least = min(part, bits), greatest = max(part, bits);
  if (least == kNone || x < least || x > greatest) return;
  if (least == greatest) return set_range(part, kNone, kNone);
  const Split& s = split(bits);
  if (x == least) {  // the next one becomes the least and leaves its part
    const std::uint32_t first = min(part + 1, s.high);
    x = least = first << s.low | min(cluster(part, s, first), s.low);
  }
  const std::uint32_t high = x >> s.low, low = x & ((1u << s.low) - 1);
  const std::size_t from = cluster(part, s, high);
  erase(from, s.low, low);
  if (is_empty(from, s.low)) erase(part + 1, s.high, high);
  if (x == greatest) {
    const std::uint32_t last = max(part + 1, s.high);
    greatest = last == kNone ? least : last << s.low | max(cluster(part, s, last), s.low);
  }
  set_range(part, least, greatest);
}

bool VanEmdeBoasSet::contains(std::uint32_t x) const {
  std::size_t part = 0;
  std::uint32_t bits = bits_;
  while (bits > kWordBits) {
    if (x == min(part, bits)) return true;
    const Split& s = split(bits);
    part = cluster(part, s, x >> s.low);
    x &= (1u << s.low) - 1;
    bits = s.low;
  }
  return (words_[part] >> x & 1u) != 0;
}

std::uint32_t VanEmdeBoasSet::above(std::size_t part, std::uint32_t bits, std::uint32_t x) const {
  if (bits <= kWordBits) {
    const std::uint64_t rest = x >= 63 ? 0 : words_[part] & (~std::uint64_t{0} << (x + 1));
    return rest == 0 ? kNone : static_cast<std::uint32_t>(std::countr_zero(rest));
  }
  const std::uint32_t least = min(part, bits);
  if (least == kNone) return kNone;
  if (x < least) return least;
  const Split& s = split(bits);
  const std::uint32_t high = x >> s.low, low = x & ((1u << s.low) - 1);
  const std::size_t here = cluster(part, s, high);
  const std::uint32_t greatest_here = max(here, s.low);
  if (greatest_here != kNone && low < greatest_here) return high << s.low | above(here, s.low, low);
  const std::uint32_t next = above(part + 1, s.high, high);
  return next == kNone ? kNone : next << s.low | min(cluster(part, s, next), s.low);
}

std::uint32_t VanEmdeBoasSet::below(std::size_t part, std::uint32_t bits, std::uint32_t x) const {
  if (bits <= kWordBits) {
    const std::uint64_t rest = words_[part] & ((std::uint64_t{1} << x) - 1);
    return rest == 0 ? kNone : 63u - static_cast<std::uint32_t>(std::countl_zero(rest));
  }
  const std::uint32_t least = min(part, bits);
  if (least == kNone || x <= least) return kNone;
  const std::uint32_t greatest = max(part, bits);
  if (x > greatest) return greatest;
  const Split& s = split(bits);
  const std::uint32_t high = x >> s.low, low = x & ((1u << s.low) - 1);
  const std::size_t here = cluster(part, s, high);
  const std::uint32_t least_here = min(here, s.low);
  if (least_here != kNone && low > least_here) return high << s.low | below(here, s.low, low);
  const std::uint32_t previous = below(part + 1, s.high, high);
  return previous == kNone ? least : previous << s.low | max(cluster(part, s, previous), s.low);
}

std::optional<std::uint32_t> VanEmdeBoasSet::successor(std::uint32_t x) const {
  if (contains(x)) return x;
  const std::uint32_t found = above(0, bits_, x);
  return found == kNone ? std::nullopt : std::optional(found);
}

std::optional<std::uint32_t> VanEmdeBoasSet::predecessor(std::uint32_t x) const {
  if (contains(x)) return x;
  const std::uint32_t found = below(0, bits_, x);
  return found == kNone ? std::nullopt : std::optional(found);
}

}  // namespace sherlog::rgbd
