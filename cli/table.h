// Columns of text, aligned. Widths count code points, so that UTF-8 names line up.
#pragma once

#include <string>
#include <utility>
#include <vector>

namespace sherlog::cli {

enum class Align { kLeft, kRight };

class Table {
 public:
  explicit Table(std::vector<std::pair<std::string, Align>> columns) : columns_(std::move(columns)) {}
  void add_column(std::string name, Align align) { columns_.emplace_back(std::move(name), align); }
  // Cells that are missing at the end are empty.
  void add_row(std::vector<std::string> cells) { rows_.push_back(std::move(cells)); }
  // An empty line between groups of rows.
  void add_gap() { rows_.emplace_back(); }
  std::size_t row_count() const { return rows_.size(); }
  // The header, then the rows, each line indented by two; no blanks at the end of a line.
  std::string text() const;

 private:
  std::vector<std::pair<std::string, Align>> columns_;
  std::vector<std::vector<std::string>> rows_;
};

}  // namespace sherlog::cli
