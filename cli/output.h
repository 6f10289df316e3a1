// Where results go: standard output, or a file that is there whole or not at all.
#pragma once

#include <optional>
#include <string>
#include <string_view>

namespace sherlog::cli {

// An empty optional where all went well, else a sentence. A reader that went away (a closed pipe) is no error: whoever closed
// it has what they wanted.
[[nodiscard]] std::optional<std::string> write_standard_output(std::string_view text);

// Writes a temporary file beside `path` and renames it. What is not a regular file (a pipe, a device) is written directly.
[[nodiscard]] std::optional<std::string> write_file(const std::string& path, std::string_view text);

// Whether write_file has a chance: asked before long work starts.
[[nodiscard]] std::optional<std::string> check_writable(const std::string& path);

// `path` "-": standard output.
[[nodiscard]] std::optional<std::string> write_to(const std::string& path, std::string_view text);

}  // namespace sherlog::cli
