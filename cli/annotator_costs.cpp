#include "cli/annotator_costs.h"

#include <fmt/format.h>

#include <charconv>
#include <cmath>
#include <nlohmann/json.hpp>
#include <sstream>

#include "mln/parser.h"

namespace sherlog::cli {
namespace {

// Mean run times in seconds, from the table of run times of the perception system that the fusion model was made for:
// features from normals 0.2656, small objects (found by colour) 0.7414, clusters and their boxes 1.5138, a request to Goggles
// 4.9457. It has no template detector: a guess.
constexpr std::pair<const char*, double> kDefaults[] = {
    {"shape", 0.2656},        {"color", 0.7414},           {"size", 1.5138},
    {"linemod", 1.0},         {"goggles", 4.9457},         {"goggles_Text", 4.9457},
    {"goggles_Logo", 4.9457}, {"goggles_Product", 4.9457}, {"goggles_Contact", 4.9457},
};

// Statements of one file, in whichever of its two forms.
class CostReader {
 public:
  CostReader(const Model& model, std::uint32_t file, Diagnostics& diagnostics)
      : model_(model), file_(file), diagnostics_(diagnostics) {
    for (const Predicate& predicate : model.predicates()) names_.push_back(predicate.name);
  }

  void read_lines(const std::string& text) {
    std::istringstream lines(text);
    std::string line;
    for (std::uint32_t number = 1; std::getline(lines, line); ++number) {
      const Place place{file_, number, 1, 1};
      std::istringstream words(line);
      std::string name, seconds;
      if (!(words >> name) || name[0] == '#' || name.starts_with("//")) continue;
      words >> seconds;
      std::vector<std::string> predicates;
      for (std::string word; words >> word && word[0] != '#' && !word.starts_with("//");) predicates.push_back(word);
      double value = 0;
      const auto [end, error] = std::from_chars(seconds.data(), seconds.data() + seconds.size(), value);
      if (error != std::errc() || end != seconds.data() + seconds.size()) {
        diagnostics_.error("annotator-cost", place,
                           fmt::format("annotator '{}': '{}' is not a number of seconds", name, seconds));
        continue;
      }
      add(name, value, predicates, place);
    }
  }

  void read_json(const std::string& text) {
    const Place place{file_, 1, 1, 1};
    const auto document = nlohmann::ordered_json::parse(text, nullptr, false, true);
    if (!document.is_object()) {
      diagnostics_.error("annotator-cost", place, "this is not a JSON object of annotators");
      return;
    }
    for (const auto& [name, entry] : document.items()) {
      const bool is_object = entry.is_object() && entry.contains("seconds");
      const auto& seconds = is_object ? entry["seconds"] : entry;
      std::vector<std::string> predicates;
      bool good = seconds.is_number();
      if (is_object && entry.contains("predicates")) {
        good = good && entry["predicates"].is_array();
        for (const auto& predicate : entry["predicates"]) {
          good = good && predicate.is_string();
          if (good) predicates.push_back(predicate.template get<std::string>());
        }
      }
      if (good) {
        add(name, seconds.template get<double>(), predicates, place);
      } else {
        diagnostics_.error("annotator-cost", place,
                           fmt::format("annotator '{}': expected seconds, or {{\"seconds\": ..., \"predicates\": "
                                       "[...]}}",
                                       name));
      }
    }
  }

  std::vector<AnnotatorCost> annotators;

 private:
  void add(const std::string& name, double seconds, std::vector<std::string> predicates, const Place& place) {
    if (!(seconds > 0.0) || !std::isfinite(seconds)) {
      diagnostics_.error("annotator-cost", place,
                         fmt::format("annotator '{}': {} seconds; a run time is above 0", name, seconds));
      return;
    }
    for (const AnnotatorCost& other : annotators) {
      if (other.name != name) continue;
      diagnostics_.error("annotator-cost", place, fmt::format("annotator '{}' stands here twice", name));
      return;
    }
    if (predicates.empty()) predicates.push_back(name);
    AnnotatorCost annotator{name, seconds, {}};
    for (const std::string& predicate : predicates) {
      const auto id = model_.find_predicate(predicate);
      if (!id) {
        const std::string nearest = did_you_mean(predicate, names_);
        diagnostics_.error("unknown-predicate", place,
                           fmt::format("annotator '{}' reports '{}', which the model does not declare{}", name,
                                       predicate, nearest.empty() ? "" : fmt::format("; did you mean '{}'?", nearest)));
        return;
      }
      annotator.predicates.push_back(*id);
    }
    annotators.push_back(std::move(annotator));
  }

  const Model& model_;
  std::uint32_t file_;
  Diagnostics& diagnostics_;
  std::vector<std::string> names_;
};

}  // namespace

std::vector<AnnotatorCost> default_annotators(const Model& model) {
  std::vector<AnnotatorCost> result;
  for (const auto& [name, seconds] : kDefaults) {
    if (const auto predicate = model.find_predicate(name)) result.push_back({name, seconds, {*predicate}});
  }
  return result;
}

std::optional<std::vector<AnnotatorCost>> parse_annotators(const Model& model, const std::string& text,
                                                           const std::string& name, Diagnostics& diagnostics) {
  const std::size_t errors = diagnostics.error_count();
  CostReader reader(model, diagnostics.sources().add(name, text), diagnostics);
  const std::size_t first = text.find_first_not_of(" \t\r\n");
  if (first != std::string::npos && text[first] == '{') {
    reader.read_json(text);
  } else {
    reader.read_lines(text);
  }
  if (diagnostics.error_count() > errors) return std::nullopt;
  return std::move(reader.annotators);
}

std::optional<std::vector<AnnotatorCost>> read_annotators(const Model& model, const std::string& path,
                                                          Diagnostics& diagnostics) {
  const auto text = read_text_file(path, diagnostics);
  if (!text) return std::nullopt;
  return parse_annotators(model, *text, path, diagnostics);
}

}  // namespace sherlog::cli
