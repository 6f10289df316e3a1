// sherlog track resolve: who is who in the scenes of a store; the belief goes back into it.
#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <memory>

#include "cli/scenes.h"
#include "cli/table.h"
#include "cli/track_commands.h"
#include "mln/parser.h"
#include "mln/text_file.h"
#include "perception_bridge/scene_tracker.h"
#include "perception_bridge/shipped_models.h"

namespace sherlog::cli {
namespace {

struct Resolving {
  StoreChoice store;
  std::string model = "paper";
  std::string mapping = "identity";
  TrackerOptions tracker;
  bool dry_run = false, restart = false;
  bool arbiter = false;
  ArbiterOptions arbiter_options;
};

constexpr const char* kBelief = "identity";       // of each scene
constexpr const char* kState = "identity_state";  // of the last one: what the next run needs to go on

// The objects of an earlier run, so that this one goes on from there. False after saying what is wrong.
bool resume(Session& session, SceneStore& store, const std::optional<StoredBelief>& state, SceneTracker& tracker) {
  std::map<std::string, std::optional<Scene>> scenes;  // many objects were seen last in the same ones
  for (const std::string& id : store.identities()) {
    auto identity = store.identity(id);
    if (!identity || identity->sightings.empty()) continue;
    const Sighting last = identity->sightings.back();
    const auto known = scenes.find(last.scene);
    const auto& scene =
        known != scenes.end() ? known->second : scenes.emplace(last.scene, store.scene(last.scene)).first->second;
    if (!scene) continue;
    for (const Cluster& cluster : scene->clusters) {
      if (cluster.id == last.cluster) tracker.resume(std::move(*identity), cluster, scene->timestamp);
      if (cluster.id == last.cluster) break;
    }
  }
  std::string problem = store.problem();
  if (!problem.empty()) return session.error(problem), false;
  if (!state || tracker.restore(state->document, problem)) return true;
  session.error(fmt::format("{}; --restart begins again", problem));
  return false;
}

Json step_json(const TrackingStep& step) {
  Json json = to_json(step_to_json(step));
  json["scene"] = step.scene;
  json["seconds"] = step.seconds;
  return json;
}

std::string probability_text(const std::optional<double>& probability) {
  return probability ? fmt::format("{:.3f}", *probability) : "";
}

void add_step(Table& table, const TrackingStep& step) {
  std::string scene = step.scene;
  for (const TrackingStep::ClusterBelief& entry : step.clusters) {
    std::string others;
    for (const auto& other : entry.others)
      others += fmt::format("{}{} {:.3f}", others.empty() ? "" : ", ", other.object, other.probability);
    table.add_row({scene, entry.cluster, entry.object, entry.explanation, probability_text(entry.probability), others});
    scene.clear();
  }
  for (const auto& revision : step.revisions) {
    table.add_row({scene, "", revision.is, "instead", probability_text(revision.probability),
                   fmt::format("of {} for {} in {}", revision.was, revision.cluster, revision.scene)});
    scene.clear();
  }
  for (const std::string& object : step.disappeared) table.add_row({scene, "", object, "disappear"}), scene.clear();
  for (const std::string& object : step.hidden) table.add_row({scene, "", object, "hidden"}), scene.clear();
  table.add_gap();
}

std::string arbiter_text(const ArbiterCounts& counts) {
  return fmt::format(
      "the model was asked in {} of them ({:.1f} %): {} with trackers that contradict each other, {} unsure\n",
      counts.calls(), 100 * counts.share_of_calls(), counts.contradicted, counts.unsure);
}

Json resolve_json(const SceneTracker& tracker, Termination termination, const Json& steps, std::uint64_t late) {
  Json json{{"schema", "sherlog.track.resolve/1"},
            {"termination", to_string(termination)},
            {"objects", Json::array()},
            {"steps", steps},
            {"open_questions", tracker.open_questions().size()},
            {"left_out", late}};
  if (const auto counts = tracker.arbiter_counts()) {
    json["arbiter"] = {{"scenes", counts->scenes},
                       {"contradicted", counts->contradicted},
                       {"unsure", counts->unsure},
                       {"calls", counts->calls()},
                       {"share_of_calls", counts->share_of_calls()}};
  }
  for (const TrackedObject& object : tracker.objects()) {
    json["objects"].push_back({{"id", object.identity.id},
                               {"lastSeen", object.identity.last_seen},
                               {"wasSeen", object.identity.was_seen},
                               {"inView", object.identity.in_view},
                               {"disappeared", object.identity.disappeared},
                               {"sightings", object.identity.sightings.size()}});
  }
  return json;
}

bool are_equal(const Identity& a, const Identity& b) {
  const auto same = [](const Sighting& x, const Sighting& y) {
    return x.scene == y.scene && x.cluster == y.cluster && x.probability == y.probability &&
           x.explanation == y.explanation;
  };
  return a.last_seen == b.last_seen && a.was_seen == b.was_seen && a.in_view == b.in_view &&
         a.disappeared == b.disappeared && std::ranges::equal(a.sightings, b.sightings, same);
}

// Those of the run before, which --restart takes away; what people named stays.
bool was_named_here(const std::string& id) { return id.starts_with(TrackerOptions{}.prefix); }

// What goes into the store: in batches, so that little is lost where the program is killed. Not on top of what could not be
// read, nor over what another program has found out since.
class Keeper {
 public:
  // `state`: the one that this run goes on from, or replaces.
  Keeper(SceneStore& store, const Resolving& resolving, std::optional<StoredBelief> state)
      : store_(store), resolving_(resolving), state_(std::move(state)) {}

  // What the store has already.
  void know(const SceneTracker& tracker) {
    for (const TrackedObject& object : tracker.objects()) stored_[object.identity.id] = object.identity;
  }
  void add(StoredBelief belief) { beliefs_.push_back(std::move(belief)); }
  bool is_full() const { return beliefs_.size() >= kBatch; }

  // What is believed now, and what was found out on the way. False where the store could not be written.
  bool keep(const SceneTracker& tracker) {
    problem_ = store_.problem();
    if (!problem_.empty()) return false;
    if (resolving_.dry_run || beliefs_.empty()) return true;
    bool good = store_.begin();
    if (good && !is_as_it_was()) {
      store_.roll_back();
      problem_ =
          "another program has resolved scenes of the store since this one read it; what is not stored yet "
          "is left out: run it again";
      return false;
    }
    if (resolving_.restart && !cleared_) {
      for (const std::string& id : store_.identities()) {
        if (was_named_here(id)) good = good && store_.remove_identity(id);
      }
      good = good && store_.remove_beliefs(kBelief);
    }
    for (const std::string& id : tracker.removed()) {
      good = good && store_.remove_identity(id);
      stored_.erase(id);
    }
    for (const StoredBelief& belief : beliefs_) good = good && store_.add(belief);
    for (const TrackedObject& object : tracker.objects()) {
      const auto known = stored_.find(object.identity.id);
      if (known != stored_.end() && are_equal(known->second, object.identity)) continue;
      good = good && store_.add(object.identity);
      stored_[object.identity.id] = object.identity;
    }
    good = good && store_.remove_beliefs(kState) &&
           store_.add(StoredBelief{beliefs_.back().scene, kState, tracker.state()});
    if (good) state_ = store_.newest_belief(kState);
    if (!good || !store_.commit()) {
      problem_ = store_.problem();
      store_.roll_back();
      return false;
    }
    cleared_ = true;
    beliefs_.clear();
    return true;
  }
  const std::string& problem() const { return problem_; }

 private:
  static constexpr std::size_t kBatch = 200;  // scenes

  bool is_as_it_was() {
    const auto now = store_.newest_belief(kState);
    if (!now || !state_) return now.has_value() == state_.has_value();
    return now->scene == state_->scene && now->document == state_->document;
  }

  SceneStore& store_;
  const Resolving& resolving_;
  std::optional<StoredBelief> state_;
  bool cleared_ = false;
  std::map<std::string, Identity> stored_;
  std::vector<StoredBelief> beliefs_;
  std::string problem_;
};

// Scenes before the last one of an earlier run that it did not see.
std::uint64_t count_late(SceneStore& store, const SceneFilter& filter, double resumed) {
  std::uint64_t late = 0;
  SceneFilter earlier = filter;
  earlier.to = std::min(filter.to, resumed);
  for (const SceneSummary& scene : store.scenes(earlier)) {
    if (scene.time < resumed && !store.belief(scene.id, kBelief)) ++late;
  }
  return late;
}

// The steps that were new; a step that has no answer ends it.
int resolve_scenes(Session& session, SceneStore& store, SceneTracker& tracker, const Resolving& resolving,
                   Keeper& keeper) {
  auto filter = scene_filter(session, store, resolving.store);
  if (!filter) return kBadInput;
  const auto resumed = tracker.last_time();
  Table table({{"scene", Align::kLeft},
               {"cluster", Align::kLeft},
               {"object", Align::kLeft},
               {"explanation", Align::kLeft},
               {"probability", Align::kRight},
               {"or else", Align::kLeft}});
  Json steps = Json::array();
  std::vector<ConflictItem> conflict;
  Termination termination = Termination::kCompleted;
  keeper.know(tracker);
  std::uint64_t late = 0, done = 0;
  bool is_kept = true;
  if (resumed) {
    late = count_late(store, *filter, *resumed);
    filter->from = std::max(filter->from, *resumed);
  }
  store.for_each_scene(*filter, [&](const Scene& scene) {
    if (resumed && scene.timestamp <= *resumed && store.belief(scene.id, kBelief)) return true;  // of an earlier run
    if (session.monitor().interrupted()) termination = Termination::kInterrupted;
    if (session.seconds_left() <= 0) termination = Termination::kTimeLimit;
    if (termination != Termination::kCompleted) return false;
    const TrackingStep step = tracker.feed(scene, session.monitor());
    termination = step.termination;
    if (termination != Termination::kCompleted) {
      const std::string words = fmt::format("{}: {}", scene.id, step.message);
      if (step.contradiction) conflict = conflict_items(*step.contradiction);
      if (conflict.empty()) {
        session.error(words);
      } else {
        session.print_message(conflict_text(conflict, words));
      }
      if (termination == Termination::kRefused &&
          scene.clusters.size() * tracker.objects().size() > resolving.tracker.most_pairs)
        session.error(
            "--max-pairs raises the limit, --forget leaves out what was not seen for long, --from goes on behind it");
      return false;
    }
    keeper.add({scene.id, kBelief, step_to_json(step)});
    ++done;
    steps.push_back(step_json(step));
    add_step(table, step);
    is_kept = !keeper.is_full() || keeper.keep(tracker);
    return is_kept;
  });
  if (late > 0) {
    session.warning(
        fmt::format("{} scenes are older than the last one of an earlier run and were left out; --restart takes "
                    "them in",
                    late));
  }
  if (!is_kept || !keeper.keep(tracker)) {
    session.error(keeper.problem().empty() ? "the belief could not be stored" : keeper.problem());
    return kBadInput;
  }
  std::string text = fmt::format("{} scenes, {} objects\n", done, tracker.objects().size());
  const auto counts = tracker.arbiter_counts();
  if (counts) text += arbiter_text(*counts);
  text += "\n" + table.text();
  return session.finish(exit_code(termination), text, [&] {
    Json json = resolve_json(tracker, termination, steps, late);
    if (!conflict.empty()) json["conflict"] = conflict_json(conflict);
    return to_text(json);
  });
}

int run_resolve(Options options, const Resolving& resolving) {
  Session session(std::move(options));
  if (!session.check_options()) return kBadInput;
  if (const std::string bad = validate(resolving.arbiter_options); !bad.empty())
    return session.error(fmt::format("--sure: {}", bad)), kBadInput;
  auto model = identity_model(session, resolving.model);
  auto mapping = read_mapping(session, resolving.mapping);
  if (!model || !mapping) return kBadInput;
  auto store = open_store(session, resolving.store, {.read_only = resolving.dry_run, .create = false});
  if (!store) return kBadInput;
  std::string problem;
  auto tracker = SceneTracker::make(std::move(*model), std::move(*mapping), session.inference_options(),
                                    resolving.tracker, problem);
  if (!tracker) return session.error(problem), kBadInput;
  if (resolving.arbiter) tracker->use_arbiter(TrackingArbiter(default_trackers(), resolving.arbiter_options));
  std::vector<std::string> taken = store->identities();
  if (resolving.restart) std::erase_if(taken, was_named_here);
  tracker->avoid(taken);
  const auto state = store->newest_belief(kState);  // before all that must fit to it
  if (!resolving.restart && !resume(session, *store, state, *tracker)) return kBadInput;
  Keeper keeper(*store, resolving, state);
  return resolve_scenes(session, *store, *tracker, resolving, keeper);
}

}  // namespace

std::optional<Model> identity_model(Session& session, const std::string& name) {
  const bool is_shipped = name == "paper" || name == "scenes";
  if (!is_shipped && !session.reads(name)) return std::nullopt;
  auto model = name == "paper"    ? parse_model(paper_identity_model(), "table1.mln", session.diagnostics())
               : name == "scenes" ? parse_model(scenes_identity_model(), "scenes.mln", session.diagnostics())
                                  : parse_model_files({name}, session.diagnostics());
  session.print_diagnostics();
  return model;
}

void add_track_resolve(CLI::App& track, Action& action) {
  auto options = std::make_shared<Options>();
  auto resolving = std::make_shared<Resolving>();
  CLI::App* command =
      track.add_subcommand("resolve", "Who is who in the scenes of a store: goes on where the last run ended");
  add_store_option(*command, resolving->store);
  command
      ->add_option("--model", resolving->model,
                   "paper: Table 1; scenes: with learned weights; or a file with its predicates (default paper)")
      ->type_name("paper|scenes|FILE");
  command
      ->add_option("--mapping", resolving->mapping,
                   "How clusters are compared: a shipped mapping or a JSON file (default identity)")
      ->type_name("identity|perception|FILE");
  command
      ->add_option("--forget", resolving->tracker.forget_seconds,
                   "What was not seen for so long is no candidate (default: never)")
      ->type_name("S")
      ->check(number_within(0, std::numeric_limits<double>::infinity()));
  command
      ->add_option("--max-pairs", resolving->tracker.most_pairs,
                   "Refuse scenes with more pairs of an object and a cluster (default 250000)")
      ->type_name("N")
      ->check(whole_number(1'000'000'000));
  command->add_flag("--dry-run", resolving->dry_run, "Leave the store as it is");
  command->add_flag("--restart", resolving->restart, "From the first scene on, without the objects of earlier runs");
  command->add_flag("--arbiter", resolving->arbiter,
                    "Let trackers of position, colour and shape vote; ask the model only where they do not agree");
  command
      ->add_option("--sure", resolving->arbiter_options.sure,
                   "With --arbiter: the least probability of what it decides (default 0.8)")
      ->type_name("P");
  add_time_options(*command, resolving->store);
  add_inference_options(*command, *options);
  add_common_options(*command, *options);
  command->callback(
      [options, resolving, &action] { action = [options, resolving] { return run_resolve(*options, *resolving); }; });
}

}  // namespace sherlog::cli
