#include "cli/table.h"

#include <algorithm>
#include <string_view>

namespace sherlog::cli {
namespace {

// Continuation bytes of UTF-8 take no column.
std::size_t width_of(std::string_view text) {
  return static_cast<std::size_t>(
      std::count_if(text.begin(), text.end(), [](char c) { return (static_cast<unsigned char>(c) & 0xc0u) != 0x80u; }));
}

}  // namespace

std::string Table::text() const {
  constexpr std::size_t kWidest = 100;  // one long formula does not push all numbers off the screen
  std::vector<std::size_t> widths;
  for (const auto& [name, align] : columns_) widths.push_back(width_of(name));
  for (const auto& row : rows_) {
    for (std::size_t c = 0; c < row.size(); ++c) widths[c] = std::max(widths[c], std::min(kWidest, width_of(row[c])));
  }
  std::string out;
  const auto add_line = [&](const auto& cell_at, std::size_t cells) {
    std::string line;
    for (std::size_t c = 0; c < cells; ++c) {
      const std::string& cell = cell_at(c);
      const std::size_t width = width_of(cell);
      const std::string padding(width < widths[c] ? widths[c] - width : 0, ' ');
      line += "  ";
      line += columns_[c].second == Align::kLeft ? cell + padding : padding + cell;
    }
    line.erase(line.find_last_not_of(' ') + 1);
    out += line + '\n';
  };
  add_line([&](std::size_t c) -> const std::string& { return columns_[c].first; }, columns_.size());
  for (const auto& row : rows_) {
    add_line([&](std::size_t c) -> const std::string& { return row[c]; }, row.size());
  }
  return out;
}

}  // namespace sherlog::cli
