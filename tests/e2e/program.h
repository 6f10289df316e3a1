// Runs the built program in a folder of its own, as a shell would.
#pragma once

#include <sys/wait.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <string_view>

namespace sherlog::e2e {

struct Outcome {
  int code = -1;
  std::string out, err;
};

inline std::string read_all(const std::filesystem::path& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
}

// A scratch folder that goes away with the object.
class Scratch {
 public:
  Scratch() {
    std::string name = (std::filesystem::temp_directory_path() / "sherlog-e2e-XXXXXX").string();
    if (mkdtemp(name.data()) == nullptr) std::abort();
    folder_ = name;
  }
  ~Scratch() {
    std::error_code ignored;
    std::filesystem::remove_all(folder_, ignored);
  }
  Scratch(const Scratch&) = delete;
  Scratch& operator=(const Scratch&) = delete;

  const std::filesystem::path& folder() const { return folder_; }
  void write(const std::string& name, std::string_view text) const {
    std::ofstream(folder_ / name, std::ios::binary) << text;
  }
  std::string read(const std::string& name) const { return read_all(folder_ / name); }
  bool exists(const std::string& name) const { return std::filesystem::exists(folder_ / name); }
  std::size_t file_count() const {
    return static_cast<std::size_t>(std::distance(std::filesystem::directory_iterator(folder_), {}));
  }

  // `$S` in the command is the program. Standard output and error are caught unless the command redirects them.
  Outcome shell(const std::string& command) const {
    const std::filesystem::path out = folder_.string() + ".out", err = folder_.string() + ".err";
    const std::string line = "cd '" + folder_.string() + "' && S='" SHERLOG_BINARY "' && exec </dev/null >'" +
                             out.string() + "' 2>'" + err.string() + "'; " + command;
    const int status = std::system(("sh -c '" + escaped(line) + "'").c_str());
    Outcome outcome{WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status), read_all(out), read_all(err)};
    std::filesystem::remove(out);
    std::filesystem::remove(err);
    return outcome;
  }
  Outcome sherlog(const std::string& arguments) const { return shell("\"$S\" " + arguments); }

 private:
  static std::string escaped(const std::string& text) {
    std::string result;
    for (char c : text) result += c == '\'' ? std::string("'\\''") : std::string(1, c);
    return result;
  }
  std::filesystem::path folder_;
};

}  // namespace sherlog::e2e
