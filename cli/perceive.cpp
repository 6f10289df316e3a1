// sherlog perceive: depth and colour frames to scenes, and answers to requests. Only where the RGB-D front end is
// built.
#include <fmt/format.h>

#include <map>
#include <memory>

#include "cli/output.h"
#include "cli/scenes.h"
#include "cli/table.h"
#include "mln/text_file.h"
#include "perception_bridge/observe.h"
#include "rgbd/frames/sequence.h"
#include "rgbd/pipeline/frame_source.h"
#include "rgbd/pipeline/perception.h"
#include "rgbd/pipeline/truth.h"

namespace sherlog::cli {
namespace {

struct PerceiveArguments {
  std::string frames, query, store, prefix, map, known, evidence, record;
  std::string mapping = "robosherlock";
  std::uint64_t every = 10, first = 0, last = std::numeric_limits<std::uint64_t>::max();
  bool times = false, replace = false, moving = false, labels = false;
};

// What has been found in all frames so far.
struct PerceiveTally {
  std::uint64_t frames = 0, unreadable = 0, stored = 0, moving = 0, things = 0, answers = 0;
  std::map<std::string, std::uint64_t> failures;  // "annotator: problem", frames
  Json scenes = Json::array();
  std::string text, evidence;
};

template <class T>
bool read_knowledge(Session& session, const char* option, const std::string& path,
                    std::optional<T> (*parse)(std::string_view, std::string&), T& target) {
  if (path.empty()) return true;
  const TextFile file = load_text_file(path);
  std::string problem = file.problem;
  auto parsed = file.text ? parse(*file.text, problem) : std::nullopt;
  if (!parsed) return session.error(fmt::format("{} '{}': {}", option, path, problem)), false;
  target = std::move(*parsed);
  return true;
}

std::optional<rgbd::Perception> make_perception(Session& session, const PerceiveArguments& arguments,
                                                const rgbd::Knowledge& knowledge, const std::string& name) {
  rgbd::PerceptionOptions options;
  options.threads = session.options().threads;
  options.log_times = !arguments.store.empty();
  options.prefix = arguments.prefix.empty() ? name + "-" : arguments.prefix;
  std::string problem;
  if (!arguments.query.empty()) {
    options.request = rgbd::parse_request(arguments.query, problem);
    if (!options.request) return session.error(fmt::format("--query: {}", problem)), std::nullopt;
  }
  // A store and evidence take all that can be found.
  if (!arguments.store.empty() || !arguments.evidence.empty()) options.request = rgbd::Request{};
  auto perception = rgbd::Perception::make(rgbd::object_annotators(knowledge), std::move(options), problem);
  if (!perception) session.error(problem);
  return perception;
}

void count_failures(Session& session, const rgbd::Perceived& perceived, std::uint64_t frame, PerceiveTally& tally) {
  for (const rgbd::AnnotatorRun& run : perceived.runs) {
    if (run.problem.empty()) continue;
    std::uint64_t& count = tally.failures[fmt::format("{}: {}", run.annotator, run.problem)];
    if (++count == 1) session.warning(fmt::format("frame {}: {}: {}", frame, run.annotator, run.problem));
  }
}

void tell(const rgbd::Perceived& perceived, const std::optional<rgbd::Request>& request, std::uint64_t frame,
          PerceiveTally& tally) {
  const Scene& scene = perceived.scene;
  tally.things += scene.clusters.size();
  Json entry{{"frame", frame}, {"time", scene.timestamp}, {"scene", scene.id}};
  if (request) {
    const Value answer = rgbd::answer_to(*request, scene);
    tally.answers += answer.list()->size();
    tally.text += fmt::format("frame {}, {:g} s: {} of {} things\n", frame, scene.timestamp, answer.list()->size(),
                              scene.clusters.size());
    for (const Value& designator : *answer.list()) tally.text += json_text(designator) + "\n";
    entry["things"] = scene.clusters.size();
    entry["answers"] = to_json(answer);
  }
  entry["reaching"] = perceived.reaching;
  tally.scenes.push_back(std::move(entry));
}

std::string times_text(const rgbd::RunTimes& times) {
  Table table({{"annotator", Align::kLeft},
               {"runs", Align::kRight},
               {"failed", Align::kRight},
               {"mean ms", Align::kRight},
               {"std ms", Align::kRight}});
  const auto add_row = [&](const rgbd::RunTimes::Row& row) {
    table.add_row({row.annotator, std::to_string(row.runs), std::to_string(row.failures),
                   fmt::format("{:.1f}", row.mean), fmt::format("{:.1f}", row.deviation)});
  };
  for (const rgbd::RunTimes::Row& row : times.rows()) add_row(row);
  table.add_gap();
  add_row(times.total());
  return "\n" + table.text();
}

Json times_json(const rgbd::RunTimes& times) {
  const auto entry = [](const rgbd::RunTimes::Row& row) {
    return Json{{"annotator", row.annotator},
                {"runs", row.runs},
                {"failed", row.failures},
                {"mean", row.mean},
                {"std", row.deviation}};
  };
  Json json{{"unit", "ms"}, {"annotators", Json::array()}};
  for (const rgbd::RunTimes::Row& row : times.rows()) json["annotators"].push_back(entry(row));
  json["total"] = entry(times.total());
  return json;
}

std::string summary(const PerceiveArguments& arguments, const PerceiveTally& tally) {
  std::string text = fmt::format("{} frames", tally.frames);
  if (tally.unreadable > 0) text += fmt::format(", {} could not be read", tally.unreadable);
  if (arguments.query.empty() && arguments.store.empty() && arguments.evidence.empty()) {
    return text + "; nothing was asked for, so no object was looked for\n";
  }
  text += fmt::format(", {} things", tally.things);
  if (!arguments.store.empty()) {
    text += fmt::format("; {} scenes stored", tally.stored);
    if (tally.moving > 0) text += fmt::format(", {} left out while something reached over the table", tally.moving);
  }
  return text + "\n";
}

// The frames one by one; what the store takes is committed by the caller.
Termination perceive_frames(Session& session, const PerceiveArguments& arguments, const rgbd::FrameSource& source,
                            rgbd::Perception& perception, const std::optional<EvidenceMapping>& mapping,
                            SceneStore* store, PerceiveTally& tally, std::string& failure) {
  std::optional<rgbd::Request> request;
  std::string problem;
  if (!arguments.query.empty()) request = rgbd::parse_request(arguments.query, problem);
  const std::uint64_t end = arguments.last < source.frames ? arguments.last + 1 : source.frames;
  for (std::uint64_t index = arguments.first; index < end; index += arguments.every) {
    session.monitor().progress("frames", static_cast<double>(index), static_cast<double>(end));
    if (session.monitor().interrupted()) return Termination::kInterrupted;
    if (session.seconds_left() <= 0) return Termination::kTimeLimit;
    const auto frame = source.read(index, problem);
    if (!frame) {
      ++tally.unreadable;
      session.warning(fmt::format("frame {}: {}", index, problem));
      continue;
    }
    ++tally.frames;
    rgbd::Perceived perceived = perception.perceive(*frame, source.calibration, index);
    if (arguments.labels) rgbd::add_labels(perceived, source.truth(index));
    count_failures(session, perceived, index, tally);
    tell(perceived, request, index, tally);
    if (mapping) {
      tally.evidence += (tally.evidence.empty() ? "" : "---\n") + evidence_text(observe(*mapping, perceived.scene));
    }
    if (store == nullptr) continue;
    const bool has_failed = std::ranges::any_of(perceived.runs, [](const auto& run) { return !run.problem.empty(); });
    if (perceived.reaching > 0 && !arguments.moving) {
      ++tally.moving;
    } else if (!has_failed) {
      const auto added = store->add(perceived.scene, arguments.replace);
      if (added == SceneStore::Added::kDuplicate) {
        failure = fmt::format("the store has a scene '{}'; --replace replaces it, --prefix gives other names",
                              perceived.scene.id);
      } else if (added == SceneStore::Added::kFailed) {
        failure = store->problem();
      }
      if (!failure.empty()) return Termination::kRefused;
      ++tally.stored;
    }
  }
  return Termination::kCompleted;
}

Json perceive_json(const PerceiveArguments& arguments, const rgbd::FrameSource& source,
                   const rgbd::Perception& perception, const PerceiveTally& tally, Termination termination) {
  Json json{{"schema", "sherlog.perceive/1"}, {"termination", to_string(termination)},
            {"source", source.name},          {"annotators", perception.annotators()},
            {"frames", tally.frames},         {"unreadable", tally.unreadable},
            {"things", tally.things}};
  if (!arguments.query.empty()) json["answers"] = tally.answers;
  if (!arguments.store.empty()) json["stored"] = tally.stored, json["left_out"] = tally.moving;
  json["problems"] = Json::array();
  for (const auto& [text, frames] : tally.failures) json["problems"].push_back({{"message", text}, {"frames", frames}});
  json["scenes"] = tally.scenes;
  if (arguments.times) json["times"] = times_json(perception.times());
  return json;
}

int record_frames(Session& session, const PerceiveArguments& arguments, const rgbd::FrameSource& source) {
  rgbd::SequenceWriter writer(arguments.record, source.calibration);
  std::uint64_t frames = 0;
  const std::uint64_t end = arguments.last < source.frames ? arguments.last + 1 : source.frames;
  for (std::uint64_t index = arguments.first; index < end; index += arguments.every) {
    if (session.monitor().interrupted()) return session.error("interrupted"), kInterruptedExit;
    std::string problem;
    const auto frame = source.read(index, problem);
    if (!frame) return session.error(fmt::format("frame {}: {}", index, problem)), kBadInput;
    if (!writer.add(*frame)) return session.error(writer.problem()), kBadInput;
    ++frames;
  }
  if (!writer.finish()) return session.error(writer.problem()), kBadInput;
  return session.finish(kDone, fmt::format("{} frames recorded\n", frames), [&] {
    return to_text(Json{{"schema", "sherlog.perceive/1"},
                        {"termination", to_string(Termination::kCompleted)},
                        {"source", source.name},
                        {"recorded", frames}});
  });
}

int run_perceive(Options options, const PerceiveArguments& arguments) {
  Session session(std::move(options));
  std::vector<std::string> outputs;
  if (!arguments.evidence.empty() && arguments.evidence != "-") outputs.push_back(arguments.evidence);
  if (!session.check_options(outputs)) return kBadInput;
  std::string problem;
  auto source = rgbd::open_frames(arguments.frames, session.options().seed, problem);
  if (!source) return session.error(problem), kBadInput;
  if (arguments.first >= source->frames) {
    return session.error(fmt::format("--first: there are {} frames, numbered from 0", source->frames)), kBadInput;
  }
  if (arguments.labels && !source->truth) {
    return session.error("--labels: only of synthetic frames is it known what they show"), kBadInput;
  }
  if (source->unpaired > 0) session.warning(fmt::format("{} depth images have no colour image", source->unpaired));
  if (!arguments.record.empty()) return record_frames(session, arguments, *source);
  if (!read_knowledge(session, "--map", arguments.map, rgbd::parse_map, source->knowledge.map) ||
      !read_knowledge(session, "--known", arguments.known, rgbd::parse_known_things, source->knowledge.things)) {
    return kBadInput;
  }
  auto perception = make_perception(session, arguments, source->knowledge, source->name);
  if (!perception) return kBadInput;
  std::optional<EvidenceMapping> mapping;
  if (!arguments.evidence.empty() && !(mapping = read_mapping(session, arguments.mapping))) return kBadInput;
  std::optional<SceneStore> store;
  if (!arguments.store.empty()) {
    StoreChoice choice;
    choice.path = arguments.store;
    store = open_store(session, choice, {});
    if (!store) return kBadInput;
    if (!store->begin()) return session.error(store->problem()), kBadInput;
  }
  PerceiveTally tally;
  std::string failure;
  const Termination termination =
      perceive_frames(session, arguments, *source, *perception, mapping, store ? &*store : nullptr, tally, failure);
  if (store && (termination == Termination::kRefused || !store->commit())) {
    if (failure.empty()) failure = store->problem();
    store->roll_back();
    return session.error(failure), kBadInput;
  }
  if (tally.frames == 0 && termination == Termination::kCompleted) {
    return session.error("no frame could be read"), kBadInput;
  }
  if (!outputs.empty()) {
    if (const auto trouble = write_file(arguments.evidence, tally.evidence))
      return session.error(*trouble), kInternalError;
  }
  std::string text = tally.text + (arguments.evidence == "-" ? tally.evidence : summary(arguments, tally));
  if (arguments.times) text += times_text(perception->times());
  return session.finish(exit_code(termination), text,
                        [&] { return to_text(perceive_json(arguments, *source, *perception, tally, termination)); });
}

}  // namespace

void add_perceive(CLI::App& app, Action& action) {
  auto options = std::make_shared<Options>();
  auto arguments = std::make_shared<PerceiveArguments>();
  CLI::App* command = app.add_subcommand("perceive", "Things on tables in depth and colour frames: answers and scenes");
  command
      ->add_option("FRAMES", arguments->frames,
                   "A recording's folder (docs/perception.md), or synthetic:NAME such as synthetic:table_moves")
      ->required()
      ->type_name("");
  command
      ->add_option("--query", arguments->query,
                   "Answer this in every frame, e.g. '{\"detect\": {\"shape\": \"box\"}}'; only what it needs runs")
      ->type_name("JSON");
  command->add_option("--store", arguments->store, "Everything about every frame, as scenes for 'track resolve'")
      ->type_name("FILE");
  command->add_flag("--replace", arguments->replace, "A scene whose id the store has takes its place");
  command->add_flag("--moving", arguments->moving, "Store scenes too while something reaches over the table");
  command->add_flag("--labels", arguments->labels, "Of synthetic frames: which object each thing is, for training");
  command
      ->add_option("--prefix", arguments->prefix, "Scenes are called so and by number (default: the recording's name)")
      ->type_name("TEXT");
  command->add_option("--evidence", arguments->evidence, "Each frame's evidence for a model, --- between frames")
      ->type_name("FILE|-");
  command
      ->add_option("--mapping", arguments->mapping,
                   "What becomes evidence: a shipped mapping or a JSON file (default robosherlock)")
      ->type_name("NAME|FILE");
  command->add_option("--map", arguments->map, "Names of tables and counters: JSON")->type_name("FILE");
  command->add_option("--known", arguments->known, "Things that there may be, for their classes: JSON")
      ->type_name("FILE");
  command->add_option("--every", arguments->every, "Take every Nth frame (default 10)")
      ->type_name("N")
      ->check(CLI::Range(std::uint64_t{1}, std::uint64_t{1'000'000}).description(""));
  command->add_option("--first", arguments->first, "From this frame on (default 0)")->type_name("N");
  command->add_option("--last", arguments->last, "Up to this frame (default: the last)")->type_name("N");
  command->add_flag("--times", arguments->times, "How long each annotator took: mean and standard deviation");
  command->add_option("--record", arguments->record, "Only write the frames into this folder, as a recording")
      ->type_name("FOLDER");
  add_common_options(*command, *options);
  command->callback(
      [options, arguments, &action] { action = [options, arguments] { return run_perceive(*options, *arguments); }; });
}

}  // namespace sherlog::cli
