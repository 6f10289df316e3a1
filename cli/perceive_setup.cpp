// The options of sherlog perceive, read and made into annotators; and plans of them.
#include <fmt/format.h>

#include <algorithm>
#include <filesystem>

#include "cli/perceive.h"
#include "cli/report.h"
#include "cli/scenes.h"
#include "cli/table.h"
#include "mln/text_file.h"
#include "rgbd/pipeline/capabilities.h"
#include "rgbd/pipeline/people_annotators.h"

namespace sherlog::cli {
namespace {

// The name of an analysis engine's file; nothing: --flow has names of annotators, or is not there.
std::optional<std::string> engine_of(const PerceiveArguments& arguments) {
  if (arguments.flow.size() != 1) return std::nullopt;
  const auto extension = std::filesystem::path(arguments.flow[0]).extension();
  return extension == ".yaml" || extension == ".yml" ? std::optional(arguments.flow[0]) : std::nullopt;
}

std::optional<std::string> read_file(Session& session, const char* option, const std::string& path) {
  TextFile file = load_text_file(path);
  if (!file.text) session.error(fmt::format("{} '{}': {}", option, path, file.problem));
  return std::move(file.text);
}

template <class T>
bool parse_knowledge(Session& session, const char* option, const std::string& path, const std::string& text,
                     std::optional<T> (*parse)(std::string_view, std::string&), T& target) {
  std::string problem;
  auto parsed = parse(text, problem);
  if (!parsed) return session.error(fmt::format("{} '{}': {}", option, path, problem)), false;
  target = std::move(*parsed);
  return true;
}

// Sherlog's own, or those of --annotators.
std::optional<rgbd::Annotators> make_annotators(Session& session, const PerceiveArguments& arguments,
                                                const rgbd::Knowledge& knowledge) {
  if (arguments.annotators.empty()) {
    rgbd::Annotators annotators = rgbd::object_annotators(knowledge);
    if (!arguments.people) return annotators;
    for (auto& annotator : rgbd::people_annotators({.most_means = static_cast<std::size_t>(arguments.most_people)}))
      annotators.push_back(std::move(annotator));
    return annotators;
  }
  std::string problem;
  std::vector<std::string> warnings;
  const auto files = rgbd::find_capability_files(arguments.annotators, problem);
  auto annotators = files ? rgbd::read_capabilities(*files, warnings, problem) : std::nullopt;
  if (!annotators) return session.error(fmt::format("--annotators: {}", problem)), std::nullopt;
  for (const std::string& warning : warnings) session.warning(warning);
  return annotators;
}

}  // namespace

bool add_inputs(Session& session, const PerceiveArguments& arguments, std::vector<std::string>& inputs) {
  for (const std::string& file : {arguments.map, arguments.known, arguments.keys, engine_of(arguments).value_or("")}) {
    inputs.push_back(file);
  }
  std::erase(inputs, "");
  std::string problem;
  const auto files = rgbd::find_capability_files(arguments.annotators, problem);
  if (!files) return session.error(fmt::format("--annotators: {}", problem)), false;
  inputs.insert(inputs.end(), files->begin(), files->end());
  return true;
}

bool read_knowledge(Session& session, const PerceiveArguments& arguments, rgbd::Knowledge& knowledge) {
  if (!arguments.map.empty()) {
    const auto text = read_file(session, "--map", arguments.map);
    if (!text || !parse_knowledge(session, "--map", arguments.map, *text, rgbd::parse_map, knowledge.map) ||
        !parse_knowledge(session, "--map", arguments.map, *text, rgbd::parse_structure, knowledge.structure)) {
      return false;
    }
  }
  if (arguments.known.empty()) return true;
  const auto text = read_file(session, "--known", arguments.known);
  return text &&
         parse_knowledge(session, "--known", arguments.known, *text, rgbd::parse_known_things, knowledge.things);
}

bool read_request(Session& session, const PerceiveArguments& arguments, std::optional<rgbd::Request>& request) {
  if (arguments.query.empty()) return true;
  std::vector<rgbd::RequestKey> keys = rgbd::request_keys();
  std::string problem;
  if (!arguments.keys.empty()) {
    const auto text = read_file(session, "--keys", arguments.keys);
    if (!text) return false;
    auto parsed = rgbd::parse_request_keys(*text, problem);
    if (!parsed) return session.error(fmt::format("--keys '{}': {}", arguments.keys, problem)), false;
    keys = std::move(*parsed);
  }
  request = rgbd::parse_request(arguments.query, problem, keys);
  if (!request) session.error(fmt::format("--query: {}", problem));
  return request.has_value();
}

std::optional<rgbd::Perception> make_perception(Session& session, const PerceiveArguments& arguments,
                                                const rgbd::Knowledge& knowledge, const std::string& name,
                                                const std::optional<rgbd::Request>& request) {
  rgbd::PerceptionOptions options;
  options.threads = session.options().threads;
  options.log_times = !arguments.store.empty();
  options.prefix = arguments.prefix.empty() ? name + "-" : arguments.prefix;
  options.request = request;
  if (request && knowledge.things.empty() && arguments.annotators.empty()) {
    const auto needs_classes = [](const rgbd::Wanted& wanted) {
      return wanted.names == std::vector<std::string>{"rs.annotation.Classification"};
    };
    if (std::ranges::any_of(request->wanted(), needs_classes)) {
      session.error("--query: which classes of things there may be is not known; --known FILE says it");
      return std::nullopt;
    }
  }
  // A store and evidence take all that can be found.
  options.everything = !arguments.store.empty() || !arguments.evidence.empty();
  std::string problem;
  options.flow = arguments.flow;
  if (const auto engine = engine_of(arguments)) {
    auto names = rgbd::read_analysis_engine(*engine, problem);
    if (!names) return session.error(fmt::format("--flow: {}", problem)), std::nullopt;
    options.flow = std::move(*names);
  }
  if (arguments.people) options.also.emplace_back("sherlog.annotation.Person");
  auto annotators = make_annotators(session, arguments, knowledge);
  if (!annotators) return std::nullopt;
  auto perception = rgbd::Perception::make(std::move(*annotators), std::move(options), problem);
  if (!perception) return session.error(problem), std::nullopt;
  for (const std::string& warning : perception->flow().warnings) session.warning(warning);
  return perception;
}

bool StoreTarget::open() {
  if (store_) return true;
  StoreChoice choice;
  choice.path = path_;
  store_ = open_store(session_, choice, {});
  if (store_ && !store_->begin()) {
    session_.error(store_->problem());
    store_.reset();
  }
  return store_.has_value();
}

bool StoreTarget::open_if_there() {
  std::error_code error;
  const bool is_there = std::filesystem::exists(std::filesystem::symlink_status(path_, error));
  return !is_wanted() || !is_there || open();
}

int plan_perception(Session& session, const PerceiveArguments& arguments) {
  std::vector<std::string> inputs;
  if (!add_inputs(session, arguments, inputs) || !session.check_options({}, inputs)) return kBadInput;
  rgbd::Knowledge knowledge;
  std::optional<rgbd::Request> request;
  if (!read_knowledge(session, arguments, knowledge) || !read_request(session, arguments, request)) return kBadInput;
  if (!request && !arguments.annotators.empty()) request = rgbd::Request{};
  const auto perception = make_perception(session, arguments, knowledge, "plan", request);
  if (!perception) return kBadInput;
  const std::vector<std::string> names = perception->annotators();
  if (names.empty()) return session.error("nobody runs: no annotator writes annotations"), kBadInput;
  Table table({{"", Align::kRight}, {"annotator", Align::kLeft}, {"reads", Align::kLeft}, {"writes", Align::kLeft}});
  Json steps = Json::array();
  for (std::size_t step = 0; step < names.size(); ++step) {
    const rgbd::Annotator& annotator = perception->annotator(step);
    table.add_row({std::to_string(step + 1), names[step], fmt::format("{}", fmt::join(annotator.reads(), " ")),
                   fmt::format("{}", fmt::join(annotator.writes(), " "))});
    Json from = Json::array();
    for (const rgbd::Flow::Input& input : perception->flow().inputs[step]) {
      from.push_back({{"annotator", names[input.from]}, {"names", input.names}});
    }
    steps.push_back({{"annotator", names[step]},
                     {"reads", annotator.reads()},
                     {"writes", annotator.writes()},
                     {"from", std::move(from)}});
  }
  return session.finish(kDone, table.text(), [&] {
    return to_text(Json{{"schema", "sherlog.perceive/1"},
                        {"termination", to_string(Termination::kCompleted)},
                        {"annotators", names},
                        {"plan", steps},
                        {"warnings", perception->flow().warnings}});
  });
}

}  // namespace sherlog::cli
