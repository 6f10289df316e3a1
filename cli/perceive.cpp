// sherlog perceive: depth and colour frames to scenes, and answers to requests. Only where the RGB-D front end is
// built.
#include "cli/perceive.h"

#include <fmt/format.h>

#include <filesystem>
#include <map>
#include <memory>
#include <new>

#include "cli/output.h"
#include "cli/scenes.h"
#include "cli/table.h"
#include "mln/parser.h"
#include "perception_bridge/observe.h"
#include "perception_bridge/scene_tracker.h"
#include "perception_bridge/shipped_models.h"
#include "rgbd/pipeline/frame_source.h"
#include "rgbd/pipeline/perception.h"
#include "rgbd/pipeline/recorder.h"
#include "rgbd/pipeline/truth.h"

namespace sherlog::cli {
namespace {

// What has been found in all frames so far.
struct PerceiveTally {
  std::uint64_t frames = 0, unreadable = 0, stored = 0, moving = 0, things = 0, answers = 0, people = 0, crowded = 0;
  std::map<std::string, std::uint64_t> failures;  // "annotator: problem", frames
  Json scenes = Json::array();
  std::string text, evidence;
};

// Numbers without a sign are read modulo 2^64.
CLI::Validator not_negative() {
  return {[](std::string& text) { return text.starts_with('-') ? fmt::format("{} is negative", text) : ""; }, ""};
}

// The frames that are asked for, one after the other, until something ends it. `visit` gets what could be read.
template <class Visit>
Termination for_each_frame(Session& session, const PerceiveArguments& arguments, const rgbd::FrameSource& source,
                           std::uint64_t& unreadable, const Visit& visit) {
  const std::uint64_t end = arguments.last < source.frames ? arguments.last + 1 : source.frames;
  for (std::uint64_t index = arguments.first; index < end; index += arguments.step()) {
    session.monitor().progress("frames", static_cast<double>(index), static_cast<double>(end));
    if (session.monitor().interrupted()) return Termination::kInterrupted;
    if (session.seconds_left() <= 0) return Termination::kTimeLimit;
    try {
      std::string problem;
      const auto frame = source.read(index, problem);
      if (!frame) {
        ++unreadable;
        session.warning(fmt::format("frame {}: {}", index, problem));
        continue;
      }
      const Termination termination = visit(*frame, index);
      if (termination != Termination::kCompleted) return termination;
    } catch (const std::bad_alloc&) {
      return Termination::kMemoryLimit;
    } catch (const cv::Exception& error) {
      if (error.code == cv::Error::StsNoMem) return Termination::kMemoryLimit;
      throw;
    }
  }
  return Termination::kCompleted;
}

void count_failures(Session& session, const rgbd::Perceived& perceived, std::uint64_t frame, PerceiveTally& tally) {
  for (const rgbd::AnnotatorRun& run : perceived.runs) {
    if (run.problem.empty()) continue;
    std::uint64_t& count = tally.failures[fmt::format("{}: {}", run.annotator, run.problem)];
    if (++count == 1) session.warning(fmt::format("frame {}: {}: {}", frame, run.annotator, run.problem));
  }
}

// For requests that follow things: who is who from scene to scene, by the shipped model.
std::optional<SceneTracker> thing_tracker(Session& session) {
  Diagnostics diagnostics;
  std::string problem;
  auto model = parse_model(scenes_identity_model(), "scenes.mln", diagnostics);
  auto tracker =
      SceneTracker::make(std::move(*model), *shipped_mapping("perception"), session.inference_options(), {}, problem);
  if (!tracker) session.error(problem);
  return tracker;
}

// The id that each thing keeps, as an annotation of its cluster.
void add_tracks(Session& session, SceneTracker& tracker, Scene& scene) {
  const TrackingStep step = tracker.feed(scene, session.monitor());
  if (step.termination != Termination::kCompleted) {
    session.warning(fmt::format("{}: {}", scene.id, step.message));
    return;
  }
  for (std::size_t i = 0; i < step.clusters.size(); ++i) {
    const TrackingStep::ClusterBelief& belief = step.clusters[i];
    scene.clusters[i].annotations.push_back(rgbd::make_annotation(
        "rs.annotation.Tracking", "ObjectIdentityResolution",
        {{"trackingID", Value(belief.object)}, {"tracker", Value(belief.explanation)}}, belief.probability));
  }
}

// A line for each person, as it is in the scene; and whether there were more than can be followed.
void tell_people(const Scene& scene, std::uint64_t frame, Json& entry, PerceiveTally& tally) {
  const auto people = annotations_of(scene.annotations, "sherlog.annotation.Person");
  tally.people += people.size();
  tally.text += fmt::format("frame {}, {:.3f} s: {} people", frame, scene.timestamp, people.size());
  for (const Annotation* crowd : annotations_of(scene.annotations, "sherlog.annotation.Crowd")) {
    const Value fields(crowd->fields);
    tally.text += fmt::format(", more than can be followed: {}", json_text(fields));
    entry["crowd"] = to_json(fields);
    ++tally.crowded;
  }
  tally.text += "\n";
  entry["people"] = Json::array();
  for (const Annotation* person : people) {
    const Value fields(person->fields);
    tally.text += json_text(fields) + "\n";
    entry["people"].push_back(to_json(fields));
  }
}

void tell(const rgbd::Perceived& perceived, const std::optional<rgbd::Request>& request, bool wants_people,
          std::uint64_t frame, PerceiveTally& tally) {
  const Scene& scene = perceived.scene;
  tally.things += scene.clusters.size();
  Json entry{{"frame", frame}, {"time", scene.timestamp}, {"scene", scene.id}};
  if (request) {
    const Value answer = rgbd::answer_to(*request, scene);
    tally.answers += answer.list()->size();
    tally.text += fmt::format("frame {}, {:.3f} s: {} of {} things\n", frame, scene.timestamp, answer.list()->size(),
                              scene.clusters.size());
    for (const Value& designator : *answer.list()) tally.text += json_text(designator) + "\n";
    entry["things"] = scene.clusters.size();
    entry["answers"] = to_json(answer);
  }
  if (wants_people) tell_people(scene, frame, entry, tally);
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
  if (arguments.people) text += fmt::format(", {} sightings of people", tally.people);
  if (tally.crowded > 0)
    text +=
        fmt::format(", {} frames with more people or parts of people than {}", tally.crowded, arguments.most_people);
  if (!arguments.wants_things()) {
    if (arguments.people) return text + "\n";
    return text + "; nothing was asked for, so no object was looked for\n";
  }
  text += fmt::format(", {} things", tally.things);
  if (!arguments.store.empty()) {
    text += fmt::format("; {} scenes stored", tally.stored);
    if (tally.moving > 0) text += fmt::format(", {} left out while something reached over the table", tally.moving);
  }
  return text + "\n";
}

// False, and why: the store does not take the scene.
bool keep_scene(const rgbd::Perceived& perceived, const PerceiveArguments& arguments, SceneStore& store,
                PerceiveTally& tally, std::string& failure) {
  if (perceived.reaching > 0 && !arguments.moving) return ++tally.moving, true;
  if (std::ranges::any_of(perceived.runs, [](const auto& run) { return !run.problem.empty(); })) return true;
  const auto added = store.add(perceived.scene, arguments.replace);
  if (added == SceneStore::Added::kDuplicate) {
    failure = fmt::format("the store has a scene '{}'; --replace replaces it, --prefix gives other names",
                          perceived.scene.id);
  } else if (added == SceneStore::Added::kFailed) {
    failure = store.problem();
  }
  tally.stored += failure.empty() ? 1U : 0U;
  return failure.empty();
}

// The frames one by one; what the store takes is committed by the caller.
Termination perceive_frames(Session& session, const PerceiveArguments& arguments, const rgbd::FrameSource& source,
                            rgbd::Perception& perception, const std::optional<rgbd::Request>& request,
                            const std::optional<EvidenceMapping>& mapping, StoreTarget& target, PerceiveTally& tally,
                            std::string& failure) {
  std::optional<SceneTracker> tracker;
  if (request && request->verb == rgbd::Request::Verb::kTrack && !(tracker = thing_tracker(session)))
    return Termination::kRefused;
  return for_each_frame(
      session, arguments, source, tally.unreadable, [&](const rgbd::Frame& frame, std::uint64_t index) {
        if (target.is_wanted() && !target.open()) return Termination::kRefused;
        rgbd::Perceived perceived = perception.perceive(frame, source.calibration, index, source.bodies_at(index));
        ++tally.frames;
        if (arguments.labels) rgbd::add_labels(perceived, source.truth(index));
        count_failures(session, perceived, index, tally);
        if (tracker && perceived.reaching == 0) add_tracks(session, *tracker, perceived.scene);
        const std::uint64_t crowded = tally.crowded;
        tell(perceived, request, arguments.people, index, tally);
        if (crowded == 0 && tally.crowded > 0) {
          session.warning(fmt::format(
              "frame {}: there are more people, or parts of people, than {}: some have no label or another one's; "
              "--most-people N allows more",
              index, arguments.most_people));
        }
        if (mapping) {
          tally.evidence += (tally.evidence.empty() ? "" : "---\n") + evidence_text(observe(*mapping, perceived.scene));
        }
        const bool is_kept = !target.is_wanted() || keep_scene(perceived, arguments, target.store(), tally, failure);
        return is_kept ? Termination::kCompleted : Termination::kRefused;
      });
}

Json perceive_json(const PerceiveArguments& arguments, const rgbd::FrameSource& source,
                   const rgbd::Perception& perception, const PerceiveTally& tally, Termination termination) {
  Json json{{"schema", "sherlog.perceive/1"}, {"termination", to_string(termination)},
            {"source", source.name},          {"annotators", perception.annotators()},
            {"frames", tally.frames},         {"unreadable", tally.unreadable},
            {"things", tally.things}};
  if (!arguments.query.empty()) json["answers"] = tally.answers;
  if (arguments.people) json["people"] = tally.people, json["crowded"] = tally.crowded;
  if (!arguments.store.empty()) json["stored"] = tally.stored, json["left_out"] = tally.moving;
  json["problems"] = Json::array();
  for (const auto& [text, frames] : tally.failures) json["problems"].push_back({{"message", text}, {"frames", frames}});
  json["scenes"] = tally.scenes;
  if (arguments.times) json["times"] = times_json(perception.times());
  return json;
}

std::string ending(Termination termination) {
  return termination == Termination::kCompleted ? "" : fmt::format("ended early: {}\n", to_string(termination));
}

int record_frames(Session& session, const PerceiveArguments& arguments, const rgbd::FrameSource& source) {
  rgbd::Recorder writer(arguments.record, source);
  std::uint64_t frames = 0, unreadable = 0;
  const Termination termination =
      for_each_frame(session, arguments, source, unreadable, [&](const rgbd::Frame& frame, std::uint64_t index) {
        if (!writer.add(frame, index)) return Termination::kRefused;
        ++frames;
        return Termination::kCompleted;
      });
  if (termination == Termination::kRefused || (frames > 0 && !writer.finish()))
    return session.error(writer.problem()), kBadInput;
  if (frames == 0 && termination == Termination::kCompleted) return session.error("no frame could be read"), kBadInput;
  std::string text = fmt::format("{}{} frames recorded", ending(termination), frames);
  if (unreadable > 0) text += fmt::format(", {} could not be read", unreadable);
  return session.finish(exit_code(termination), text + "\n", [&] {
    return to_text(Json{{"schema", "sherlog.perceive/1"},
                        {"termination", to_string(termination)},
                        {"source", source.name},
                        {"unreadable", unreadable},
                        {"recorded", frames}});
  });
}

// A recording's own files are read; what is written must not take their place.
bool spares_recording(Session& session, const PerceiveArguments& arguments, const std::vector<std::string>& outputs) {
  namespace fs = std::filesystem;
  std::error_code error;
  if (!arguments.record.empty()) {
    for (const char* list : {"frames.txt", "depth.txt", "associations.txt", "robot.txt", "map.json", "known.json",
                             "calibration.txt", "rgb.txt", "groundtruth.txt", "depth", "colour", "rgb"}) {
      if (!fs::exists(fs::symlink_status(fs::path(arguments.record) / list, error))) continue;
      session.error(
          fmt::format("--record: '{}' has a recording, which would be lost; name another folder", arguments.record));
      return false;
    }
  }
  const fs::path folder = fs::weakly_canonical(arguments.frames, error);
  if (error || !fs::is_directory(folder, error)) return true;
  for (const std::string& output : outputs) {
    const fs::path file = fs::weakly_canonical(output, error);
    const bool is_inside = std::mismatch(folder.begin(), folder.end(), file.begin(), file.end()).first == folder.end();
    if (output == "-" || error || !is_inside || !fs::exists(file, error)) continue;
    session.error(fmt::format("'{}' is a file of the recording: a result would take its place", output));
    return false;
  }
  return true;
}

int perceive(Session& session, const PerceiveArguments& arguments) {
  if (arguments.plan) return plan_perception(session, arguments);
  std::vector<std::string> outputs, inputs = {arguments.mapping, arguments.store};
  if (!add_inputs(session, arguments, inputs)) return kBadInput;
  if (!arguments.evidence.empty()) outputs.push_back(arguments.evidence);
  if (!session.check_options(outputs, inputs)) return kBadInput;
  if (session.wants_json()) outputs.push_back(session.options().json);
  if (!spares_recording(session, arguments, outputs)) return kBadInput;
  if (!arguments.record.empty() && !(arguments.map.empty() && arguments.known.empty())) {
    return session.error("--record takes what FRAMES brings with it: copy the files of --map and --known yourself"),
           kBadInput;
  }
  cv::setNumThreads(1);  // annotators run side by side
  std::string problem;
  auto source = rgbd::open_frames(arguments.frames, session.options().seed, problem);
  if (!source) return session.error(problem), kBadInput;
  if (arguments.first >= source->frames) {
    return session.error(fmt::format("--first: there are {} frames, numbered from 0", source->frames)), kBadInput;
  }
  if (arguments.last < arguments.first) return session.error("--last comes before --first"), kBadInput;
  if (arguments.labels && !source->truth) {
    return session.error("--labels: only of synthetic frames is it known what they show"), kBadInput;
  }
  if (source->poses_missed) {
    session.warning("no pose in groundtruth.txt is near in time to a frame: things are placed in the camera's frame");
  }
  if (source->unpaired > 0) session.warning(fmt::format("{} depth images have no colour image", source->unpaired));
  if (!arguments.record.empty()) return record_frames(session, arguments, *source);
  if (!read_knowledge(session, arguments, source->knowledge)) return kBadInput;
  std::optional<rgbd::Request> request;
  if (!read_request(session, arguments, request)) return kBadInput;
  auto perception = make_perception(session, arguments, source->knowledge, source->name, request);
  if (!perception) return kBadInput;
  std::optional<EvidenceMapping> mapping;
  if (!arguments.evidence.empty() && !(mapping = read_mapping(session, arguments.mapping))) return kBadInput;
  StoreTarget target(session, arguments.store);
  if (!target.open_if_there()) return kBadInput;
  PerceiveTally tally;
  std::string failure;
  const Termination termination =
      perceive_frames(session, arguments, *source, *perception, request, mapping, target, tally, failure);
  if (termination == Termination::kRefused && !target.is_open()) return kBadInput;  // said why
  if (target.is_open() && (termination == Termination::kRefused || !target.store().commit())) {
    if (failure.empty()) failure = target.store().problem();
    target.store().roll_back();
    return session.error(failure), kBadInput;
  }
  if (tally.frames == 0 && termination == Termination::kCompleted) {
    return session.error("no frame could be read"), kBadInput;
  }
  if (!arguments.evidence.empty() && arguments.evidence != "-") {
    if (const auto trouble = write_file(arguments.evidence, tally.evidence))
      return session.error(*trouble), kInternalError;
  }
  std::string text =
      tally.text + ending(termination) + (arguments.evidence == "-" ? tally.evidence : summary(arguments, tally));
  if (arguments.times) text += times_text(perception->times());
  return session.finish(exit_code(termination), text,
                        [&] { return to_text(perceive_json(arguments, *source, *perception, tally, termination)); });
}

int run_perceive(Options options, const PerceiveArguments& arguments) {
  Session session(std::move(options));
  return session.run("sherlog.perceive/1", [&] { return perceive(session, arguments); });
}

}  // namespace

void add_perceive(CLI::App& app, Action& action) {
  auto options = std::make_shared<Options>();
  auto arguments = std::make_shared<PerceiveArguments>();
  CLI::App* command = app.add_subcommand("perceive", "Things on tables in depth and colour frames: answers and scenes");
  CLI::Option* frames =
      command
          ->add_option("FRAMES", arguments->frames,
                       "A recording's folder (docs/perception.md), or synthetic:NAME such as synthetic:table_moves")
          ->type_name("");
  CLI::Option* query =
      command
          ->add_option("--query", arguments->query,
                       "Answer this in every frame, e.g. '{\"detect\": {\"shape\": \"box\"}}'; only what it needs runs")
          ->type_name("JSON")
          ->check(CLI::Validator([](std::string& text) { return text.empty() ? "it is empty" : ""; }, ""));
  command
      ->add_option("--keys", arguments->keys,
                   "The keys of requests, as RoboSherlock's query_specifications.ini has them")
      ->type_name("FILE")
      ->needs(query);
  CLI::Option* store =
      command->add_option("--store", arguments->store, "Everything about every frame, as scenes for 'track resolve'")
          ->type_name("FILE");
  command->add_flag("--replace", arguments->replace, "A scene whose id the store has takes its place")->needs(store);
  command->add_flag("--moving", arguments->moving, "Store scenes too while something reaches over the table")
      ->needs(store);
  CLI::Option* people =
      command->add_flag("--people", arguments->people, "Who is there: labels that last, places and postures");
  command
      ->add_option("--most-people", arguments->most_people,
                   "How many people and parts of people are told apart in a frame (default 15)")
      ->type_name("N")
      ->check(CLI::Range(std::uint64_t{1}, std::uint64_t{1000}).description(""))
      ->needs(people);
  CLI::Option* labels =
      command->add_flag("--labels", arguments->labels, "Of synthetic frames: which object each thing is, for training");
  CLI::Option* prefix = command
                            ->add_option("--prefix", arguments->prefix,
                                         "Scenes are called so and by number (default: the recording's name)")
                            ->type_name("TEXT");
  CLI::Option* evidence =
      command->add_option("--evidence", arguments->evidence, "Each frame's evidence for a model, --- between frames")
          ->type_name("FILE|-");
  command
      ->add_option("--mapping", arguments->mapping,
                   "What becomes evidence: a shipped mapping or a JSON file (default robosherlock)")
      ->type_name("NAME|FILE")
      ->needs(evidence);
  CLI::Option* map =
      command->add_option("--map", arguments->map, "Names of tables and counters: JSON")->type_name("FILE");
  CLI::Option* known =
      command->add_option("--known", arguments->known, "Things that there may be, for their classes: JSON")
          ->type_name("FILE");
  CLI::Option* every =
      command->add_option("--every", arguments->every, "Take every Nth frame (default 10; with --people 1)")
          ->type_name("N")
          ->check(CLI::Range(std::uint64_t{1}, std::uint64_t{1'000'000}).description(""));
  CLI::Option* first = command->add_option("--first", arguments->first, "From this frame on (default 0)")
                           ->type_name("N")
                           ->check(not_negative());
  CLI::Option* last = command->add_option("--last", arguments->last, "Up to this frame (default: the last)")
                          ->type_name("N")
                          ->check(not_negative());
  CLI::Option* flow =
      command
          ->add_option("--flow", arguments->flow,
                       "These annotators in this order, whatever is asked for; or the fixed flow of an analysis engine")
          ->type_name("NAME,..|FILE.yaml")
          ->allow_extra_args(false)
          ->delimiter(',');
  CLI::Option* times =
      command->add_flag("--times", arguments->times, "How long each annotator took: mean and standard deviation");
  CLI::Option* record =
      command->add_option("--record", arguments->record, "Only write the frames into this folder, as a recording")
          ->type_name("FOLDER");
  for (CLI::Option* other : {query, store, evidence, labels, people, prefix, times, flow}) record->excludes(other);
  CLI::Option* plan =
      command->add_flag("--plan", arguments->plan, "Only say which annotators would run, and in which order");
  for (CLI::Option* other : {frames, store, evidence, labels, record, every, first, last, prefix, times}) {
    plan->excludes(other);
  }
  CLI::Option* annotators =
      command
          ->add_option("--annotators", arguments->annotators,
                       "Plan with these instead: RoboSherlock's .yaml files of annotators, and folders of them")
          ->type_name("PATH,..")
          ->allow_extra_args(false)
          ->delimiter(',')
          ->needs(plan);
  for (CLI::Option* other : {map, known, people}) annotators->excludes(other);
  add_common_options(*command, *options);
  command->callback([options, arguments, &action] {
    if (arguments->frames.empty() && !arguments->plan) throw CLI::RequiredError("FRAMES");
    action = [options, arguments] { return run_perceive(*options, *arguments); };
  });
}

}  // namespace sherlog::cli
