// What fuzzers of texts share.
#pragma once

#include <cstdio>
#include <cstdlib>
#include <string>
#include <string_view>

namespace sherlog::fuzz {

// The text up to the next 0x1f byte, which is taken off `rest` with it.
inline std::string_view take_part(std::string_view& rest) {
  const std::size_t end = rest.find('\x1f');
  const std::string_view part = rest.substr(0, end);
  rest = end == std::string_view::npos ? std::string_view() : rest.substr(end + 1);
  return part;
}

// Ends the program where a claim does not hold.
inline void demand(bool condition, const char* claim, const std::string& detail) {
  if (condition) return;
  std::fprintf(stderr, "broken: %s\n--- text:\n%s\n", claim, detail.c_str());
  std::abort();
}

}  // namespace sherlog::fuzz
