// Reading a whole text file, with the reason where that fails. See read_text_file in parser.h for the usual way.
#pragma once

#include <optional>
#include <string>

namespace sherlog {

struct TextFile {
  std::optional<std::string> text;
  std::string problem;  // where there is no text: why
};

// "-" reads standard input.
TextFile load_text_file(const std::string& path);

}  // namespace sherlog
