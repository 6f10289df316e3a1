#include "rgbd/pipeline/capabilities.h"

#include <fmt/format.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <filesystem>
#include <map>
#include <stdexcept>

#include "mln/text_file.h"
#include "rgbd/pipeline/declared.h"

namespace sherlog::rgbd {
namespace {

namespace fs = std::filesystem;

using Names = std::vector<std::string>;
using Values = std::map<std::string, Names>;

class Described : public Declared {
 public:
  struct Capabilities {
    Names inputs, outputs;
    Values input_values, output_values;
  };
  Described(std::string name, Capabilities capabilities)
      : Declared(std::move(name), std::move(capabilities.inputs), std::move(capabilities.outputs), 1),
        read_values_(std::move(capabilities.input_values)) {
    for (auto& [type, values] : capabilities.output_values) set_written_values(type, std::move(values));
  }
  Names read_values(const std::string& type) const override { return find_or_none(read_values_, type); }
  void process(const Analysis& /*in*/, Analysis& /*out*/) override {
    throw std::logic_error("it is only described, and cannot run");
  }

 private:
  Values read_values_;
};

// One document. The first thing that is wrong with it ends the reading.
class Reader {
 public:
  explicit Reader(std::string file) : file_(std::move(file)) {}

  std::string problem;

  std::optional<YAML::Node> load() {
    const TextFile text = load_text_file(file_);
    if (!text.text) return problem = fmt::format("'{}': {}", file_, text.problem), std::nullopt;
    try {
      YAML::Node document = YAML::Load(*text.text);
      if (!document.IsMap()) return fail(document, "a map was expected, such as 'annotator: ...'"), std::nullopt;
      return document;
    } catch (const YAML::Exception& error) {
      return fail(error.mark, error.msg), std::nullopt;
    }
  }

  // A text that is no list or map and not empty.
  std::optional<std::string> text_of(const YAML::Node& node, const char* what) {
    if (node.IsDefined() && node.IsScalar() && !node.Scalar().empty()) return node.Scalar();
    return fail(node, fmt::format("{} was expected", what)), std::nullopt;
  }

  // What is missing or empty is an empty list.
  std::optional<Names> list_of(const YAML::Node& node, const char* what) {
    Names names;
    if (!is_list(node, what)) return std::nullopt;
    for (const YAML::Node& item : node) {
      auto name = text_of(item, what);
      if (!name) return std::nullopt;
      names.push_back(std::move(*name));
    }
    return names;
  }

  // Items are names, or maps from names to lists of values.
  bool read_types(const YAML::Node& node, Names& names, Values& values) {
    constexpr const char* kWhat = "a type's name, or a type's name with a list of values,";
    if (!is_list(node, kWhat)) return false;
    for (const YAML::Node& item : node) {
      if (!item.IsMap()) {
        auto name = text_of(item, kWhat);
        if (!name) return false;
        names.push_back(std::move(*name));
        continue;
      }
      for (const auto& entry : item) {
        auto name = text_of(entry.first, kWhat);
        auto list = name ? list_of(entry.second, "a value") : std::nullopt;
        if (!list) return false;
        values[*name] = std::move(*list);
        names.push_back(std::move(*name));
      }
    }
    return true;
  }

  std::optional<Described::Capabilities> capabilities_of(const YAML::Node& node) {
    Described::Capabilities result;
    if (!node.IsDefined() || node.IsNull()) return result;
    if (!node.IsMap()) return fail(node, "capabilities are a map with inputs and outputs"), std::nullopt;
    if (!read_types(node["inputs"], result.inputs, result.input_values) ||
        !read_types(node["outputs"], result.outputs, result.output_values)) {
      return std::nullopt;
    }
    auto domain = list_of(node["domain"], "a value");
    if (!domain) return std::nullopt;
    if (result.outputs.size() == 1 && result.output_values.empty()) {
      result.output_values[result.outputs[0]] = std::move(*domain);
    }
    return result;
  }

  void fail(const YAML::Node& node, const std::string& what) {
    fail(node.IsDefined() ? node.Mark() : YAML::Mark::null_mark(), what);
  }

 private:
  void fail(const YAML::Mark& mark, const std::string& what) {
    problem = mark.is_null() ? fmt::format("{}: {}", file_, what)
                             : fmt::format("{}:{}:{}: {}", file_, mark.line + 1, mark.column + 1, what);
  }

  bool is_list(const YAML::Node& node, const char* what) {
    if (!node.IsDefined() || node.IsNull() || node.IsSequence()) return true;
    fail(node, fmt::format("a list was expected; in it, {} each", what));
    return false;
  }

  std::string file_;
};

// False: there is a problem. `annotator` stays empty where the file is an analysis engine's.
bool read_annotator(const std::string& file, std::unique_ptr<Annotator>& annotator, std::string& problem) {
  Reader reader(file);
  const auto fail = [&] { return problem = reader.problem, false; };
  const auto document = reader.load();
  if (!document) return fail();
  if ((*document)["fixedflow"].IsDefined()) return true;
  const YAML::Node about = (*document)["annotator"];
  if (!about.IsDefined() || !about.IsMap()) {
    reader.fail(about.IsDefined() ? about : *document, "'annotator:' with a name was expected");
    return fail();
  }
  if (!about["name"].IsDefined()) return reader.fail(about, "the annotator has no name"), fail();
  const auto name = reader.text_of(about["name"], "the annotator's name");
  if (!name) return fail();
  auto capabilities = reader.capabilities_of((*document)["capabilities"]);
  if (!capabilities) return fail();
  annotator = std::make_unique<Described>(*name, std::move(*capabilities));
  return true;
}

// The files that a path stands for, at the end of `files`.
bool add_files(const std::string& path, Names& files, std::string& problem) {
  std::error_code error;
  if (!fs::is_directory(path, error)) return files.push_back(path), true;
  const std::size_t before = files.size();
  for (fs::recursive_directory_iterator entry(path, error), end; !error && entry != end; entry.increment(error)) {
    const fs::path extension = entry->path().extension();
    std::error_code no_file;
    if ((extension == ".yaml" || extension == ".yml") && entry->is_regular_file(no_file))
      files.push_back(entry->path());
  }
  if (error) return problem = fmt::format("'{}': {}", path, error.message()), false;
  if (files.size() == before) return problem = fmt::format("'{}' has no .yaml files", path), false;
  std::sort(files.begin() + static_cast<std::ptrdiff_t>(before), files.end());
  return true;
}

}  // namespace

std::optional<Annotators> read_capabilities(std::span<const std::string> paths, std::string& problem) {
  Names files;
  for (const std::string& path : paths) {
    if (!add_files(path, files, problem)) return std::nullopt;
  }
  Annotators annotators;
  std::map<std::string, std::string> file_of;
  for (const std::string& file : files) {
    std::unique_ptr<Annotator> annotator;
    if (!read_annotator(file, annotator, problem)) return std::nullopt;
    if (!annotator) continue;
    const auto [other, is_new] = file_of.emplace(annotator->name(), file);
    if (!is_new) {
      problem = fmt::format("{}: the annotator '{}' is in {} too", file, annotator->name(), other->second);
      return std::nullopt;
    }
    annotators.push_back(std::move(annotator));
  }
  if (annotators.empty())
    return problem = fmt::format("{}: no annotator is described there", fmt::join(paths, ", ")), std::nullopt;
  return annotators;
}

std::optional<Names> read_analysis_engine(const std::string& file, std::string& problem) {
  Reader reader(file);
  const auto document = reader.load();
  if (!document) return problem = reader.problem, std::nullopt;
  const YAML::Node flow = (*document)["fixedflow"];
  if (!flow.IsDefined() || !flow.IsSequence() || flow.size() == 0) {
    reader.fail(flow.IsDefined() ? flow : *document, "'fixedflow:' with a list of annotators was expected");
    return problem = reader.problem, std::nullopt;
  }
  auto names = reader.list_of(flow, "an annotator's name");
  if (!names) problem = reader.problem;
  return names;
}

}  // namespace sherlog::rgbd
