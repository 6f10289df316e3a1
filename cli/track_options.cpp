#include "cli/track_options.h"

#include <fmt/format.h>

#include "mln/model.h"
#include "mln/text_file.h"
#include "perception_bridge/baseline_matchers.h"
#include "perception_bridge/identity_learning.h"
#include "perception_bridge/identity_resolver.h"
#include "perception_bridge/shipped_models.h"

namespace sherlog::cli {

void add_world_file_options(CLI::App& command, TrackOptions& options) {
  command
      .add_option("--config", options.config_file,
                  "The simulated world as a JSON file: any of the parameters that --json lists under config")
      ->type_name("FILE");
  command.add_option("--objects", options.objects, "Objects in the world (default 15)")
      ->type_name("N")
      ->check(whole_number(1000));
}

void add_training_trials_option(CLI::App& command, TrackOptions& options) {
  command
      .add_option(
          "--training-trials", options.training_trials,
          "Trials that the learned model is learned from, at the same noise, with 1 to 5 actions (default 1000)")
      ->type_name("N")
      ->check(whole_number(1000000));
}

void add_trials_options(CLI::App& command, TrackOptions& options) {
  command.add_option("--trials", options.trials, "Trials, of each cell (default 1000)")
      ->type_name("N")
      ->check(whole_number(100000000));
  add_training_trials_option(command, options);
}

std::optional<FourTablesConfig> read_config(Session& session, const TrackOptions& options) {
  FourTablesConfig config;
  if (!options.config_file.empty()) {
    if (!session.reads(options.config_file)) return std::nullopt;
    const TextFile file = load_text_file(options.config_file);
    if (!file.text)
      return session.error(fmt::format("--config: {}: {}", options.config_file, file.problem)), std::nullopt;
    if (const std::string problem = sherlog::read_config(*file.text, config); !problem.empty()) {
      return session.error(fmt::format("{}: {}", options.config_file, problem)), std::nullopt;
    }
  }
  if (options.objects) config.objects = *options.objects;
  if (options.actions) config.actions = *options.actions;
  if (options.noise) config.noise = *options.noise;
  if (const std::string problem = validate(config); !problem.empty()) return session.error(problem), std::nullopt;
  if (options.trials == 0) return session.error("--trials: at least 1 is needed"), std::nullopt;
  if (options.training_trials == 0) return session.error("--training-trials: at least 1 is needed"), std::nullopt;
  return config;
}

const std::vector<std::string>& baseline_names() {
  static const std::vector<std::string> names = {"generative", "hungarian", "nearest"};
  return names;
}

std::vector<std::string> matcher_names() { return {"mln", "generative", "hungarian", "nearest"}; }

IdentityTraining identity_training(Session& session, const TrackOptions& options, const FourTablesConfig& config) {
  IdentityTraining training;
  training.config = config;
  training.trials = options.training_trials;
  training.seed ^= session.options().seed;
  training.how.threads = session.options().threads;
  training.how.max_seconds = session.seconds_left();
  return training;
}

namespace {

MadeMatcher make_resolver(Session& session, const std::string& model_name, const TrackOptions& track,
                          const FourTablesConfig& config) {
  Diagnostics& diagnostics = session.diagnostics();
  std::optional<Model> model;
  Grading grading;
  if (model_name == "paper") {
    model = parse_model(paper_identity_model(), "paper", diagnostics);
  } else if (model_name == "learned") {
    const LearnedIdentity learned = learn_identity(identity_training(session, track, config), session.monitor());
    if (learned.termination != Termination::kCompleted) return {nullptr, learned.termination, learned.message};
    model = parse_model(learned.model, "learned", diagnostics);
    grading = learned.grading;
  } else {
    if (!session.reads(model_name)) return {};
    model = parse_model_file(model_name, diagnostics);
    // A model that asks for more than Table 1 has weights of its own, and wants odds.
    if (model && model->find_predicate("seesPlace")) grading = {Grading::Kind::kOdds, config.noise, config.noise};
  }
  session.print_diagnostics();
  if (!model) return {};
  InferenceOptions options = session.inference_options();
  std::string problem;
  auto resolver = IdentityResolver::make(model_name, *std::move(model), grading, options, problem);
  if (!resolver) session.error(fmt::format("--model {}: {}", model_name, problem));
  return {std::move(resolver)};
}

}  // namespace

MadeMatcher make_matcher(Session& session, const std::string& name, const std::string& model,
                         const TrackOptions& options, const FourTablesConfig& config) {
  if (name == "mln") return make_resolver(session, model, options, config);
  if (name == "generative") return {generative_matcher(config)};
  if (name == "hungarian") return {hungarian_matcher()};
  return {nearest_neighbour_matcher()};
}

int finish_unlearned(Session& session, const char* schema, Termination termination, const std::string& message) {
  if (message.empty()) return kBadInput;
  session.error(message);
  return session.finish(exit_code(termination), "", [&] {
    return to_text(Json{{"schema", schema}, {"termination", to_string(termination)}, {"message", message}});
  });
}

std::string share_text(const GroupedShare& share) {
  if (share.total() == 0) return "-";
  const auto [low, high] = share.interval();
  return fmt::format("{:.4f} ({:.4f}-{:.4f})", share.rate(), low, high);
}

Json share_json(const GroupedShare& share) {
  Json json;
  json["right"] = share.right();
  json["total"] = share.total();
  if (share.total() == 0) return json;
  json["rate"] = share.rate();
  const auto [low, high] = share.interval();
  json["interval95"] = {low, high};
  return json;
}

Json config_json(const FourTablesConfig& config) { return Json::parse(to_json(config)); }

}  // namespace sherlog::cli
