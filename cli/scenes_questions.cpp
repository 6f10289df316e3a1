// sherlog scenes where, history, on: what a person asks a robot that has been watching.
#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <memory>
#include <set>

#include "cli/scenes.h"
#include "cli/table.h"

namespace sherlog::cli {
namespace {

struct Asking {
  StoreChoice store;
  std::string thing;
  std::string place;
};

// A store, the filter and the concepts; or nothing after saying why.
struct Opened {
  SceneStore store;
  SceneFilter filter;
  Concepts concepts;
};

std::optional<Opened> open_for(Session& session, const Asking& asking) {
  if (!session.check_options()) return std::nullopt;
  auto store = open_to_read(session, asking.store);
  if (!store) return std::nullopt;
  auto filter = scene_filter(session, *store, asking.store);
  auto concepts = read_concepts(session, asking.store);
  if (!filter || !concepts) return std::nullopt;
  return Opened{std::move(*store), std::move(*filter), std::move(*concepts)};
}

// Clusters that bear the name or one below it, newest first; one that bears several of them once.
std::vector<Found> find_thing(Opened& opened, const std::string& thing) {
  std::vector<Found> found;
  for (const std::string& name : names_of(opened.concepts, thing)) {
    const auto some = opened.store.find(name, opened.filter);
    found.insert(found.end(), some.begin(), some.end());
  }
  std::stable_sort(found.begin(), found.end(), [](const Found& a, const Found& b) { return a.time > b.time; });
  std::set<std::pair<std::string, std::string>> seen;
  std::erase_if(found, [&](const Found& entry) { return !seen.emplace(entry.scene, entry.cluster).second; });
  return found;
}

std::string sure(const Found& found) { return found.confidence ? fmt::format("{:.2f}", *found.confidence) : ""; }

Table found_table(const std::vector<Found>& found, double utc_offset) {
  Table table({{"thing", Align::kLeft},
               {"place", Align::kLeft},
               {"position", Align::kLeft},
               {"seen", Align::kLeft},
               {"scene", Align::kLeft},
               {"cluster", Align::kLeft},
               {"confidence", Align::kRight}});
  for (const Found& entry : found) {
    table.add_row({entry.label.empty() ? "(no name)" : entry.label, entry.place, position_text(entry),
                   time_text(entry.time, utc_offset), entry.scene, entry.cluster, sure(entry)});
  }
  return table;
}

Json found_json(const std::vector<Found>& found) {
  Json list = Json::array();
  for (const Found& entry : found) list.push_back(to_json(entry));
  return list;
}

// Where it was when it was seen last; and whether somebody looked there since.
int run_where(Options options, const Asking& asking) {
  Session session(std::move(options));
  auto opened = open_for(session, asking);
  if (!opened) return kBadInput;
  opened->filter.limit = 100;  // of each name: enough for every cluster of the newest scene
  std::vector<Found> found = find_thing(*opened, asking.thing);
  std::erase_if(found, [&](const Found& entry) { return entry.time < found.front().time; });
  std::optional<double> looked;
  std::optional<Identity> identity;
  if (!found.empty()) {
    looked = opened->store.last_look(found.front().place);
    identity = opened->store.identity(found.front().label);
  }
  const auto belongs = place_for(opened->concepts, asking.thing);
  if (!opened->store.problem().empty()) return finish_unread(session, opened->store, "sherlog.scenes.where/1");
  const double offset = asking.store.utc_offset;
  const bool missed = looked && !found.empty() && *looked > found.front().time;
  std::string text =
      found.empty() ? fmt::format("'{}' was never seen\n", asking.thing) : found_table(found, offset).text();
  if (identity && identity->disappeared) text += "\nit has disappeared since\n";
  if (missed) text += fmt::format("\nthat place was seen without it at {}\n", time_text(*looked, offset));
  if (belongs) text += fmt::format("\nit belongs to: {}\n", *belongs);
  return session.finish(kDone, text, [&] {
    Json json{{"schema", "sherlog.scenes.where/1"}, {"thing", asking.thing}, {"found", found_json(found)}};
    if (missed) json["place_seen_without_it"] = *looked;
    if (identity) json["disappeared"] = identity->disappeared;
    if (belongs) json["belongs"] = *belongs;
    return to_text(json);
  });
}

struct Stay {
  std::string place;
  double from = 0, to = 0;
  std::size_t sightings = 0;
  Found last;
};

// What of an identity's history was changed by a later scene.
Value::List revisions_of(const Identity& identity) {
  const Value* records = find(identity.other, "revisions");
  return records == nullptr || records->list() == nullptr ? Value::List() : *records->list();
}

std::string revision_text(const Value& record) {
  const auto word = [&](const char* key) {
    const Value* value = record.find(key);
    return value != nullptr && value->text() != nullptr ? *value->text() : std::string("?");
  };
  return fmt::format("{} in {} was taken for {} until {} showed that it is {}\n", word("cluster"), word("scene"),
                     word("was"), word("decidedBy"), word("is"));
}

int run_history(Options options, const Asking& asking) {
  Session session(std::move(options));
  auto opened = open_for(session, asking);
  if (!opened) return kBadInput;
  std::vector<Found> found = find_thing(*opened, asking.thing);
  if (!opened->store.problem().empty()) return finish_unread(session, opened->store, "sherlog.scenes.history/1");
  std::reverse(found.begin(), found.end());
  std::vector<Stay> stays;
  for (const Found& entry : found) {
    if (stays.empty() || stays.back().place != entry.place)
      stays.push_back({entry.place, entry.time, entry.time, 0, entry});
    stays.back().to = entry.time;
    stays.back().last = entry;
    ++stays.back().sightings;
  }
  Table table({{"place", Align::kLeft},
               {"from", Align::kLeft},
               {"to", Align::kLeft},
               {"sightings", Align::kRight},
               {"last position", Align::kLeft}});
  const double offset = asking.store.utc_offset;
  for (const Stay& stay : stays) {
    table.add_row({stay.place.empty() ? "(no place)" : stay.place, time_text(stay.from, offset),
                   time_text(stay.to, offset), std::to_string(stay.sightings), position_text(stay.last)});
  }
  std::string text = stays.empty() ? fmt::format("'{}' was never seen\n", asking.thing) : table.text();
  const auto identity = opened->store.identity(asking.thing);
  const Value::List revisions = identity ? revisions_of(*identity) : Value::List();
  if (!revisions.empty()) text += "\n";
  for (const Value& record : revisions) text += revision_text(record);
  return session.finish(kDone, text, [&] {
    Json json{{"schema", "sherlog.scenes.history/1"},
              {"thing", asking.thing},
              {"stays", Json::array()},
              {"sightings", found_json(found)}};
    for (const Stay& stay : stays) {
      json["stays"].push_back(
          {{"place", stay.place}, {"from", stay.from}, {"to", stay.to}, {"sightings", stay.sightings}});
    }
    for (const Value& record : revisions) json["revisions"].push_back(to_json(record));
    return to_text(json);
  });
}

bool same_name(const std::string& a, const std::string& b) {
  return CLI::detail::to_lower(a) == CLI::detail::to_lower(b);
}

// Keeps what bears one of the names, under that name.
void keep_named(Opened& opened, const std::vector<std::string>& names, std::vector<Found>& found) {
  std::erase_if(found, [&](Found& entry) {
    for (const std::string& label : opened.store.names_of(entry.scene, entry.cluster)) {
      for (const std::string& name : names) {
        if (!same_name(label, name)) continue;
        entry.label = label;
        return false;
      }
    }
    return true;
  });
}

// The newest look at each of the places that were looked at.
std::vector<std::pair<std::string, double>> last_looks(Opened& opened, const std::string& place) {
  std::vector<std::pair<std::string, double>> looks;
  for (const std::string& name : names_of(opened.concepts, place)) {
    if (const auto time = opened.store.last_look(name)) looks.emplace_back(name, *time);
  }
  return looks;
}

// "at the last look on 2012-11-22 08:00:00", of several places "... (table_a), ... (table_b)".
std::string looks_text(const std::vector<std::pair<std::string, double>>& looks, double utc_offset) {
  std::string text = "at the last look on ";
  for (const auto& [place, time] : looks) {
    text += fmt::format("{}{}", &place == &looks.front().first ? "" : ", ", time_text(time, utc_offset));
    if (looks.size() > 1) text += fmt::format(" ({})", place);
  }
  return text;
}

// Without a time: what was there at the last look, at each place at its own.
int run_on(Options options, const Asking& asking) {
  Session session(std::move(options));
  auto opened = open_for(session, asking);
  if (!opened) return kBadInput;
  const bool asks_now = asking.store.from.empty() && asking.store.to.empty() && asking.store.during.empty();
  const auto looks = last_looks(*opened, asking.place);
  std::vector<Found> found;
  for (const auto& [place, time] : looks) {
    if (asks_now) opened->filter.from = opened->filter.to = time;
    const auto some = opened->store.at_place(place, opened->filter);
    found.insert(found.end(), some.begin(), some.end());
  }
  std::stable_sort(found.begin(), found.end(), [](const Found& a, const Found& b) { return a.time < b.time; });
  if (!asking.thing.empty()) keep_named(*opened, names_of(opened->concepts, asking.thing), found);
  if (!opened->store.problem().empty()) return finish_unread(session, opened->store, "sherlog.scenes.on/1");
  const double offset = asking.store.utc_offset;
  std::string text;
  if (looks.empty()) {
    text = fmt::format("nothing was ever seen at '{}'\n", asking.place);
  } else if (!asking.thing.empty()) {
    text = fmt::format("{}, {}\n", found.empty() ? "no" : "yes", asks_now ? looks_text(looks, offset) : "in that time");
  } else if (asks_now) {
    text = looks_text(looks, offset) + "\n";
  }
  if (!looks.empty() && (asking.thing.empty() || !found.empty()))
    text += (text.empty() ? "" : "\n") + found_table(found, offset).text();
  return session.finish(kDone, text, [&] {
    Json json{{"schema", "sherlog.scenes.on/1"}, {"place", asking.place}};
    if (!asking.thing.empty()) json["thing"] = asking.thing;
    if (!asking.thing.empty()) json["answer"] = !found.empty();
    for (const auto& [place, time] : looks) {
      json["last_look"] = std::max(time, json.value("last_look", time));
      json["looks"].push_back({{"place", place}, {"time", time}});
    }
    json["found"] = found_json(found);
    return to_text(json);
  });
}

void add_question(CLI::App& scenes, Action& action, const char* name, const char* help, bool asks_place,
                  int (*run)(Options, const Asking&)) {
  auto options = std::make_shared<Options>();
  auto asking = std::make_shared<Asking>();
  CLI::App* command = scenes.add_subcommand(name, help);
  add_store_option(*command, asking->store);
  if (asks_place) {
    command->add_option("PLACE", asking->place, "A place as annotators name it, or one of the concept file")
        ->required()
        ->type_name("");
    command->add_option("--what", asking->thing, "Only this thing: answers yes or no")->type_name("THING");
  } else {
    command
        ->add_option("THING", asking->thing, "An identity, a name that an annotator gave, or one of the concept file")
        ->required()
        ->type_name("");
  }
  add_time_options(*command, asking->store);
  add_concept_option(*command, asking->store);
  add_common_options(*command, *options);
  command->callback(
      [options, asking, run, &action] { action = [options, asking, run] { return run(*options, *asking); }; });
}

}  // namespace

void add_scenes_questions(CLI::App& scenes, Action& action) {
  add_question(scenes, action, "where", "Where is it? The last time that a thing was seen", false, run_where);
  add_question(scenes, action, "history", "Where has it been? Every place of a thing, in the order of time", false,
               run_history);
  add_question(scenes, action, "on", "What is, or was, on the table?", true, run_on);
}

}  // namespace sherlog::cli
