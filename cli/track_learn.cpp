// sherlog track learn: the free parameters of the identity model, from simulated training trials.
#include <fmt/format.h>

#include <array>
#include <memory>

#include "cli/output.h"
#include "cli/table.h"
#include "cli/track_commands.h"
#include "cli/track_options.h"
#include "perception_bridge/identity_learning.h"

namespace sherlog::cli {
namespace {

struct TrackLearnArguments {
  Options options;
  TrackOptions track;
  std::string output, method = "dpll";
};

constexpr std::array<const char*, 6> kNames = {"stay",     "move",          "newview",
                                               "appeared", "gone, in view", "unmatched, out of view"};

int learn(Session& session, const TrackLearnArguments& arguments) {
  const auto config = read_config(session, arguments.track);
  if (!config) return kBadInput;
  IdentityTraining training = identity_training(session, arguments.track, *config);
  training.method = arguments.method;
  const LearnedIdentity learned = learn_identity(training, session.monitor());
  if (learned.termination != Termination::kCompleted)
    return session.error(learned.message), exit_code(learned.termination);
  session.release_memory();
  if (const auto problem = write_to(arguments.output, learned.model)) return session.error(*problem), kInternalError;
  std::string text;
  if (arguments.output != "-") {
    Table table({{"what", Align::kLeft}, {"weight", Align::kRight}});
    for (std::size_t i = 0; i < kNames.size(); ++i)
      table.add_row({kNames[i], fmt::format("{:.4f}", learned.weights[i])});
    text = fmt::format(
        "{} training trials, noise {}; {}, {} iterations ({:.2f} s)\n\n{}\nsigma of colours {:.5f}, of positions "
        "{:.5f}\n",
        training.trials, config->noise, arguments.method, learned.iterations, learned.seconds, table.text(),
        learned.grading.sigma_color, learned.grading.sigma_position);
  }
  return session.finish(kDone, text, [&] {
    Json json;
    json["schema"] = "sherlog.track.learn/1";
    json["termination"] = to_string(learned.termination);
    json["method"] = arguments.method;
    json["trials"] = training.trials;
    json["objective"] = learned.objective;
    json["iterations"] = learned.iterations;
    for (std::size_t i = 0; i < kNames.size(); ++i) json["weights"][kNames[i]] = learned.weights[i];
    json["sigma"] = {{"color", learned.grading.sigma_color}, {"position", learned.grading.sigma_position}};
    json["config"] = config_json(*config);
    json["seconds"] = {{"total", learned.seconds}};
    return to_text(json);
  });
}

int run_learn(const TrackLearnArguments& arguments) {
  Session session(arguments.options);
  if (!session.check_options({arguments.output})) return kBadInput;
  return session.run("sherlog.track.learn/1", [&] { return learn(session, arguments); });
}

}  // namespace

void add_track_learn(CLI::App& track, Action& action) {
  auto arguments = std::make_shared<TrackLearnArguments>();
  CLI::App* command = track.add_subcommand(
      "learn", "How often things happen and how exact the sensor is, learned from simulated training trials");
  add_world_file_options(*command, arguments->track);
  add_training_trials_option(*command, arguments->track);
  command->add_option("--noise", arguments->track.noise, "Sigma of positions (metres) and colours (default 0.05)")
      ->type_name("S");
  command->add_option("--method", arguments->method, "Method of learning (default dpll)")
      ->type_name("dpll|cll")
      ->check(one_of({"dpll", "cll"}));
  command->add_option("-o,--output", arguments->output, "Where the model goes; '-': standard output")
      ->type_name("FILE|-")
      ->required();
  add_common_options(*command, arguments->options);
  command->callback([arguments, &action] { action = [arguments] { return run_learn(*arguments); }; });
}

}  // namespace sherlog::cli
