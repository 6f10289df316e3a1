// What all commands share: their common options, reading the inputs, messages, limits and where the results go.
#pragma once

#include <CLI/CLI.hpp>
#include <chrono>
#include <cstdint>
#include <functional>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "cli/exit_code.h"
#include "cli/terminal.h"
#include "grounding/ground.h"
#include "inference/inference.h"
#include "mln/diagnostics.h"
#include "mln/evidence.h"
#include "mln/model.h"
#include "mln/query.h"

namespace sherlog::cli {

// Filled by the command line. A command adds only the groups of options that it heeds.
struct Options {
  std::vector<std::string> models, evidence, queries;
  std::string json;
  bool quiet = false;
  std::uint64_t seed = 1;
  std::uint32_t threads = 0;
  double max_seconds = std::numeric_limits<double>::infinity();
  std::string max_memory_text;
  bool ignore_unknown_predicates = false;
  std::vector<std::string> open_world;  // "*": all
  std::string soft_evidence = "virtual";
  std::string method = "auto";
  std::uint32_t samples = InferenceOptions{}.samples;
  std::uint32_t chains = InferenceOptions{}.chains;
  std::uint32_t burn_in = InferenceOptions{}.burn_in;
};

void add_common_options(CLI::App& command, Options& options);     // --json --seed --threads --quiet --max-...
void add_model_options(CLI::App& command, Options& options);      // -m
void add_evidence_options(CLI::App& command, Options& options);   // -e --ignore-unknown-predicates
void add_query_options(CLI::App& command, Options& options);      // -q
void add_world_options(CLI::App& command, Options& options);      // --open-world --soft-evidence
void add_inference_options(CLI::App& command, Options& options);  // --method --samples --chains --burn-in

// Accepts these words only. Help shows them as the option's type, so the check has no text of its own there.
CLI::Validator one_of(std::vector<std::string> words);

CLI::Validator whole_number(std::uint64_t most);
CLI::Validator number_within(double least, double most);  // not nan

// "500M", "2G", "4GiB", "1000000" in bytes: K, M, G, T (also KB, ...) are powers of 1000, KiB, ... of 1024.
std::optional<std::size_t> parse_size(std::string_view text);

inline constexpr const char* kMemoryMessage = "the memory limit was reached";

// One run of one command.
class Session {
 public:
  explicit Session(Options options);

  const Options& options() const { return options_; }
  TerminalMonitor& monitor() { return monitor_; }
  Diagnostics& diagnostics() { return diagnostics_; }
  std::size_t max_memory() const { return max_memory_; }
  double seconds() const;
  double seconds_left() const;

  // False where an option makes no sense; says so. `outputs`: files that will be written; `inputs`: files that are read beside
  // the models and the evidence, as for reads().
  bool check_options(const std::vector<std::string>& outputs = {}, const std::vector<std::string>& inputs = {});
  // Called for every file before it is read, or made where it is a store. False where a result would take its place; says so.
  bool reads(const std::string& path);
  // Warnings of this code are of no use to the command.
  void silence(std::string code) { diagnostics_.silence(std::move(code)); }
  // The inputs, or nothing after printing what is wrong.
  std::optional<Model> read_model();
  std::optional<std::vector<Evidence>> read_evidence(const Model& model);
  std::optional<std::vector<Query>> read_queries(const Model& model, const std::vector<Evidence>& databases);
  std::optional<GroundingOptions> grounding_options(const Model& model);
  InferenceOptions inference_options() const;

  // --max-memory as a backstop holds while inputs are read and answers are sought; what is found by then is reported without it.
  void restrict_memory();
  void release_memory();
  // The command; where memory runs out, a document of that schema that says so
  // (`wants_method`: with the method that was asked for).
  int run(const char* schema, const std::function<int()>& body, bool wants_method = false);

  // Prints the messages that were not printed so far; warnings only without --quiet.
  void print_diagnostics();
  void error(std::string_view text);
  void warning(std::string_view text);  // not with --quiet
  // Rendered diagnostics of another kind, such as conflicts.
  void print_message(std::string_view text);

  // Text results go to standard output unless --json - takes it; the document goes where --json says. Returns `code`, or
  // kInternalError where nothing could be written.
  bool wants_json() const { return !options_.json.empty(); }
  bool wants_text() const { return options_.json != "-"; }
  int finish(int code, const std::string& text, const std::function<std::string()>& json);
  // Another result, to a file or with '-' to standard output. Never over a file that is read. False after saying why.
  bool write(const std::string& path, std::string_view text);

 private:
  Options options_;
  Diagnostics diagnostics_;
  TerminalMonitor monitor_;
  bool colour_;
  std::size_t max_memory_;  // --max-memory, else most of what the machine has: better a sentence than to be killed
  std::vector<std::string> outputs_, inputs_;
  std::size_t printed_ = 0;  // diagnostics
  bool counted_rest_ = false;
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

}  // namespace sherlog::cli
