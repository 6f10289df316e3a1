// sherlog track: object identity over scenes. Each subcommand is one function below or a file of its own.
#include <fmt/format.h>

#include <memory>

#include "cli/commands.h"
#include "cli/table.h"
#include "cli/track_commands.h"
#include "cli/track_options.h"
#include "perception_bridge/four_tables_json.h"
#include "perception_bridge/track_run.h"

namespace sherlog::cli {
namespace {

constexpr std::uint64_t kMostDumped = 10'000'000;

struct SimulateArguments {
  Options options;
  TrackOptions track;
  std::string matcher = "mln";
  std::string model = "learned";
  std::string dump;
};

struct Timing {
  double sum = 0, longest = 0;
  void add(double seconds) {
    sum += seconds;
    longest = std::max(longest, seconds);
  }
};

std::string simulate_text(const FourTablesConfig& config, const std::string& matcher, std::uint64_t trials,
                          const TrackScore& score, const Timing& timing) {
  std::string text = fmt::format("{} trials, {} objects, {} tables, {} actions, noise {}; matcher {}\n\n", trials,
                                 config.objects, config.tables, config.actions, config.noise, matcher);
  Table table({{"success rate", Align::kLeft}, {"clusters", Align::kRight}, {"rate (95 %)", Align::kRight}});
  table.add_row(
      {"association of new clusters", std::to_string(score.association.total()), share_text(score.association)});
  table.add_row({"explanation", std::to_string(score.explanation.total()), share_text(score.explanation)});
  table.add_row(
      {"explanation of acted-on objects", std::to_string(score.acted_on.total()), share_text(score.acted_on)});
  table.add_row({"... of those that are not hidden", std::to_string(score.acted_on_shown.total()),
                 share_text(score.acted_on_shown)});
  text += table.text();
  text += fmt::format("\nreported as disappeared though out of view: {}\n", score.disappeared_out_of_view);
  if (trials > 0) {
    text += fmt::format("evidence to belief: {:.3f} ms a trial, {:.3f} ms at most\n",
                        1e3 * timing.sum / static_cast<double>(trials), 1e3 * timing.longest);
  }
  return text;
}

int simulate(Session& session, const SimulateArguments& arguments) {
  const auto config = read_config(session, arguments.track);
  if (!config) return kBadInput;
  if (!arguments.dump.empty() && arguments.track.trials > kMostDumped) {
    return session.error(fmt::format("--dump: {} trials are too many for one file; at most {}", arguments.track.trials,
                                     kMostDumped)),
           kBadInput;
  }
  const MadeMatcher made = make_matcher(session, arguments.matcher, arguments.model, arguments.track, *config);
  if (!made.matcher) return finish_unlearned(session, "sherlog.track.simulate/1", made.termination, made.message);
  const Matcher* const matcher = made.matcher.get();
  TrackRun run;
  run.config = *config;
  run.seed = arguments.options.seed;
  run.trials = arguments.track.trials;
  run.threads = arguments.options.threads;
  TrackScore score;
  Timing timing;
  std::string dump;
  const Matcher* const matchers[] = {matcher};
  const TrackRunResult result = run_trials(
      run, matchers, StopCondition(session.monitor(), session.seconds_left()),
      [&](const FourTablesTrial& trial, std::span<const MatcherAnswer> answers) {
        score.add(trial, answers[0].resolution);
        timing.add(answers[0].seconds);
        if (!arguments.dump.empty()) dump += trial_line(trial, answers[0]);
      },
      [&](std::uint64_t done) {
        session.monitor().progress("trials", static_cast<double>(done), static_cast<double>(run.trials));
      });
  session.release_memory();
  if (result.termination != Termination::kCompleted) session.error(result.message);
  if (!arguments.dump.empty() && !session.write(arguments.dump, dump)) return kInternalError;
  const std::string text =
      arguments.dump == "-" ? "" : simulate_text(*config, matcher->name(), result.trials, score, timing);
  return session.finish(exit_code(result.termination), text, [&] {
    Json json;
    json["schema"] = "sherlog.track.simulate/1";
    json["termination"] = to_string(result.termination);
    if (!result.message.empty()) json["message"] = result.message;
    json["matcher"] = matcher->name();
    json["seed"] = run.seed;
    json["trials"] = result.trials;
    json["config"] = config_json(*config);
    json["association"] = share_json(score.association);
    json["explanation"] = share_json(score.explanation);
    json["acted_on"] = share_json(score.acted_on);
    json["acted_on_shown"] = share_json(score.acted_on_shown);
    json["disappeared_out_of_view"] = score.disappeared_out_of_view;
    json["seconds"] = {{"resolve", timing.sum}, {"longest", timing.longest}, {"total", session.seconds()}};
    return to_text(json);
  });
}

int run_simulate(const SimulateArguments& arguments) {
  Session session(arguments.options);
  std::vector<std::string> outputs;
  if (!arguments.dump.empty()) outputs.push_back(arguments.dump);
  if (!session.check_options(outputs)) return kBadInput;
  return session.run("sherlog.track.simulate/1", [&] { return simulate(session, arguments); });
}

void add_simulate(CLI::App& track, Action& action) {
  auto arguments = std::make_shared<SimulateArguments>();
  CLI::App* command =
      track.add_subcommand("simulate", "Simulates the four tables and resolves who is who in every trial");
  add_world_file_options(*command, arguments->track);
  add_trials_options(*command, arguments->track);
  command->add_option("--actions", arguments->track.actions, "Actions between the two looks (default 3)")
      ->type_name("N")
      ->check(whole_number(100000));
  command->add_option("--noise", arguments->track.noise, "Sigma of positions (metres) and colours (default 0.05)")
      ->type_name("S");
  command
      ->add_option("--matcher", arguments->matcher, "Who resolves: a Markov logic model, or a baseline (default mln)")
      ->type_name("NAME")
      ->check(one_of(matcher_names()));
  command
      ->add_option("--model", arguments->model,
                   "Of the matcher mln: Table 1 as published, the learned model, or a file (default learned)")
      ->type_name("paper|learned|FILE.mln");
  command->add_option("--dump", arguments->dump, "Every trial with its result as a line of JSON")->type_name("FILE|-");
  add_inference_options(*command, arguments->options);
  add_common_options(*command, arguments->options);
  command->callback([arguments, &action] { action = [arguments] { return run_simulate(*arguments); }; });
}

}  // namespace

void add_track(CLI::App& app, Action& action) {
  CLI::App* command = app.add_subcommand("track", "Object identity over scenes: resolve, show, simulate and evaluate");
  command->require_subcommand(1);
  add_simulate(*command, action);
  add_track_learn(*command, action);
  add_track_evaluate(*command, action);
  add_track_resolve(*command, action);
  add_track_show(*command, action);
}

}  // namespace sherlog::cli
