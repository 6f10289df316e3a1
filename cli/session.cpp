#include "cli/session.h"

#include <fmt/format.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <new>
#include <nlohmann/json.hpp>
#include <thread>

#include "cli/output.h"

namespace sherlog::cli {
namespace {

// The library counts what it allocates in bulk and stops in time; this is the backstop for everything else: an allocation
// beyond it throws std::bad_alloc.
void limit_memory(std::size_t bytes, std::uint32_t threads) {
#if !defined(__SANITIZE_ADDRESS__)
  constexpr std::size_t kStack = 8u << 20;  // each thread reserves one without using it
  const std::size_t workers = threads != 0 ? threads : std::max(1u, std::thread::hardware_concurrency());
  const std::size_t reserved = workers * kStack;
  rlimit limit = {};
  if (getrlimit(RLIMIT_DATA, &limit) != 0) return;
  limit.rlim_cur = bytes > std::numeric_limits<rlim_t>::max() - reserved
                       ? limit.rlim_max
                       : std::min<rlim_t>(limit.rlim_max, bytes + reserved);
  setrlimit(RLIMIT_DATA, &limit);
#else
  (void)bytes, (void)threads;
#endif
}

// Several values come by repeating the option: a value never swallows the next word.
CLI::Option* add_repeatable(CLI::App& command, const std::string& name, std::vector<std::string>& values,
                            const std::string& type, const std::string& help) {
  return command.add_option(name, values, help)->allow_extra_args(false)->type_name(type);
}

}  // namespace

void add_common_options(CLI::App& command, Options& options) {
  command
      .add_option("--json", options.json,
                  "Write the result as JSON to FILE; '-': to standard output, and nothing else there")
      ->type_name("FILE|-")
      ->check([](const std::string& name) {
        return name.empty() ? std::string("an output file needs a name") : std::string();
      })
      ->group("Common");
  command.add_option("--seed", options.seed, "Seed of all randomness (default 1)")
      ->type_name("N")
      ->group("Common")
      ->check(whole_number(9999999999999999999u));
  command
      .add_option("--threads", options.threads, "Threads; the answer does not depend on them (default 0: all cores)")
      ->type_name("N")
      ->check(CLI::Range(0u, 4096u).description(""))
      ->group("Common");
  command.add_flag("--quiet", options.quiet, "No warnings and no progress bar")->group("Common");
  command.add_option("--max-seconds", options.max_seconds, "Stop after S seconds with the best answer so far")
      ->type_name("S")
      ->group("Common");
  command.add_option("--max-memory", options.max_memory_text, "Stop before more memory is needed, e.g. 500M, 2G, 4GiB")
      ->type_name("SIZE")
      ->group("Common");
}

void add_model_options(CLI::App& command, Options& options) {
  add_repeatable(command, "-m,--model", options.models, "M.mln", "Model; several make one model; '-': standard input")
      ->required();
}

void add_evidence_options(CLI::App& command, Options& options) {
  add_repeatable(command, "-e,--evidence", options.evidence, "E.db",
                 "Evidence; several files make one database; '-': standard input; without: nothing is known");
  command.add_flag("--ignore-unknown-predicates", options.ignore_unknown_predicates,
                   "Skip evidence for predicates that the model does not declare");
}

void add_query_options(CLI::App& command, Options& options) {
  add_repeatable(command, "-q,--query", options.queries, "Q",
                 "Predicates, ground atoms, patterns such as is(?o,N1,?e), or ground formulas; commas outside brackets "
                 "separate");
}

void add_world_options(CLI::App& command, Options& options) {
  // A flag with an optional value: it is taken by '=' only, so the next word is never swallowed.
  const std::string help = "Open these predicates (--open-world=PRED,..); without a value all but those declared *P";
  command.add_flag("--open-world{*}", help)->each([&options](const std::string& value) {
    options.open_world.push_back(value);
  });
  command.add_option("--soft-evidence", options.soft_evidence, "How a degree of evidence is read (default virtual)")
      ->type_name("virtual|jeffrey")
      ->check(one_of({"virtual", "jeffrey"}));
}

void add_inference_options(CLI::App& command, Options& options) {
  std::string names = "auto";
  for (const Method& method : methods()) {
    if (method.name != std::string_view("auto")) names += fmt::format("|{}", method.name);
  }
  std::string help =
      "Method of inference (default auto)\nauto: exact where the components are narrow enough, else mcsat";
  for (const Method& method : methods()) help += fmt::format("\n{}: {}", method.name, method.summary);
  command.add_option("--method", options.method, help)->type_name(names);
  command.add_option("--samples", options.samples, "Kept draws in all chains together (default 20000)")
      ->type_name("N")
      ->check(whole_number(4000000000));
  command.add_option("--chains", options.chains, "Chains (default 4)")->type_name("N")->check(whole_number(1024));
  command.add_option("--burn-in", options.burn_in, "Sweeps of each chain before the first kept draw (default 200)")
      ->type_name("N")
      ->check(whole_number(4000000000));
}

CLI::Validator whole_number(std::uint64_t most) {
  return CLI::Validator(
      [most](const std::string& text) {
        std::uint64_t value = 0;
        const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
        const bool good = error == std::errc() && end == text.data() + text.size() && value <= most;
        return good ? std::string() : fmt::format("expected a whole number from 0 to {}, not '{}'", most, text);
      },
      "");
}

CLI::Validator number_within(double least, double most) {
  return CLI::Validator(
      [least, most](const std::string& text) {
        double value = 0;
        const bool good = CLI::detail::lexical_cast(text, value) && value >= least && value <= most;
        return good ? std::string() : fmt::format("expected a number from {} to {}, not '{}'", least, most, text);
      },
      "");
}

CLI::Validator one_of(std::vector<std::string> words) {
  return CLI::Validator(
      [words = std::move(words)](const std::string& value) {
        if (std::find(words.begin(), words.end(), value) != words.end()) return std::string();
        std::string nearest = did_you_mean(value, words);
        if (!nearest.empty()) nearest = fmt::format("; did you mean '{}'?", nearest);
        return fmt::format("'{}' is none of {}{}", value, fmt::join(words, ", "), nearest);
      },
      "");
}

std::optional<std::size_t> parse_size(std::string_view text) {
  double number = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number, std::chars_format::fixed);
  if (error != std::errc() || !std::isfinite(number) || number < 0) return std::nullopt;
  std::string unit(end, text.data() + text.size());
  std::transform(unit.begin(), unit.end(), unit.begin(),
                 [](unsigned char c) { return static_cast<char>(std::toupper(c)); });
  double factor = 1;
  if (!unit.empty() && unit != "B") {
    static constexpr std::string_view kPrefixes = "KMGT";
    const std::size_t power = kPrefixes.find(unit[0]);
    if (power == std::string_view::npos) return std::nullopt;
    const std::string rest = unit.substr(1);
    if (rest != "" && rest != "B" && rest != "IB") return std::nullopt;
    factor = std::pow(rest == "IB" ? 1024.0 : 1000.0, static_cast<double>(power + 1));
  }
  const double bytes = number * factor;
  if (bytes < 1 || bytes >= 0x1p63) return std::nullopt;
  return static_cast<std::size_t>(bytes);
}

namespace {

// Regular files only: what is sent to /dev/null twice is not lost.
bool same_file(const std::string& a, const std::string& b) {
  if (a == "-" || b == "-") return false;
  std::error_code error;
  const std::filesystem::path first(a), second(b);
  if (std::filesystem::exists(first, error) && !std::filesystem::is_regular_file(first, error)) return false;
  if (std::filesystem::equivalent(first, second, error) && !error) return true;
  // One of them is still to be made.
  return std::filesystem::weakly_canonical(std::filesystem::absolute(first, error), error) ==
         std::filesystem::weakly_canonical(std::filesystem::absolute(second, error), error);
}

std::string taken_place(const std::string& path) {
  return fmt::format("'{}' is read: a result would take its place", path);
}

std::size_t most_of_the_memory() {
  const long pages = sysconf(_SC_PHYS_PAGES), size = sysconf(_SC_PAGESIZE);
  if (pages <= 0 || size <= 0) return std::numeric_limits<std::size_t>::max();
  return static_cast<std::size_t>(pages) / 5 * 4 * static_cast<std::size_t>(size);
}

}  // namespace

Session::Session(Options options)
    : options_(std::move(options)),
      monitor_(!options_.quiet),
      colour_(colour_on_stderr()),
      max_memory_(most_of_the_memory()) {}

double Session::seconds() const {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
}

double Session::seconds_left() const { return std::max(0.0, options_.max_seconds - seconds()); }

bool Session::reads(const std::string& path) {
  inputs_.push_back(path);
  const auto lost = std::ranges::find_if(outputs_, [&](const std::string& output) { return same_file(output, path); });
  if (lost == outputs_.end()) return true;
  return error(taken_place(*lost)), false;
}

bool Session::write(const std::string& path, std::string_view text) {
  const bool is_read = std::ranges::any_of(inputs_, [&](const std::string& input) { return same_file(path, input); });
  const auto problem = is_read ? std::optional(taken_place(path)) : write_to(path, text);
  if (problem) error(*problem);
  return !problem;
}

bool Session::check_options(const std::vector<std::string>& outputs, const std::vector<std::string>& inputs) {
  const auto stdin_count = std::count(options_.models.begin(), options_.models.end(), "-") +
                           std::count(options_.evidence.begin(), options_.evidence.end(), "-") +
                           std::count(inputs.begin(), inputs.end(), "-");
  if (stdin_count > 1) return error("standard input ('-') can be read only once"), false;
  if (std::isnan(options_.max_seconds) || options_.max_seconds < 0) {
    return error(fmt::format("--max-seconds: {} is not a number of seconds of at least 0", options_.max_seconds)),
           false;
  }
  if (!options_.max_memory_text.empty()) {
    const auto bytes = parse_size(options_.max_memory_text);
    if (!bytes) {
      return error(fmt::format("--max-memory: '{}' is not a size such as 500M, 2G or 4GiB", options_.max_memory_text)),
             false;
    }
    max_memory_ = *bytes;
    restrict_memory();
  }
  std::vector<std::string> all = outputs;
  if (wants_json()) all.push_back(options_.json);
  if (std::count(all.begin(), all.end(), "-") > 1) return error("two results cannot both go to standard output"), false;
  for (const std::string& path : all) {
    if (const auto problem = check_writable(path)) return error(*problem), false;
  }
  for (std::size_t i = 0; i < all.size(); ++i) {
    for (std::size_t j = 0; j < i; ++j) {
      if (same_file(all[i], all[j])) return error(fmt::format("two results cannot both go to '{}'", all[i])), false;
    }
  }
  outputs_ = std::move(all);
  for (const auto& files : {options_.models, options_.evidence, inputs}) {
    for (const std::string& file : files) {
      if (!reads(file)) return false;
    }
  }
  if (const std::string problem = validate(inference_options()); !problem.empty()) return error(problem), false;
  return true;
}

std::optional<Model> Session::read_model() {
  auto model = parse_model_files(options_.models, diagnostics_);
  print_diagnostics();
  return model;
}

std::optional<std::vector<Evidence>> Session::read_evidence(const Model& model) {
  EvidenceOptions options;
  options.ignore_unknown_predicates = options_.ignore_unknown_predicates;
  auto databases = options_.evidence.empty() ? parse_evidence(model, "", "no evidence", diagnostics_, options)
                                             : parse_evidence_files(model, options_.evidence, diagnostics_, options);
  print_diagnostics();
  return databases;
}

std::optional<std::vector<Query>> Session::read_queries(const Model& model, const std::vector<Evidence>& databases) {
  auto queries = parse_queries(model, databases, options_.queries, diagnostics_);
  print_diagnostics();
  return queries;
}

std::optional<GroundingOptions> Session::grounding_options(const Model& model) {
  GroundingOptions result;
  result.soft_evidence = options_.soft_evidence == "jeffrey" ? SoftEvidence::kJeffrey : SoftEvidence::kVirtual;
  result.max_memory = max_memory_;
  result.max_seconds = seconds_left();
  std::vector<std::string> names;
  for (const Predicate& predicate : model.predicates()) names.push_back(predicate.name);
  for (const std::string& value : options_.open_world) {
    if (value == "*") {
      result.open_world_all = true;
      continue;
    }
    for (const std::string& name : CLI::detail::split(value, ',')) {
      const auto predicate = model.find_predicate(CLI::detail::trim_copy(name));
      if (!predicate) {
        const std::string nearest = did_you_mean(name, names);
        error(fmt::format("--open-world: unknown predicate '{}'{}", name,
                          nearest.empty() ? "" : fmt::format("; did you mean '{}'?", nearest)));
        return std::nullopt;
      }
      result.open_world.push_back(*predicate);
    }
  }
  return result;
}

InferenceOptions Session::inference_options() const {
  InferenceOptions result;
  result.method = options_.method;
  result.seed = options_.seed;
  result.threads = options_.threads;
  result.max_seconds = seconds_left();
  result.max_memory = max_memory_;
  result.samples = options_.samples;
  result.chains = options_.chains;
  result.burn_in = options_.burn_in;
  return result;
}

void Session::restrict_memory() {
  if (!options_.max_memory_text.empty()) limit_memory(max_memory_, options_.threads);
}

void Session::release_memory() {
  if (!options_.max_memory_text.empty()) limit_memory(std::numeric_limits<std::size_t>::max(), options_.threads);
}

int Session::run(const char* schema, const std::function<int()>& body, bool wants_method) {
  try {
    return body();
  } catch (const std::bad_alloc&) {
    release_memory();
  }
  error(kMemoryMessage);
  return finish(kLimitReached, "", [&] {
    nlohmann::ordered_json json;
    json["schema"] = schema;
    if (wants_method) json["method"] = options_.method;
    json["termination"] = to_string(Termination::kMemoryLimit);
    json["message"] = kMemoryMessage;
    return json.dump(2) + "\n";
  });
}

void Session::print_diagnostics() {
  for (; printed_ < diagnostics_.all().size(); ++printed_) {
    const Diagnostic& diagnostic = diagnostics_.all()[printed_];
    if (options_.quiet && diagnostic.severity == Severity::kWarning) continue;
    const std::string text = diagnostics_.render(diagnostic, colour_);
    print_message(text);
  }
  const std::size_t errors =
      static_cast<std::size_t>(std::count_if(diagnostics_.all().begin(), diagnostics_.all().end(),
                                             [](const Diagnostic& d) { return d.severity == Severity::kError; }));
  if (diagnostics_.error_count() > errors && !counted_rest_) {
    print_message(fmt::format("{} more errors are not shown", diagnostics_.error_count() - errors));
    counted_rest_ = true;
  }
}

void Session::print_message(std::string_view text) {
  monitor_.clear();
  std::fwrite(text.data(), 1, text.size(), stderr);
  if (!text.empty() && text.back() != '\n') std::fputc('\n', stderr);
  std::fflush(stderr);
}

void Session::error(std::string_view text) {
  print_message(colour_ ? fmt::format("sherlog: \x1b[1;31merror:\x1b[0m {}", text)
                        : fmt::format("sherlog: error: {}", text));
}

void Session::warning(std::string_view text) {
  if (options_.quiet) return;
  print_message(colour_ ? fmt::format("sherlog: \x1b[1;35mwarning:\x1b[0m {}", text)
                        : fmt::format("sherlog: warning: {}", text));
}

int Session::finish(int code, const std::string& text, const std::function<std::string()>& json) {
  release_memory();
  monitor_.clear();
  if (wants_json() && !write(options_.json, json())) return kInternalError;
  if (wants_text() && !write("-", text)) return kInternalError;
  return code;
}

}  // namespace sherlog::cli
