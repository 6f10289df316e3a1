// sherlog scenes: scenes as data. The list of subcommands, and what they share.
#include "cli/scenes.h"

#include <fmt/chrono.h>
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <charconv>
#include <chrono>
#include <cmath>

#include "mln/text_file.h"

namespace sherlog::cli {
namespace {

constexpr double kDay = 86400;

// Hours of the day, from and to.
struct PartOfDay {
  std::string_view name;
  double from, to;
};
constexpr PartOfDay kPartsOfDay[] = {{"morning", 5, 12}, {"afternoon", 12, 18}, {"evening", 18, 24},
                                     {"night", 0, 5},    {"today", 0, 24},      {"yesterday", -24, 0}};

// Digits from `at` on as a number; at moves behind them.
std::optional<int> digits(std::string_view text, std::size_t& at, std::size_t count) {
  int value = 0;
  if (at + count > text.size()) return std::nullopt;
  const auto [end, error] = std::from_chars(text.data() + at, text.data() + at + count, value);
  if (error != std::errc() || end != text.data() + at + count || value < 0) return std::nullopt;
  at += count;
  return value;
}

std::optional<double> parse_date(std::string_view text, double utc_offset) {
  std::size_t at = 0;
  const auto take = [&](char separator) { return at < text.size() && text[at] == separator ? (++at, true) : false; };
  const auto year = digits(text, at, 4);
  if (!year || !take('-')) return std::nullopt;
  const auto month = digits(text, at, 2);
  if (!month || !take('-')) return std::nullopt;
  const auto day = digits(text, at, 2);
  if (!day) return std::nullopt;
  const std::chrono::year_month_day date{std::chrono::year(*year), std::chrono::month(static_cast<unsigned>(*month)),
                                         std::chrono::day(static_cast<unsigned>(*day))};
  if (!date.ok()) return std::nullopt;
  double seconds = static_cast<double>(std::chrono::sys_days(date).time_since_epoch().count()) * kDay;
  const double ahead = utc_offset * 3600;
  if (at == text.size()) return seconds - ahead;
  if (!take('T') && !take(' ')) return std::nullopt;
  const auto hour = digits(text, at, 2);
  if (!hour || *hour > 24 || !take(':')) return std::nullopt;
  const auto minute = digits(text, at, 2);
  if (!minute || *minute > 59) return std::nullopt;
  seconds += *hour * 3600 + *minute * 60;
  if (take(':')) {
    const auto second = digits(text, at, 2);
    if (!second || *second > 60) return std::nullopt;
    seconds += *second;
  }
  if (!take('Z')) seconds -= ahead;
  return at == text.size() ? std::optional(seconds) : std::nullopt;
}

bool bad_time(Session& session, const char* option, const std::string& text) {
  session.error(fmt::format("{}: '{}' is no time: seconds, 2012-11-22 or 2012-11-22T08:30:00Z", option, text));
  return false;
}

}  // namespace

void add_store_option(CLI::App& command, StoreChoice& choice) {
  command.add_option("STORE", choice.path, "The store: an SQLite file")->required()->type_name("");
  command.add_option("--wait", choice.wait_seconds, "How long to wait for another program's lock (default 2)")
      ->type_name("S")
      ->check(number_within(0, 1e6));
}

void add_time_options(CLI::App& command, StoreChoice& choice) {
  command
      .add_option("--from", choice.from,
                  "From this time on: seconds, 2012-11-22, 2012-11-22T08:30:00, or with Z for UTC")
      ->type_name("TIME");
  command.add_option("--to", choice.to, "Up to this time")->type_name("TIME");
  command
      .add_option("--during", choice.during,
                  "A part of the day of --now: morning is 5 to 12, afternoon to 18, evening to 24")
      ->type_name("morning|afternoon|evening|night|today|yesterday")
      ->check(one_of({"morning", "afternoon", "evening", "night", "today", "yesterday"}));
  command.add_option("--now", choice.now, "What time it is for --during (default: the newest scene's)")
      ->type_name("TIME");
  command.add_option("--utc-offset", choice.utc_offset, "The local time is so many hours ahead of UTC (default 0)")
      ->type_name("HOURS")
      ->check(number_within(-24, 24));
}

void add_concept_option(CLI::App& command, StoreChoice& choice) {
  command
      .add_option("--concepts", choice.concepts, "Which names stand below which, e.g. brands of milk below milk: JSON")
      ->type_name("FILE");
}

std::optional<SceneStore> open_store(Session& session, const StoreChoice& choice, SqlOpen how) {
  for (const char* end : kStoreFiles) {
    if (!session.reads(choice.path + end)) return std::nullopt;
  }
  how.wait_seconds = choice.wait_seconds;
  std::string problem;
  auto store = SceneStore::open(choice.path, how, problem);
  if (!store) session.error(problem);
  return store;
}

std::optional<SceneStore> open_to_read(Session& session, const StoreChoice& choice) {
  auto store = open_store(session, choice, {.read_only = true});
  if (store) store->stop_when([&session] { return stopped_by(session) != Termination::kCompleted; });
  return store;
}

Termination stopped_by(Session& session) {
  if (session.monitor().interrupted()) return Termination::kInterrupted;
  return session.seconds_left() <= 0 ? Termination::kTimeLimit : Termination::kCompleted;
}

std::string_view stop_words(Termination termination) {
  return termination == Termination::kInterrupted ? "interrupted" : "the time limit was reached";
}

int finish_unread(Session& session, SceneStore& store, const char* schema) {
  if (!store.was_stopped()) return session.error(store.problem()), kBadInput;
  const Termination why = stopped_by(session);
  session.error(fmt::format("{} before the store was read: there is no answer", stop_words(why)));
  return session.finish(exit_code(why), "", [&] {
    return to_text(Json{{"schema", schema}, {"termination", to_string(why)}});
  });
}

std::optional<SceneFilter> scene_filter(Session& session, SceneStore& store, const StoreChoice& choice) {
  SceneFilter filter;
  filter.limit = choice.limit;
  for (const auto& [option, text, target] :
       {std::tuple{"--from", &choice.from, &filter.from}, std::tuple{"--to", &choice.to, &filter.to}}) {
    if (text->empty()) continue;
    const auto time = parse_time(*text, choice.utc_offset);
    if (!time) return bad_time(session, option, *text), std::nullopt;
    *target = *time;
  }
  if (!choice.during.empty()) {
    const auto now = choice.now.empty() ? store.newest().value_or(0) : parse_time(choice.now, choice.utc_offset);
    if (!now) return bad_time(session, "--now", choice.now), std::nullopt;
    const double offset = choice.utc_offset * 3600;
    const double midnight = std::floor((*now + offset) / kDay) * kDay - offset;
    for (const PartOfDay& part : kPartsOfDay) {
      if (part.name != choice.during) continue;
      filter.from = std::max(filter.from, midnight + part.from * 3600);
      // What begins at that time is of the next part, and to the end of a filter belongs the end.
      filter.to =
          std::min(filter.to, std::nextafter(midnight + part.to * 3600, -std::numeric_limits<double>::infinity()));
    }
  }
  return filter;
}

std::optional<EvidenceMapping> read_mapping(Session& session, const std::string& name) {
  if (auto shipped = shipped_mapping(name)) return shipped;
  if (!session.reads(name)) return std::nullopt;
  const TextFile file = load_text_file(name);
  if (!file.text) {
    session.error(fmt::format("--mapping: '{}' is none of {}, and no file: {}", name,
                              fmt::join(shipped_mapping_names(), ", "), file.problem));
    return std::nullopt;
  }
  std::string problem;
  const auto document = parse_json(*file.text, problem);
  auto mapping = document ? mapping_from_json(*document, problem) : std::nullopt;
  if (!mapping) session.error(fmt::format("{}: {}", name, problem));
  return mapping;
}

std::optional<Concepts> read_concepts(Session& session, const StoreChoice& choice) {
  if (choice.concepts.empty()) return Concepts{};
  if (!session.reads(choice.concepts)) return std::nullopt;
  const TextFile file = load_text_file(choice.concepts);
  std::string problem = file.problem;
  auto concepts = file.text ? parse_concepts(*file.text, problem) : std::nullopt;
  if (!concepts) session.error(fmt::format("{}: {}", choice.concepts, problem));
  return concepts;
}

std::optional<double> parse_time(std::string_view text, double utc_offset) {
  if (const auto date = parse_date(text, utc_offset)) return date;
  double seconds = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), seconds);
  const bool good = error == std::errc() && end == text.data() + text.size() && std::isfinite(seconds);
  return good ? std::optional(seconds) : std::nullopt;
}

std::string time_text(double seconds, double utc_offset) {
  const double local = seconds + utc_offset * 3600;
  // Small numbers are seconds since the robot was started and no dates.
  if (local < 1e8 || local > kLatestTime) return fmt::format("{:g} s", seconds);
  const auto time = static_cast<std::time_t>(std::floor(local));
  return fmt::format("{:%Y-%m-%d %H:%M:%S}", fmt::gmtime(time));
}

Json to_json(const Value& value) { return Json::parse(json_text(value)); }

Json to_json(const Found& found) {
  Json json;
  if (!found.label.empty()) json["label"] = found.label;
  json["scene"] = found.scene;
  json["cluster"] = found.cluster;
  json["time"] = found.time;
  if (!found.place.empty()) json["place"] = found.place;
  if (found.confidence) json["confidence"] = *found.confidence;
  if (!found.position.empty()) json["position"] = found.position;
  if (!found.position.empty() && !found.frame.empty()) json["frame"] = found.frame;
  return json;
}

std::string position_text(const Found& found) {
  if (found.position.empty()) return "";
  std::string text;
  for (const double coordinate : found.position) text += fmt::format("{}{:.2f}", text.empty() ? "" : " ", coordinate);
  return found.frame.empty() ? text : fmt::format("{} ({})", text, found.frame);
}

void add_scenes(CLI::App& app, Action& action) {
  CLI::App* command = app.add_subcommand("scenes", "Scenes as data: a store of what a robot saw, and synthetic scenes");
  command->require_subcommand(1);
  add_scenes_files(*command, action);
  add_scenes_lists(*command, action);
  add_scenes_questions(*command, action);
  add_scenes_evidence(*command, action);
  add_scenes_generate(*command, action);
}

}  // namespace sherlog::cli
