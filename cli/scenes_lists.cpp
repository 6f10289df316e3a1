// sherlog scenes list, show, counts, times: what a store has.
#include <fmt/format.h>

#include <memory>

#include "cli/scenes.h"
#include "cli/table.h"

namespace sherlog::cli {
namespace {

struct Listing {
  StoreChoice store;
  std::string place;
  bool newest_first = false;
};

struct Showing {
  StoreChoice store;
  std::string scene;
};

int run_list(Options options, const Listing& listing) {
  Session session(std::move(options));
  if (!session.check_options()) return kBadInput;
  auto store = open_to_read(session, listing.store);
  if (!store) return kBadInput;
  const auto concepts = read_concepts(session, listing.store);
  auto filter = scene_filter(session, *store, listing.store);
  if (!filter || !concepts) return kBadInput;
  filter->newest_first = listing.newest_first;
  if (!listing.place.empty()) filter->places = names_of(*concepts, listing.place);
  const std::vector<SceneSummary> found = store->scenes(*filter);
  const std::uint64_t all = store->scene_count();
  if (!store->problem().empty()) return finish_unread(session, *store, "sherlog.scenes.list/1");
  Table table({{"scene", Align::kLeft},
               {"time", Align::kLeft},
               {"place", Align::kLeft},
               {"clusters", Align::kRight},
               {"annotations", Align::kRight}});
  for (const SceneSummary& scene : found) {
    table.add_row({scene.id, time_text(scene.time, listing.store.utc_offset), scene.place,
                   std::to_string(scene.clusters), std::to_string(scene.annotations)});
  }
  return session.finish(kDone, fmt::format("{} of {} scenes\n\n{}", found.size(), all, table.text()), [&] {
    Json json{{"schema", "sherlog.scenes.list/1"}, {"scenes", Json::array()}};
    for (const SceneSummary& scene : found) {
      json["scenes"].push_back({{"id", scene.id},
                                {"time", scene.time},
                                {"place", scene.place},
                                {"clusters", scene.clusters},
                                {"annotations", scene.annotations}});
    }
    return to_text(json);
  });
}

// "shape=box (0.89)", "frame_id=stove_link, reference_desc=on"
std::string annotation_text(const Annotation& annotation) {
  std::string text;
  for (const auto& [key, value] : annotation.fields) {
    std::string shown = value.text() == nullptr ? json_text(value) : *value.text();
    if (shown.size() > 60) shown = shown.substr(0, 57) + "...";
    text += fmt::format("{}{}={}", text.empty() ? "" : ", ", key, shown);
  }
  if (annotation.confidence) text += fmt::format(" ({:.3g})", *annotation.confidence);
  return text;
}

void add_annotations(Table& table, const std::string& name, const std::vector<Annotation>& annotations) {
  std::string shown = name;
  for (const Annotation& annotation : annotations) {
    const std::string_view type = annotation.type;
    table.add_row({shown, std::string(type.substr(type.rfind('.') + 1)), annotation_text(annotation),
                   annotation.source.value_or("")});
    shown.clear();
  }
}

std::string scene_text(const Scene& scene, double utc_offset) {
  std::string text =
      fmt::format("{}, {}, {} clusters\n\n", scene.id, time_text(scene.timestamp, utc_offset), scene.clusters.size());
  Table table({{"cluster", Align::kLeft}, {"type", Align::kLeft}, {"says", Align::kLeft}, {"source", Align::kLeft}});
  add_annotations(table, "(scene)", scene.annotations);
  for (const Cluster& cluster : scene.clusters) {
    table.add_gap();
    if (cluster.hypotheses.empty() && cluster.annotations.empty()) table.add_row({cluster.id});
    add_annotations(table, cluster.id, cluster.hypotheses);
    add_annotations(table, cluster.hypotheses.empty() ? cluster.id : "", cluster.annotations);
  }
  return text + table.text();
}

int run_show(Options options, const Showing& showing) {
  Session session(std::move(options));
  if (!session.check_options()) return kBadInput;
  auto store = open_to_read(session, showing.store);
  if (!store) return kBadInput;
  const auto scene = store->scene(showing.scene);
  if (!scene && store->problem().empty()) {
    session.error(fmt::format("the store has no scene '{}'", showing.scene));
    return kBadInput;
  }
  const auto evidence = store->evidence_of(showing.scene);
  const auto beliefs = store->beliefs_of(showing.scene);
  if (!scene || !store->problem().empty()) return finish_unread(session, *store, "sherlog.scenes.show/1");
  std::string text = scene_text(*scene, showing.store.utc_offset);
  for (const StoredEvidence& entry : evidence)
    text += fmt::format("\nevidence by '{}':\n{}", entry.mapping, entry.text);
  for (const StoredBelief& entry : beliefs)
    text += fmt::format("\nbelief by '{}': {}\n", entry.kind, json_text(entry.document));
  return session.finish(kDone, text, [&] {
    Json json{{"schema", "sherlog.scenes.show/1"}, {"scene", to_json(scene_to_json(*scene))}};
    for (const StoredEvidence& entry : evidence) json["evidence"][entry.mapping] = entry.text;
    for (const StoredBelief& entry : beliefs) json["beliefs"][entry.kind] = to_json(entry.document);
    return to_text(json);
  });
}

int run_counts(Options options, const StoreChoice& choice) {
  Session session(std::move(options));
  if (!session.check_options()) return kBadInput;
  auto store = open_to_read(session, choice);
  if (!store) return kBadInput;
  const std::uint64_t scenes = store->scene_count(), clusters = store->cluster_count();
  const auto counts = store->type_counts();
  // What an image search found is counted by kind as well, as the paper does.
  std::vector<std::pair<std::string, std::uint64_t>> kinds;
  for (const TypeCount& count : counts) {
    if (count.type == "rs.annotation.Goggles") kinds = store->field_counts(count.type, "category");
  }
  if (!store->problem().empty()) return finish_unread(session, *store, "sherlog.scenes.counts/1");
  Table table({{"type", Align::kLeft}, {"of scenes", Align::kRight}, {"of clusters", Align::kRight}});
  for (const TypeCount& count : counts) {
    table.add_row({count.type, std::to_string(count.of_scenes), std::to_string(count.of_clusters)});
    if (count.type != "rs.annotation.Goggles") continue;
    for (const auto& [kind, number] : kinds) table.add_row({"  " + kind, "", std::to_string(number)});
  }
  return session.finish(kDone, fmt::format("{} scenes, {} clusters\n\n{}", scenes, clusters, table.text()), [&] {
    Json json{
        {"schema", "sherlog.scenes.counts/1"}, {"scenes", scenes}, {"clusters", clusters}, {"types", Json::array()}};
    for (const TypeCount& count : counts) {
      json["types"].push_back(
          {{"type", count.type}, {"of_scenes", count.of_scenes}, {"of_clusters", count.of_clusters}});
    }
    for (const auto& [kind, number] : kinds) json["goggles"][kind] = number;
    return to_text(json);
  });
}

int run_times(Options options, const StoreChoice& choice) {
  Session session(std::move(options));
  if (!session.check_options()) return kBadInput;
  auto store = open_to_read(session, choice);
  if (!store) return kBadInput;
  const TimeReport report = store->times();
  if (!store->problem().empty()) return finish_unread(session, *store, "sherlog.scenes.times/1");
  Table table(
      {{"annotator", Align::kLeft}, {"runs", Align::kRight}, {"mean ms", Align::kRight}, {"std ms", Align::kRight}});
  const auto add_row = [&](const TimeReport::Row& row) {
    table.add_row({row.annotator, std::to_string(row.runs), fmt::format("{:.1f}", row.mean),
                   fmt::format("{:.1f}", row.deviation)});
  };
  for (const TimeReport::Row& row : report.annotators) add_row(row);
  table.add_gap();
  add_row(report.total);
  return session.finish(kDone, table.text(), [&] {
    const auto entry = [](const TimeReport::Row& row) {
      return Json{{"annotator", row.annotator}, {"runs", row.runs}, {"mean", row.mean}, {"std", row.deviation}};
    };
    Json json{{"schema", "sherlog.scenes.times/1"}, {"unit", "ms"}, {"annotators", Json::array()}};
    for (const TimeReport::Row& row : report.annotators) json["annotators"].push_back(entry(row));
    json["total"] = entry(report.total);
    return to_text(json);
  });
}

void add_report(CLI::App& scenes, Action& action, const char* name, const char* help,
                int (*run)(Options, const StoreChoice&)) {
  auto options = std::make_shared<Options>();
  auto choice = std::make_shared<StoreChoice>();
  CLI::App* command = scenes.add_subcommand(name, help);
  add_store_option(*command, *choice);
  add_common_options(*command, *options);
  command->callback(
      [options, choice, run, &action] { action = [options, choice, run] { return run(*options, *choice); }; });
}

}  // namespace

void add_scenes_lists(CLI::App& scenes, Action& action) {
  {
    auto options = std::make_shared<Options>();
    auto listing = std::make_shared<Listing>();
    CLI::App* command = scenes.add_subcommand("list", "The scenes of a store, by time");
    add_store_option(*command, listing->store);
    command->add_option("--place", listing->place, "Only scenes with something at this place")->type_name("PLACE");
    command->add_flag("--newest-first", listing->newest_first, "From the newest to the oldest");
    command->add_option("--limit", listing->store.limit, "At most so many (default 0: all)")
        ->type_name("N")
        ->check(whole_number(1'000'000'000));
    add_time_options(*command, listing->store);
    add_concept_option(*command, listing->store);
    add_common_options(*command, *options);
    command->callback(
        [options, listing, &action] { action = [options, listing] { return run_list(*options, *listing); }; });
  }
  {
    auto options = std::make_shared<Options>();
    auto showing = std::make_shared<Showing>();
    CLI::App* command = scenes.add_subcommand("show", "One scene with everything that is known of it");
    add_store_option(*command, showing->store);
    command->add_option("SCENE", showing->scene, "Its id")->required()->type_name("");
    add_common_options(*command, *options);
    command->callback(
        [options, showing, &action] { action = [options, showing] { return run_show(*options, *showing); }; });
  }
  add_report(scenes, action, "counts", "How many annotations of each type a store has", run_counts);
  add_report(scenes, action, "times", "Mean and standard deviation of the annotators' run times", run_times);
}

}  // namespace sherlog::cli
