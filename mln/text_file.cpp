// Whole files into memory: UTF-8 text of at most 1 GiB; anything else is refused with its reason.
#include "mln/text_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <system_error>

#include "mln/lexer.h"
#include "mln/parser.h"

namespace sherlog {

namespace {

constexpr std::size_t kMaxBytes = std::size_t{1} << 30;  // places count in 32 bits

TextFile refused(std::string problem) { return {std::nullopt, std::move(problem)}; }

TextFile checked(std::string text) {
  const std::size_t zero = text.find('\0');
  if (zero != std::string::npos) return refused(fmt::format("is not a text file: byte {} is zero", zero + 1));
  const std::size_t broken = find_invalid_utf8(text);
  if (broken == std::string::npos) return {std::move(text), ""};
  const auto line = 1 + std::count(text.begin(), text.begin() + static_cast<std::ptrdiff_t>(broken), '\n');
  return refused(fmt::format("is not UTF-8: byte 0x{:02X} in line {}", static_cast<unsigned char>(text[broken]), line));
}

}  // namespace

TextFile load_text_file(const std::string& path) {
  const bool standard_input = path == "-";
  std::error_code ignored;
  if (!standard_input && std::filesystem::is_directory(path, ignored)) return refused("is a directory");
  const auto close = [](std::FILE* file) {
    if (file != nullptr) std::fclose(file);
  };
  std::unique_ptr<std::FILE, decltype(close)> opened(nullptr, close);
  std::FILE* file = stdin;
  if (!standard_input) {
    opened.reset(std::fopen(path.c_str(), "rb"));
    file = opened.get();
  }
  if (file == nullptr) return refused("cannot be read: " + std::generic_category().message(errno));
  std::string text;
  std::array<char, 1 << 16> buffer{};
  while (const std::size_t count = std::fread(buffer.data(), 1, buffer.size(), file)) {
    if (text.size() + count > kMaxBytes) return refused("is too large: more than 1 GiB");
    text.append(buffer.data(), count);
  }
  if (std::ferror(file) != 0) return refused("cannot be read: " + std::generic_category().message(errno));
  return checked(std::move(text));
}

std::optional<std::string> read_text_file(const std::string& path, Diagnostics& diagnostics) {
  TextFile file = load_text_file(path);
  if (!file.text) {
    const std::uint32_t source = diagnostics.sources().add(path == "-" ? "standard input" : path, "");
    diagnostics.error("file", {source, 0, 0, 0}, fmt::format("'{}' {}", path, file.problem));
  }
  return std::move(file.text);
}

}  // namespace sherlog
