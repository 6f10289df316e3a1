// Drives a fuzz function where there is no libFuzzer: replays files, then runs random mutations of them.
//
// Takes libFuzzer's spelling of what it knows: -runs=N (0: only replay), -max_total_time=SECONDS, -seed=N, -max_len=BYTES, and
// folders or files to start from. The input that was running is written to ./crash-input first, so that it is
// still there after a crash. There is no feedback from coverage: it finds the shallow things.
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <random>
#include <string>
#include <vector>

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);

namespace {

struct Settings {
  long runs = -1;
  double seconds = 0;
  unsigned long seed = 1;
  std::size_t max_length = 4096;
  std::vector<std::string> files;
};

bool starts_with(const std::string& text, const std::string& prefix, std::string& rest) {
  if (text.compare(0, prefix.size(), prefix) != 0) return false;
  rest = text.substr(prefix.size());
  return true;
}

Settings read_settings(int argc, char** argv) {
  Settings settings;
  for (int i = 1; i < argc; ++i) {
    const std::string argument = argv[i];
    std::string value;
    if (starts_with(argument, "-runs=", value)) {
      settings.runs = std::stol(value);
    } else if (starts_with(argument, "-max_total_time=", value)) {
      settings.seconds = std::stod(value);
    } else if (starts_with(argument, "-seed=", value)) {
      settings.seed = std::stoul(value);
    } else if (starts_with(argument, "-max_len=", value)) {
      settings.max_length = std::stoul(value);
    } else if (argument.empty() || argument[0] == '-') {
      std::fprintf(stderr, "ignored: %s\n", argument.c_str());
    } else if (std::filesystem::is_directory(argument)) {
      for (const auto& entry : std::filesystem::recursive_directory_iterator(argument)) {
        if (entry.is_regular_file()) settings.files.push_back(entry.path().string());
      }
    } else if (std::filesystem::exists(argument)) {
      settings.files.push_back(argument);
    }
  }
  return settings;
}

void run(const std::string& input) {
  LLVMFuzzerTestOneInput(reinterpret_cast<const std::uint8_t*>(input.data()), input.size());
}

class Mutator {
 public:
  Mutator(const Settings& settings, std::vector<std::string> corpus)
      : random_(settings.seed), max_length_(settings.max_length), corpus_(std::move(corpus)) {
    if (corpus_.empty()) corpus_.emplace_back();
  }

  std::string next() {
    std::string text = corpus_[below(corpus_.size())];
    for (std::size_t steps = 1 + below(8); steps > 0; --steps) mutate(text);
    if (text.size() > max_length_) text.resize(max_length_);
    return text;
  }

 private:
  std::size_t below(std::size_t n) {
    return n == 0 ? 0 : std::uniform_int_distribution<std::size_t>(0, n - 1)(random_);
  }

  void mutate(std::string& text) {
    static const char* const kTokens[] = {
        "(",  ")",  "!",   "^",     "v",    "=>",     "<=>", ":-", "EXIST x (", "+x", "?x",
        "\"", ".",  "...", "{",     "}",    "=",      "!=",  "<",  "#unique{",  "*",  "//",
        "/*", "*/", "\n",  "---\n", "0.7 ", "1e308 ", "∃",   "¬",  "log(",      ",",  "\x1f"};
    const std::size_t at = below(text.size() + 1);
    switch (below(6)) {
      case 0:  // a token of the language
        text.insert(at, kTokens[below(std::size(kTokens))]);
        break;
      case 1:  // cut a piece
        text.erase(at, 1 + below(10));
        break;
      case 2:  // a random byte
        if (at < text.size()) text[at] = static_cast<char>(below(256));
        break;
      case 3:  // a piece again
        text.insert(at, text.substr(below(text.size() + 1), 1 + below(30)));
        break;
      case 4: {  // a piece of another input
        const std::string& other = corpus_[below(corpus_.size())];
        text.insert(at, other.substr(below(other.size() + 1), 1 + below(60)));
        break;
      }
      default:  // one bit
        if (at < text.size()) text[at] = static_cast<char>(text[at] ^ (1 << below(7)));
    }
  }

  std::mt19937_64 random_;
  std::size_t max_length_;
  std::vector<std::string> corpus_;
};

}  // namespace

int main(int argc, char** argv) {
  const Settings settings = read_settings(argc, argv);
  std::vector<std::string> corpus;
  for (const std::string& file : settings.files) {
    std::ifstream stream(file, std::ios::binary);
    corpus.emplace_back(std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>());
    run(corpus.back());
  }
  std::printf("replayed %zu inputs\n", corpus.size());
  if (settings.runs == 0) return 0;

  Mutator mutator(settings, std::move(corpus));
  const auto start = std::chrono::steady_clock::now();
  long done = 0;
  while (settings.runs < 0 || done < settings.runs) {
    if (settings.seconds > 0 &&
        std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count() > settings.seconds) {
      break;
    }
    const std::string input = mutator.next();
    std::ofstream("crash-input", std::ios::binary) << input;
    run(input);
    ++done;
  }
  std::filesystem::remove("crash-input");
  std::printf("ran %ld inputs, no finding\n", done);
  return 0;
}
