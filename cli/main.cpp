// The program: one command a run. Each command is a file of its own; this one knows their list and the exit codes.
#include <fmt/format.h>
#include <glog/logging.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <exception>
#include <memory>
#include <new>
#include <sstream>
#include <string>
#include <system_error>
#include <vector>

#include "cli/commands.h"
#include "cli/exit_code.h"
#include "cli/output.h"
#include "cli/terminal.h"
#include "mln/diagnostics.h"

namespace {

using sherlog::cli::Action;

// CLI11 shows a flag's default value as {*}; people know an optional value as [=VALUE].
class HelpFormatter : public CLI::Formatter {
 public:
  std::string make_option_name(const CLI::Option* option, bool is_positional) const override {
    std::string name = CLI::Formatter::make_option_name(option, is_positional);
    const std::size_t at = name.find("{*}");
    return at == std::string::npos ? name : name.replace(at, 3, "[=PRED,..]");
  }
};

// 0 or the exit code of wrong usage; help and version are results and go to standard output.
int answer_parse_error(CLI::App& app, const CLI::ParseError& error) {
  std::ostringstream out, problem;
  if (app.exit(error, out, problem) == 0) {
    const auto failed = sherlog::cli::write_standard_output(out.str());
    if (!failed) return sherlog::cli::kDone;
    fmt::print(stderr, "sherlog: error: {}\n", *failed);
    return sherlog::cli::kInternalError;
  }
  fmt::print(stderr, "sherlog: error: {}\n", error.what());
  const auto chosen = app.get_subcommands();
  const std::string command = chosen.empty() ? "" : chosen.front()->get_name() + " ";
  fmt::print(stderr, "see 'sherlog {}--help'\n", command);
  return sherlog::cli::kBadInput;
}

// The first word names a command; CLI11 would say that it was not expected, and not what was.
bool is_known_command(const CLI::App& app, int argc, char** argv) {
  if (argc < 2) return true;
  const std::string word = argv[1];
  if (word == "--help" || word == "--version") return true;
  if (word.starts_with('-')) {
    fmt::print(stderr, "sherlog: error: options stand behind the command: sherlog COMMAND {} ...\n",
               word.substr(0, 80));
    fmt::print(stderr, "see 'sherlog --help'\n");
    return false;
  }
  std::vector<std::string> names;
  for (const CLI::App* command : app.get_subcommands([](const CLI::App*) { return true; })) {
    names.push_back(command->get_name());
  }
  if (std::find(names.begin(), names.end(), word) != names.end()) return true;
  const std::string nearest = sherlog::did_you_mean(word, names);
  fmt::print(stderr, "sherlog: error: there is no command '{}'{}\n", word.substr(0, 80),
             nearest.empty() ? "" : fmt::format("; did you mean '{}'?", nearest));
  fmt::print(stderr, "the commands are {}; see 'sherlog --help'\n", fmt::join(names, ", "));
  return false;
}

int run(int argc, char** argv) {
  CLI::App app("Sherlog: a Markov logic engine", "sherlog");
  app.set_version_flag("--version", "sherlog " SHERLOG_VERSION);
  app.set_help_flag("--help", "Print this help and end");
  app.require_subcommand(1);
  app.formatter(std::make_shared<HelpFormatter>());  // subcommands inherit it
  Action action;
  sherlog::cli::add_check(app, action);
  sherlog::cli::add_ground(app, action);
  sherlog::cli::add_infer(app, action);
  sherlog::cli::add_explain(app, action);
  sherlog::cli::add_learn(app, action);
  sherlog::cli::add_xval(app, action);
  sherlog::cli::add_convert(app, action);
  sherlog::cli::add_scenes(app, action);
  sherlog::cli::add_track(app, action);
  sherlog::cli::add_advise(app, action);
#ifdef SHERLOG_HAS_RGBD
  sherlog::cli::add_perceive(app, action);
#endif
  app.footer(
      "Exit codes: 0 done; 1 internal error; 2 bad usage or input; 3 no possible world; 4 a limit was reached;\n"
      "130 interrupted. 'sherlog COMMAND --help' lists the options of a command.");
  if (!is_known_command(app, argc, argv)) return sherlog::cli::kBadInput;
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return answer_parse_error(app, error);
  }
  return action();
}

}  // namespace

int main(int argc, char** argv) {
  FLAGS_minloglevel = google::GLOG_FATAL;  // what the optimiser of learning notes for its developers
  sherlog::cli::install_signal_handlers();
  try {
    return run(argc, argv);
  } catch (const std::bad_alloc&) {
    std::fputs("sherlog: error: the memory limit was reached\n", stderr);
    return sherlog::cli::kLimitReached;
  } catch (const std::system_error& error) {
    // A thread that cannot be made for want of memory is a limit as well.
    const bool limit =
        error.code() == std::errc::resource_unavailable_try_again || error.code() == std::errc::not_enough_memory;
    std::fprintf(stderr, "sherlog: error: %s\n", error.what());
    return limit ? sherlog::cli::kLimitReached : sherlog::cli::kInternalError;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "sherlog: internal error: %s\n", error.what());
    return sherlog::cli::kInternalError;
  }
}
