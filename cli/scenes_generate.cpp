// sherlog scenes generate: synthetic kitchen scenes, as evidence for a model or as observations for a scene store.
#include <fmt/format.h>

#include <cstdint>
#include <map>
#include <memory>

#include "cli/scenes.h"
#include "cli/table.h"
#include "perception_bridge/kitchen_generator.h"
#include "perception_bridge/kitchen_scenes.h"

namespace sherlog::cli {
namespace {

constexpr std::uint64_t kMostScenes = 10'000'000;

struct Generation {
  std::uint64_t scenes = 50;
  std::string output = "-";
  std::string format = "db";
  std::string spelling = "model";
  std::string annotators = "all";
  bool unlabelled = false;
};

// What was made: scenes by context, objects by class, answers by annotator.
struct Tally {
  std::size_t objects = 0;
  std::vector<std::size_t> contexts, classes;
  std::map<std::string, std::size_t> annotations;

  void add(const KitchenScene& scene, bool all_annotators) {
    const auto count = [&](const char* annotator, bool answered) { annotations[annotator] += answered ? 1u : 0u; };
    ++contexts[scene.context];
    for (const KitchenObject& object : scene.objects) {
      ++objects;
      ++classes[object.object_class];
      annotations["shape"] += object.shapes.size();
      annotations["color"] += object.colors.size();
      count("goggles_Text", object.text.has_value());
      count("goggles_Logo", object.logo.has_value());
      count("goggles", object.image.has_value());
      count("goggles_Contact", object.contact.has_value());
      if (!all_annotators) continue;
      count("size", object.big.has_value());
      count("goggles_Product", object.product.has_value());
      count("linemod", object.detected.has_value());
    }
  }
};

Json generation_json(const KitchenConfig& config, const Generation& generation, std::uint64_t seed, const Tally& tally,
                     const std::string& text) {
  Json json;
  json["schema"] = "sherlog.scenes.generate/1";
  json["seed"] = seed;
  json["scenes"] = generation.scenes;
  json["objects"] = tally.objects;
  for (std::size_t i = 0; i < config.contexts.size(); ++i) json["contexts"][config.contexts[i]] = tally.contexts[i];
  for (std::size_t i = 0; i < config.classes.size(); ++i) json["classes"][config.classes[i].name] = tally.classes[i];
  for (const auto& [name, count] : tally.annotations) json["annotations"][name] = count;
  if (generation.output == "-") json["text"] = text;
  return json;
}

std::string generation_text(const KitchenConfig& config, const Tally& tally) {
  std::string text = fmt::format("{} objects\n\n", tally.objects);
  Table contexts({{"context", Align::kLeft}, {"scenes", Align::kRight}});
  for (std::size_t i = 0; i < config.contexts.size(); ++i) {
    contexts.add_row({config.contexts[i], std::to_string(tally.contexts[i])});
  }
  Table annotations({{"annotator", Align::kLeft}, {"answers", Align::kRight}});
  for (const auto& [name, count] : tally.annotations) annotations.add_row({name, std::to_string(count)});
  return text + contexts.text() + "\n" + annotations.text();
}

int run_generate(Options options, const Generation& generation) {
  Session session(std::move(options));
  std::vector<std::string> outputs;
  if (generation.output != "-") outputs.push_back(generation.output);
  if (!session.check_options(outputs)) return kBadInput;
  if (generation.scenes == 0 || generation.scenes > kMostScenes) {
    session.error(fmt::format("--scenes: {} is not a number from 1 to {}", generation.scenes, kMostScenes));
    return kBadInput;
  }
  const KitchenConfig config = default_kitchen();
  KitchenTextOptions text_options;
  text_options.spelling = generation.spelling == "recorded" ? KitchenSpelling::kRecorded : KitchenSpelling::kModel;
  text_options.all_annotators = generation.annotators == "all";
  text_options.labels = !generation.unlabelled;

  Tally tally;
  tally.contexts.resize(config.contexts.size());
  tally.classes.resize(config.classes.size());
  std::string text;
  Termination termination = Termination::kCompleted;
  for (std::uint64_t number = 0; number < generation.scenes; ++number) {
    if (number % 1024 == 0) {
      session.monitor().progress("scenes", static_cast<double>(number), static_cast<double>(generation.scenes));
      if (session.monitor().interrupted()) termination = Termination::kInterrupted;
      if (session.seconds_left() <= 0) termination = Termination::kTimeLimit;
      // Half of the scenes would be taken for all of them: nothing is written.
      if (termination != Termination::kCompleted) {
        session.error(fmt::format("stopped after {} of {} scenes; nothing was written", number, generation.scenes));
        return exit_code(termination);
      }
    }
    const KitchenScene scene = generate_kitchen_scene(config, session.options().seed, number);
    tally.add(scene, text_options.all_annotators);
    if (generation.format == "jsonl") {
      KitchenSceneOptions scene_options;
      scene_options.labels = !generation.unlabelled;
      text += json_text(scene_to_json(kitchen_scene(config, session.options().seed, number, scene_options))) + "\n";
      continue;
    }
    if (number > 0) text += "---\n";
    text += kitchen_scene_text(config, scene, text_options);
  }
  if (generation.output != "-" && !session.write(generation.output, text)) return kInternalError;
  return session.finish(kDone, generation.output == "-" ? text : generation_text(config, tally), [&] {
    return to_text(generation_json(config, generation, session.options().seed, tally, text));
  });
}

}  // namespace

void add_scenes_generate(CLI::App& scenes, Action& action) {
  auto options = std::make_shared<Options>();
  auto generation = std::make_shared<Generation>();
  CLI::App* command = scenes.add_subcommand(
      "generate", "Synthetic kitchen scenes: labelled objects and what annotators would report of them");
  command->add_option("--scenes", generation->scenes, "How many scenes (default 50)")->type_name("N");
  command
      ->add_option("-o,--output", generation->output,
                   "Where the scenes go, --- between them (default '-': standard output)")
      ->type_name("FILE|-");
  command
      ->add_option("--format", generation->format,
                   "db: evidence for a model; jsonl: observations, one scene a line, for 'scenes import' (default db)")
      ->type_name("db|jsonl")
      ->check(one_of({"db", "jsonl"}));
  command
      ->add_option("--spelling", generation->spelling,
                   "As models/information_fusion/kitchen_predicates.mln writes constants, or in lower case and without "
                   "blanks as in recorded scenes (default model)")
      ->type_name("model|recorded")
      ->check(one_of({"model", "recorded"}));
  command
      ->add_option("--annotators", generation->annotators,
                   "paper: only the predicates of predicates.mln, without size, linemod and goggles_Product (default "
                   "all)")
      ->type_name("all|paper")
      ->check(one_of({"all", "paper"}));
  command->add_flag("--unlabelled", generation->unlabelled, "Leave the classes out: what a robot would know");
  add_common_options(*command, *options);
  command->callback([options, generation, &action] {
    action = [options, generation] { return run_generate(*options, *generation); };
  });
}

}  // namespace sherlog::cli
