// sherlog track show: one step of identity resolution as matrices, of two scenes in a store or of a simulated trial.
#include <fmt/format.h>

#include <fstream>
#include <limits>
#include <memory>

#include "cli/scenes.h"
#include "cli/table.h"
#include "cli/track_commands.h"
#include "cli/track_options.h"
#include "perception_bridge/association_question.h"
#include "perception_bridge/four_tables_json.h"
#include "perception_bridge/identity_resolver.h"
#include "perception_bridge/step_picture.h"

namespace sherlog::cli {
namespace {

struct Showing {
  Options options;
  StoreChoice store;
  std::string scene, against;
  std::string dump;
  std::uint64_t trial = 0;
  TrackOptions track;
  std::string model = "paper", mapping = "identity";
  std::string svg, html;
};

constexpr const char* kSchema = "sherlog.track.show/1";

// A picture, or the exit code after saying what is wrong.
struct Drawn {
  std::optional<StepPicture> picture;
  std::string method;
  int code = kBadInput;
};

std::optional<Scene> stored_scene(Session& session, SceneStore& store, const std::string& id) {
  auto scene = store.scene(id);
  if (!scene) session.error(store.problem().empty() ? fmt::format("the store has no scene '{}'", id) : store.problem());
  return scene;
}

// The two scenes: as they were named, else the newest one and the one before.
std::optional<std::pair<Scene, Scene>> scene_pair(Session& session, SceneStore& store, const Showing& showing) {
  std::string now = showing.scene, before = showing.against;
  if (now.empty()) {
    const auto newest = store.scenes({.limit = 1, .newest_first = true});
    if (newest.empty()) return session.error("the store has no scenes"), std::nullopt;
    now = newest.front().id;
  }
  if (before.empty()) {
    const auto found = store.scene_before(now);
    if (!found && store.has(now)) {
      return session.error(fmt::format("there is no scene before '{}'; --against says which one to take", now)),
             std::nullopt;
    }
    before = found.value_or(now);
  }
  auto new_scene = stored_scene(session, store, now);
  auto old_scene = new_scene ? stored_scene(session, store, before) : std::nullopt;
  if (!old_scene) return std::nullopt;
  return std::pair(std::move(*old_scene), std::move(*new_scene));
}

Drawn draw_scenes(Session& session, const Showing& showing) {
  if (showing.model == "learned") return session.error("--model learned is for trials of a --dump"), Drawn{};
  auto model = identity_model(session, showing.model);
  auto mapping = read_mapping(session, showing.mapping);
  if (!model || !mapping) return {};
  std::string problem;
  const auto question =
      AssociationQuestion::make(std::move(*model), std::move(*mapping), session.inference_options(), problem);
  if (!question) return session.error(problem), Drawn{};
  auto store = open_store(session, showing.store, {.read_only = true});
  if (!store) return {};
  const auto scenes = scene_pair(session, *store, showing);
  if (!scenes) return {};
  const auto& [before, now] = *scenes;
  const AssociationQuestion::Answer answer = question->ask(before.clusters, now, session.monitor());
  if (answer.contradiction) {
    session.print_message(conflict_text(conflict_items(*answer.contradiction), answer.message));
    return {{}, answer.method, exit_code(answer.termination)};
  }
  if (answer.termination != Termination::kCompleted)
    return session.error(answer.message), Drawn{{}, answer.method, exit_code(answer.termination)};
  return {picture_of(before, now, question->mapping(), answer.belief), answer.method, kDone};
}

std::optional<FourTablesTrial> dumped_trial(Session& session, const Showing& showing, const FourTablesConfig& config) {
  if (!session.reads(showing.dump)) return std::nullopt;
  std::ifstream in(showing.dump, std::ios::binary);
  if (!in.is_open()) return session.error(fmt::format("cannot read '{}'", showing.dump)), std::nullopt;
  std::string line;
  for (std::uint64_t number = 1; std::getline(in, line); ++number) {
    if (line.find_first_not_of(" \t\r") == std::string::npos) continue;
    std::string problem;
    auto trial = trial_from_line(line, config, problem);
    if (!trial) return session.error(fmt::format("{}:{}: {}", showing.dump, number, problem)), std::nullopt;
    if (trial->number == showing.trial) return trial;
  }
  return session.error(fmt::format("'{}' has no trial {}", showing.dump, showing.trial)), std::nullopt;
}

Drawn draw_trial(Session& session, const Showing& showing) {
  const auto config = read_config(session, showing.track);
  if (!config) return {};
  const auto trial = dumped_trial(session, showing, *config);
  if (!trial) return {};
  const MadeMatcher made = make_matcher(session, "mln", showing.model, showing.track, trial->config);
  if (!made.matcher) return {{}, "", finish_unlearned(session, kSchema, made.termination, made.message)};
  const auto* resolver = dynamic_cast<const IdentityResolver*>(made.matcher.get());
  if (resolver == nullptr) return {};
  const IdentityResolver::Belief belief = resolver->believe(*trial);
  if (belief.termination != Termination::kCompleted)
    return session.error(belief.message), Drawn{{}, belief.method, exit_code(belief.termination)};
  StepPicture picture;
  picture.title = fmt::format("trial {}, seed {}", trial->number, trial->seed);
  for (std::size_t o = 0; o < trial->old_clusters.size(); ++o) {
    picture.old_names.push_back(fmt::format("O{}", o + 1));
    picture.out_of_view.push_back(trial->old_clusters[o].out_of_view);
  }
  for (std::size_t n = 0; n < trial->new_clusters.size(); ++n) picture.new_names.push_back(fmt::format("N{}", n + 1));
  picture.grades = {{"similar", {}}, {"proximity", {}}};
  for (const PairGrade& grade : resolver->grades(*trial)) {
    picture.grades[0].values.push_back(grade.similar);
    picture.grades[1].values.push_back(grade.proximity);
  }
  picture.belief = belief.belief;
  picture.resolution = decide(belief.belief, *trial);
  picture.truth = trial->truth;
  return {std::move(picture), belief.method, kDone};
}

std::string show_text(const StepPicture& picture) {
  Table table(
      {{"new", Align::kLeft}, {"old", Align::kLeft}, {"explanation", Align::kLeft}, {"probability", Align::kRight}});
  for (std::size_t n = 0; n < picture.new_names.size(); ++n) {
    const auto o = picture.resolution.association[n];
    table.add_row({picture.new_names[n], o ? picture.old_names[*o] : "",
                   std::string(o ? to_string(picture.resolution.explanation[*o]) : "appear"),
                   fmt::format("{:.3f}", o ? picture.belief.same(*o, n) : picture.belief.appeared(n))});
  }
  for (std::size_t o = 0; o < picture.old_names.size(); ++o) {
    if (old_mark(picture.resolution, o))
      table.add_row({"", picture.old_names[o], std::string(to_string(picture.resolution.explanation[o]))});
  }
  return picture.title + "\n\n" + table.text();
}

template <class At>
Json matrix_json(const StepPicture& picture, const At& at) {
  Json rows = Json::array();
  for (std::size_t o = 0; o < picture.old_names.size(); ++o) {
    Json row = Json::array();
    for (std::size_t n = 0; n < picture.new_names.size(); ++n) row.push_back(at(o, n));
    rows.push_back(std::move(row));
  }
  return rows;
}

Json show_json(const StepPicture& picture, const std::string& method) {
  Json json{{"schema", kSchema},        {"title", picture.title},   {"method", method},
            {"old", picture.old_names}, {"new", picture.new_names}, {"out_of_view", picture.out_of_view}};
  for (const StepPicture::Grades& grades : picture.grades) {
    json["grades"][grades.name] = matrix_json(
        picture, [&](std::size_t o, std::size_t n) { return grades.values[o * picture.new_names.size() + n]; });
  }
  constexpr const char* kExplanations[] = {"stay", "move", "newview"};
  for (std::size_t k = 0; k < 3; ++k) {
    json["is"][kExplanations[k]] =
        matrix_json(picture, [&](std::size_t o, std::size_t n) { return picture.belief.pair(o, n)[k]; });
  }
  json["appear"] = Json::array();
  for (std::size_t n = 0; n < picture.new_names.size(); ++n) json["appear"].push_back(picture.belief.appeared(n));
  json["association"] = Json::object();
  json["explanation"] = Json::object();
  for (std::size_t n = 0; n < picture.new_names.size(); ++n) {
    const auto o = picture.resolution.association[n];
    json["association"][picture.new_names[n]] = o ? Json(picture.old_names[*o]) : Json();
  }
  for (std::size_t o = 0; o < picture.old_names.size(); ++o)
    json["explanation"][picture.old_names[o]] = to_string(picture.resolution.explanation[o]);
  return json;
}

int show(Session& session, const Showing& showing) {
  const bool from_dump = !showing.dump.empty();
  if (from_dump != showing.store.path.empty()) return session.error("needs either a STORE or --dump FILE"), kBadInput;
  const Drawn drawn = from_dump ? draw_trial(session, showing) : draw_scenes(session, showing);
  if (!drawn.picture) return drawn.code;
  const StepPicture& picture = *drawn.picture;
  if (!showing.svg.empty() && !session.write(showing.svg, step_svg(picture))) return kInternalError;
  if (!showing.html.empty() && !session.write(showing.html, step_html({&picture, 1}))) return kInternalError;
  const bool taken = showing.svg == "-" || showing.html == "-";
  return session.finish(kDone, taken ? "" : show_text(picture),
                        [&] { return to_text(show_json(picture, drawn.method)); });
}

int run_show(const Showing& showing) {
  Session session(showing.options);
  std::vector<std::string> outputs;
  for (const std::string& path : {showing.svg, showing.html}) {
    if (!path.empty()) outputs.push_back(path);
  }
  if (!session.check_options(outputs)) return kBadInput;
  return session.run(kSchema, [&] { return show(session, showing); });
}

}  // namespace

void add_track_show(CLI::App& track, Action& action) {
  auto showing = std::make_shared<Showing>();
  CLI::App* command = track.add_subcommand(
      "show", "One step as matrices: what is similar and near, what is believed, and the explanation");
  command->add_option("STORE", showing->store.path, "The scene store")->type_name("");
  command->add_option("--wait", showing->store.wait_seconds, "For another program's lock (default 2)")
      ->type_name("S")
      ->check(number_within(0, 1e6));
  command->add_option("--scene", showing->scene, "The new scene (default: the newest one)")->type_name("ID");
  command->add_option("--against", showing->against, "The old scene (default: the one before)")->type_name("ID");
  command->add_option("--dump", showing->dump, "Instead of a store: what `track simulate --dump` wrote")
      ->type_name("FILE");
  command->add_option("--trial", showing->trial, "Which trial of it (default 0)")
      ->type_name("N")
      ->check(whole_number(std::numeric_limits<std::uint64_t>::max()));
  add_world_file_options(*command, showing->track);
  command
      ->add_option("--model", showing->model,
                   "paper: Table 1; learned (with --dump); or a file with its predicates (default paper)")
      ->type_name("paper|learned|FILE");
  command->add_option("--mapping", showing->mapping, "How stored clusters are compared (default identity)")
      ->type_name("identity|FILE");
  command->add_option("--svg", showing->svg, "The matrices as a picture")->type_name("FILE|-");
  command->add_option("--html", showing->html, "The matrices as a page")->type_name("FILE|-");
  add_inference_options(*command, showing->options);
  add_common_options(*command, showing->options);
  command->callback([showing, &action] { action = [showing] { return run_show(*showing); }; });
}

}  // namespace sherlog::cli
