// sherlog track learn: the free parameters of the identity model, from simulated training trials or from labelled scenes.
#include <fmt/format.h>

#include <array>
#include <memory>

#include "cli/scenes.h"
#include "cli/table.h"
#include "cli/track_commands.h"
#include "cli/track_options.h"
#include "perception_bridge/identity_learning.h"
#include "perception_bridge/scene_learning.h"

namespace sherlog::cli {
namespace {

struct TrackLearnArguments {
  Options options;
  TrackOptions track;
  std::string output, method = "dpll";
  std::vector<std::string> scenes;  // stores
  std::string mapping = "perception", mapping_output;
};

std::string weights_text(const IdentityWeights& weights) {
  Table table({{"what", Align::kLeft}, {"weight", Align::kRight}});
  for (std::size_t i = 0; i < weights.size(); ++i)
    table.add_row({kIdentityWeightNames[i], fmt::format("{:.4f}", weights[i])});
  return table.text();
}

Json weights_json(const IdentityWeights& weights) {
  Json json;
  for (std::size_t i = 0; i < weights.size(); ++i) json[kIdentityWeightNames[i]] = weights[i];
  return json;
}

int learn(Session& session, const TrackLearnArguments& arguments) {
  const auto config = read_config(session, arguments.track);
  if (!config) return kBadInput;
  IdentityTraining training = identity_training(session, arguments.track, *config);
  training.how.method = arguments.method;
  const LearnedIdentity learned = learn_identity(training, session.monitor());
  if (learned.termination != Termination::kCompleted)
    return finish_unlearned(session, "sherlog.track.learn/1", learned.termination, learned.message);
  session.release_memory();
  if (!session.write(arguments.output, learned.model)) return kInternalError;
  std::string text;
  if (arguments.output != "-") {
    text = fmt::format(
        "{} training trials, noise {}; {}, {} iterations ({:.2f} s)\n\n{}\nsigma of colours {:.5f}, of positions "
        "{:.5f}\n",
        training.trials, config->noise, arguments.method, learned.iterations, learned.seconds,
        weights_text(learned.weights), learned.grading.sigma_color, learned.grading.sigma_position);
  }
  return session.finish(kDone, text, [&] {
    Json json;
    json["schema"] = "sherlog.track.learn/1";
    json["termination"] = to_string(learned.termination);
    json["method"] = arguments.method;
    json["trials"] = training.trials;
    json["objective"] = learned.objective;
    json["iterations"] = learned.iterations;
    json["weights"] = weights_json(learned.weights);
    json["sigma"] = {{"color", learned.grading.sigma_color}, {"position", learned.grading.sigma_position}};
    json["config"] = config_json(*config);
    json["seconds"] = {{"total", learned.seconds}};
    return to_text(json);
  });
}

// Each store is a recording.
std::optional<SceneTraining> read_training(Session& session, const TrackLearnArguments& arguments) {
  auto mapping = read_mapping(session, arguments.mapping);
  if (!mapping) return std::nullopt;
  SceneTraining training;
  training.mapping = std::move(*mapping);
  training.how.method = arguments.method;
  training.how.threads = session.options().threads;
  for (const std::string& path : arguments.scenes) {
    StoreChoice choice;
    choice.path = path;
    auto store = open_store(session, choice, {.read_only = true});
    if (!store) return std::nullopt;
    std::vector<Scene>& recording = training.recordings.emplace_back();
    store->for_each_scene({}, [&](const Scene& scene) { return recording.push_back(scene), true; });
    if (!store->problem().empty()) return session.error(store->problem()), std::nullopt;
  }
  training.how.max_seconds = session.seconds_left();
  return training;
}

std::string sigmas_text(const SimilarityConfig& before, const SimilarityConfig& after) {
  Table table({{"type", Align::kLeft}, {"sigma before", Align::kRight}, {"sigma", Align::kRight}});
  for (std::size_t i = 0; i < after.rules.size(); ++i) {
    table.add_row({after.rules[i].type, fmt::format("{:.4g}", before.rules[i].sigma),
                   fmt::format("{:.4g}", after.rules[i].sigma)});
  }
  return table.text();
}

int learn_scenes(Session& session, const TrackLearnArguments& arguments) {
  const auto training = read_training(session, arguments);
  if (!training) return kBadInput;
  const LearnedScenes learned = learn_from_scenes(*training, session.monitor());
  if (learned.termination != Termination::kCompleted)
    return finish_unlearned(session, "sherlog.track.learn/1", learned.termination, learned.message);
  const std::string mapping = json_text(mapping_to_json(learned.mapping), 2) + "\n";
  if (!arguments.mapping_output.empty() && !session.write(arguments.mapping_output, mapping)) return kInternalError;
  if (!session.write(arguments.output, learned.model)) return kInternalError;
  std::string text;
  if (arguments.output != "-") {
    text = fmt::format(
        "{} recordings, {} steps, {} pairs of one thing, {} of two; {}, {} iterations\n\n{}\nmean log-likelihood of "
        "a pair's looks {:.5f}, before {:.5f}\n{}",
        training->recordings.size(), learned.steps, learned.same_pairs, learned.other_pairs, arguments.method,
        learned.iterations, weights_text(learned.weights), learned.log_likelihood, learned.log_likelihood_before,
        sigmas_text(training->mapping.similarity, learned.mapping.similarity));
  }
  return session.finish(kDone, text, [&] {
    Json json{{"schema", "sherlog.track.learn/1"},
              {"termination", to_string(learned.termination)},
              {"method", arguments.method},
              {"recordings", training->recordings.size()},
              {"steps", learned.steps},
              {"pairs", {{"same", learned.same_pairs}, {"other", learned.other_pairs}}},
              {"objective", learned.objective},
              {"iterations", learned.iterations},
              {"log_likelihood_before", learned.log_likelihood_before},
              {"log_likelihood", learned.log_likelihood},
              {"weights", weights_json(learned.weights)},
              {"sigma", Json::object()}};
    for (const SimilarityRule& rule : learned.mapping.similarity.rules) json["sigma"][rule.type] = rule.sigma;
    return to_text(json);
  });
}

int run_learn(const TrackLearnArguments& arguments) {
  Session session(arguments.options);
  std::vector<std::string> outputs = {arguments.output};
  if (!arguments.mapping_output.empty()) outputs.push_back(arguments.mapping_output);
  if (!session.check_options(outputs)) return kBadInput;
  return session.run("sherlog.track.learn/1", [&] {
    return arguments.scenes.empty() ? learn(session, arguments) : learn_scenes(session, arguments);
  });
}

}  // namespace

void add_track_learn(CLI::App& track, Action& action) {
  auto arguments = std::make_shared<TrackLearnArguments>();
  CLI::App* command = track.add_subcommand(
      "learn", "How often things happen and how exact the sensor is, learned from simulated trials or labelled scenes");
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
  CLI::Option* scenes = command
                            ->add_option("--scenes", arguments->scenes,
                                         "Learn from labelled scenes instead: stores, each a recording in which a "
                                         "thing keeps its name")
                            ->type_name("STORE..");
  command
      ->add_option("--mapping", arguments->mapping,
                   "With --scenes: how clusters are compared to begin with (default perception)")
      ->type_name("identity|perception|FILE")
      ->needs(scenes);
  command
      ->add_option("--mapping-output", arguments->mapping_output,
                   "With --scenes: where the mapping with the learned spreads goes")
      ->type_name("FILE")
      ->needs(scenes);
  add_common_options(*command, arguments->options);
  command->callback([arguments, &action] { action = [arguments] { return run_learn(*arguments); }; });
}

}  // namespace sherlog::cli
