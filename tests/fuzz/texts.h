// What fuzzers of texts share.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <optional>
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

struct Texts {
  std::string_view model, evidence;
  std::string query;
};

// The input's three texts; nothing where they would read files of this machine.
inline std::optional<Texts> texts_of(const std::uint8_t* data, std::size_t size) {
  std::string_view rest(reinterpret_cast<const char*>(data), size);
  Texts texts;
  texts.model = take_part(rest);
  texts.evidence = take_part(rest);
  texts.query = take_part(rest);
  if (texts.model.find("#include") != std::string_view::npos) return std::nullopt;
  return texts;
}

// Ends the program where a claim does not hold.
inline void demand(bool condition, const char* claim, const std::string& detail) {
  if (condition) return;
  std::fprintf(stderr, "broken: %s\n--- text:\n%s\n", claim, detail.c_str());
  std::abort();
}

}  // namespace sherlog::fuzz
