// sherlog track evaluate: Fig. 10 of the paper, for several matchers on the same trials.
#include <fmt/format.h>

#include <charconv>
#include <memory>

#include "cli/table.h"
#include "cli/track_commands.h"
#include "cli/track_options.h"
#include "perception_bridge/track_report.h"
#include "perception_bridge/track_run.h"

namespace sherlog::cli {
namespace {

struct EvaluateArguments {
  Options options;
  TrackOptions track;
  std::vector<double> noises = {0.025, 0.05, 0.075, 0.1};
  std::vector<std::uint32_t> actions = {1, 2, 3, 4, 5};
  std::vector<std::string> matchers = {"paper", "learned", "generative", "hungarian", "nearest"};
  std::string csv, svg, html;
};

std::string figures_text(const TrackEvaluation& e, double seconds) {
  std::string text;
  const auto table_of = [&](const char* title, const GroupedShare TrackScore::*share) {
    Table table({{"noise", Align::kRight}, {"actions", Align::kRight}, {"trials", Align::kRight}});
    for (const std::string& matcher : e.matchers) table.add_column(matcher, Align::kRight);
    double last = -1;
    for (const TrackCell& cell : e.cells) {
      if (last >= 0 && cell.noise != last) table.add_gap();
      last = cell.noise;
      std::vector<std::string> row = {fmt::format("{}", cell.noise), std::to_string(cell.actions),
                                      std::to_string(cell.trials)};
      for (const TrackScore& score : cell.scores) {
        const auto [low, high] = (score.*share).interval();
        row.push_back((score.*share).total() == 0
                          ? "-"
                          : fmt::format("{:.3f} +-{:.3f}", (score.*share).rate(), (high - low) / 2));
      }
      table.add_row(std::move(row));
    }
    text += fmt::format("{}\n{}\n", title, table.text());
  };
  table_of("Association of new clusters (10a)", &TrackScore::association);
  table_of("Explanation of all clusters (10b)", &TrackScore::explanation);
  table_of("Explanation of acted-on objects", &TrackScore::acted_on);
  table_of("Explanation of acted-on objects that are not hidden", &TrackScore::acted_on_shown);
  Table table({{"matcher", Align::kLeft}, {"ms a trial", Align::kRight}, {"disappeared out of view", Align::kRight}});
  for (std::size_t m = 0; m < e.matchers.size(); ++m) {
    double sum = 0;
    std::uint64_t trials = 0, disappeared = 0;
    for (const TrackCell& cell : e.cells) {
      sum += cell.seconds[m];
      trials += cell.trials;
      disappeared += cell.scores[m].disappeared_out_of_view;
    }
    table.add_row({e.matchers[m],
                   fmt::format("{:.3f}", 1e3 * sum / static_cast<double>(std::max<std::uint64_t>(1, trials))),
                   std::to_string(disappeared)});
  }
  return text + table.text() + fmt::format("\n{:.1f} s in all\n", seconds);
}

Json scores_json(const TrackEvaluation& e, const std::vector<TrackScore>& scores) {
  Json json = Json::object();
  for (std::size_t m = 0; m < scores.size(); ++m) {
    Json& one = json[e.matchers[m]];
    one["association"] = share_json(scores[m].association);
    one["explanation"] = share_json(scores[m].explanation);
    one["acted_on"] = share_json(scores[m].acted_on);
    one["acted_on_shown"] = share_json(scores[m].acted_on_shown);
    one["disappeared_out_of_view"] = scores[m].disappeared_out_of_view;
  }
  return json;
}

Json evaluation_json(const TrackEvaluation& e, const TrackRunResult& result, double seconds) {
  Json json;
  json["schema"] = "sherlog.track.evaluate/1";
  json["termination"] = to_string(result.termination);
  if (!result.message.empty()) json["message"] = result.message;
  json["seed"] = e.seed;
  json["trials"] = e.trials;
  json["matchers"] = e.matchers;
  json["config"] = Json::parse(e.config);
  json["cells"] = Json::array();
  for (const TrackCell& cell : e.cells) {
    Json entry;
    entry["noise"] = cell.noise;
    entry["actions"] = cell.actions;
    entry["trials"] = cell.trials;
    entry["scores"] = scores_json(e, cell.scores);
    for (std::size_t m = 0; m < e.matchers.size(); ++m) entry["seconds"][e.matchers[m]] = cell.seconds[m];
    json["cells"].push_back(std::move(entry));
  }
  json["problem_sizes"] = Json::array();
  for (const TrackSize& size : e.sizes) {
    json["problem_sizes"].push_back(
        {{"noise", size.noise}, {"size", size.size}, {"trials", size.trials}, {"scores", scores_json(e, size.scores)}});
  }
  json["seconds"] = {{"total", seconds}};
  return json;
}

// One matcher for each name; those that do not depend on the number of actions are kept from cell to cell of one noise.
class Matchers {
 public:
  Matchers(Session& session, const EvaluateArguments& arguments)
      : session_(session), track_(arguments.track), names_(arguments.matchers), kept_(names_.size()) {}

  // What kept one of them from being made; kCompleted: nothing.
  struct Problem {
    Termination termination = Termination::kCompleted;
    std::string message = {};
  };
  Problem prepare(const FourTablesConfig& config) {
    for (std::size_t m = 0; m < names_.size(); ++m) {
      const bool depends = names_[m] == "generative" || noise_ != config.noise;
      if (kept_[m] && !depends) continue;
      const bool baseline = std::ranges::find(baseline_names(), names_[m]) != baseline_names().end();
      MadeMatcher made = baseline ? make_matcher(session_, names_[m], "", track_, config)
                                  : make_matcher(session_, "mln", names_[m], track_, config);
      if (!made.matcher) return {made.termination, std::move(made.message)};
      kept_[m] = std::move(made.matcher);
    }
    noise_ = config.noise;
    return {};
  }

  std::vector<const Matcher*> all() const {
    std::vector<const Matcher*> matchers;
    for (const auto& m : kept_) matchers.push_back(m.get());
    return matchers;
  }

 private:
  Session& session_;
  const TrackOptions& track_;
  std::vector<std::string> names_;
  std::vector<std::unique_ptr<Matcher>> kept_;
  double noise_ = -1;
};

// Every cell's trials have a seed of their own, the same for all matchers.
std::uint64_t cell_seed(std::uint64_t seed, std::size_t cell) { return seed * 1000 + cell + 1; }

TrackRunResult run_cells(Session& session, const EvaluateArguments& arguments, const FourTablesConfig& config,
                         TrackEvaluation& e) {
  Matchers matchers(session, arguments);
  TrackRunResult result;
  const std::size_t cells = arguments.noises.size() * arguments.actions.size();
  const double total = static_cast<double>(cells * arguments.track.trials);
  for (std::size_t i = 0; i < cells; ++i) {
    TrackRun run;
    run.config = config;
    run.config.noise = arguments.noises[i / arguments.actions.size()];
    run.config.actions = arguments.actions[i % arguments.actions.size()];
    run.seed = cell_seed(arguments.options.seed, i);
    run.trials = arguments.track.trials;
    run.threads = arguments.options.threads;
    e.cells.push_back({run.config.noise, run.config.actions, 0, std::vector<TrackScore>(e.matchers.size()),
                       std::vector<double>(e.matchers.size(), 0.0)});
    if (const Matchers::Problem problem = matchers.prepare(run.config);
        problem.termination != Termination::kCompleted) {
      result.termination = problem.termination;
      result.message = problem.message.empty() ? "" : fmt::format("cell {} of {}: {}", i + 1, cells, problem.message);
      return result;
    }
    const std::vector<const Matcher*> all = matchers.all();
    result = run_trials(
        run, all, StopCondition(session.monitor(), session.seconds_left()),
        [&](const FourTablesTrial& trial, std::span<const MatcherAnswer> answers) {
          for (std::size_t m = 0; m < answers.size(); ++m) {
            e.add(trial, m, answers[m].resolution);
            e.cells.back().seconds[m] += answers[m].seconds;
          }
        },
        [&](std::uint64_t done) {
          session.monitor().progress("trials", static_cast<double>(i * arguments.track.trials + done), total);
        });
    if (result.termination != Termination::kCompleted) {
      result.message = fmt::format("cell {} of {}: {}", i + 1, cells, result.message);
      return result;
    }
  }
  return result;
}

int evaluate(Session& session, const EvaluateArguments& arguments) {
  const auto config = read_config(session, arguments.track);
  if (!config) return kBadInput;
  for (const double noise : arguments.noises) {
    for (const std::uint32_t actions : arguments.actions) {
      FourTablesConfig cell = *config;
      cell.noise = noise;
      cell.actions = actions;
      if (const std::string problem = validate(cell); !problem.empty()) return session.error(problem), kBadInput;
    }
  }
  TrackEvaluation e;
  e.matchers = arguments.matchers;
  e.seed = arguments.options.seed;
  e.trials = arguments.track.trials;
  e.config = to_json(*config);
  const TrackRunResult result = run_cells(session, arguments, *config, e);
  session.release_memory();
  if (result.termination == Termination::kRefused && result.message.empty()) return kBadInput;  // was said
  if (result.termination != Termination::kCompleted) {
    session.error(result.message + "; the figures are those of the trials so far");
    e.notes.push_back("Not all trials were made: " + result.message);
  }
  const auto write = [&](const std::string& path, const auto& make) {
    return path.empty() || session.write(path, make());
  };
  if (!write(arguments.csv, [&] { return track_csv(e); }) || !write(arguments.svg, [&] { return track_svg(e); }) ||
      !write(arguments.html, [&] { return track_html(e); })) {
    return kInternalError;
  }
  const double seconds = session.seconds();
  return session.finish(exit_code(result.termination), figures_text(e, seconds),
                        [&] { return to_text(evaluation_json(e, result, seconds)); });
}

int run_evaluate(const EvaluateArguments& arguments) {
  Session session(arguments.options);
  std::vector<std::string> outputs;
  for (const std::string* path : {&arguments.csv, &arguments.svg, &arguments.html}) {
    if (!path->empty()) outputs.push_back(*path);
  }
  if (!session.check_options(outputs)) return kBadInput;
  return session.run("sherlog.track.evaluate/1", [&] { return evaluate(session, arguments); });
}

}  // namespace

void add_track_evaluate(CLI::App& track, Action& action) {
  auto arguments = std::make_shared<EvaluateArguments>();
  CLI::App* command =
      track.add_subcommand("evaluate", "Success rates over noise and actions (Fig. 10), models next to baselines");
  add_world_file_options(*command, arguments->track);
  add_trials_options(*command, arguments->track);
  command->add_option("--noise", arguments->noises, "Sigmas, with commas between them (default 0.025,0.05,0.075,0.1)")
      ->delimiter(',')
      ->allow_extra_args(false)
      ->type_name("S,..");
  command
      ->add_option("--actions", arguments->actions, "Numbers of actions, with commas between them (default 1,2,3,4,5)")
      ->delimiter(',')
      ->allow_extra_args(false)
      ->type_name("N,..")
      ->check(whole_number(100000));
  command
      ->add_option("--matchers", arguments->matchers,
                   "paper, learned, generative, hungarian, nearest, or model files; with commas between them (default: "
                   "all five)")
      ->delimiter(',')
      ->allow_extra_args(false)
      ->type_name("NAME,..");
  command->add_option("--csv", arguments->csv, "All shares with their intervals as CSV")->type_name("FILE");
  command->add_option("--svg", arguments->svg, "Figures 10a, 10b and 10c as one picture")->type_name("FILE");
  command->add_option("--html", arguments->html, "Tables and figures as a page")->type_name("FILE");
  add_inference_options(*command, arguments->options);
  add_common_options(*command, arguments->options);
  command->callback([arguments, &action] { action = [arguments] { return run_evaluate(*arguments); }; });
}

}  // namespace sherlog::cli
