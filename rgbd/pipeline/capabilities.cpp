#include "rgbd/pipeline/capabilities.h"

#include <fmt/format.h>
#include <yaml-cpp/depthguard.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <filesystem>
#include <map>
#include <set>
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
  Names warnings;

  std::optional<YAML::Node> load() {
    std::error_code error;
    if (fs::exists(file_, error) && !fs::is_regular_file(file_, error)) {  // a pipe would be waited for
      return problem = fmt::format("'{}' is no file", file_), std::nullopt;
    }
    const TextFile text = load_text_file(file_);
    if (!text.text) return problem = fmt::format("'{}': {}", file_, text.problem), std::nullopt;
    try {
      const std::vector<YAML::Node> documents = YAML::LoadAll(*text.text);
      if (documents.size() > 1) return fail(documents[1], "a second document; one was expected"), std::nullopt;
      YAML::Node document = documents.empty() ? YAML::Node() : documents[0];
      if (!document.IsMap()) return fail(document, "a map was expected, such as 'annotator: ...'"), std::nullopt;
      if (!has_distinct_keys(document)) return std::nullopt;
      return document;
    } catch (const YAML::DeepRecursion& failure) {
      return fail(failure.mark, "lists and maps are nested too deeply"), std::nullopt;
    } catch (const YAML::Exception& failure) {
      return fail(failure.mark, failure.msg), std::nullopt;
    }
  }

  // False: a key is no text, or there twice.
  bool has_distinct_keys(const YAML::Node& map) {
    std::set<std::string> keys;
    for (const auto& entry : map) {
      const auto key = text_of(entry.first, "a key");
      if (!key) return false;
      if (!keys.insert(*key).second) return fail(entry.first, fmt::format("'{}' is there twice", *key)), false;
    }
    return true;
  }

  // A text that is no list or map and not empty, and may stand in messages.
  std::optional<std::string> text_of(const YAML::Node& node, const char* what) {
    const auto is_control = [](char c) { return static_cast<unsigned char>(c) < 32 || c == 127; };
    const bool is_text = node.IsDefined() && node.IsScalar() && !node.Scalar().empty();
    if (is_text && std::ranges::none_of(node.Scalar(), is_control)) return node.Scalar();
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

  std::optional<Described::Capabilities> capabilities_of(const YAML::Node& node) {
    Described::Capabilities result;
    if (!node.IsDefined() || node.IsNull()) return result;
    if (!node.IsMap()) return fail(node, "capabilities are a map with inputs and outputs"), std::nullopt;
    if (!has_distinct_keys(node)) return std::nullopt;
    for (const auto& entry : node) {
      const std::string& key = entry.first.Scalar();
      if (key == "inputs" || key == "outputs" || key == "domain") continue;
      warnings.push_back(at(entry.first.Mark(), fmt::format("'{}' is none of inputs, outputs and domain", key)));
    }
    if (!read_types(node["inputs"], result.inputs, result.input_values) ||
        !read_types(node["outputs"], result.outputs, result.output_values)) {
      return std::nullopt;
    }
    auto domain = list_of(node["domain"], "a value");
    if (!domain) return std::nullopt;
    if (result.outputs.size() == 1 && result.output_values.empty()) {
      result.output_values[result.outputs[0]] = std::move(*domain);
    } else if (!domain->empty() && result.output_values.empty()) {
      warnings.push_back(at(node["domain"].Mark(), "which of the outputs has the domain is not said: none gets it"));
    }
    return result;
  }

  void fail(const YAML::Node& node, const std::string& what) {
    fail(node.IsDefined() ? node.Mark() : YAML::Mark::null_mark(), what);
  }

 private:
  // Items are names, or maps from names to lists of values.
  bool read_types(const YAML::Node& node, Names& names, Values& values) {
    constexpr const char* kWhat = "a type's name, or a type's name with a list of values,";
    if (!is_list(node, kWhat)) return false;
    std::set<std::string> has_any;  // whatever values it has elsewhere
    const auto add = [&](const std::string& name, const Names& list) {
      if (std::ranges::find(names, name) == names.end()) names.push_back(name);
      if (list.empty()) has_any.insert(name);
      values[name].insert(values[name].end(), list.begin(), list.end());
    };
    for (const YAML::Node& item : node) {
      if (!item.IsMap()) {
        const auto name = text_of(item, kWhat);
        if (!name) return false;
        add(*name, {});
        continue;
      }
      for (const auto& entry : item) {
        const auto name = text_of(entry.first, kWhat);
        const auto list = name ? list_of(entry.second, "a value") : std::nullopt;
        if (!list) return false;
        add(*name, *list);
      }
    }
    for (const std::string& name : has_any) values.erase(name);
    return true;
  }

  void fail(const YAML::Mark& mark, const std::string& what) { problem = at(mark, what); }

  std::string at(const YAML::Mark& mark, const std::string& what) const {
    return mark.is_null() ? fmt::format("{}: {}", file_, what)
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
bool read_annotator(const std::string& file, std::unique_ptr<Annotator>& annotator, Names& warnings,
                    std::string& problem) {
  Reader reader(file);
  const auto fail = [&] { return problem = reader.problem, false; };
  const auto document = reader.load();
  if (!document) return fail();
  const YAML::Node about = (*document)["annotator"];
  if (!about.IsDefined() && (*document)["fixedflow"].IsDefined()) return true;
  if (!about.IsDefined() || !about.IsMap()) {
    reader.fail(about.IsDefined() ? about : *document, "'annotator:' with a name was expected");
    return fail();
  }
  if (!reader.has_distinct_keys(about)) return fail();
  if (!about["name"].IsDefined()) return reader.fail(about, "the annotator has no name"), fail();
  const auto name = reader.text_of(about["name"], "the annotator's name");
  if (!name) return fail();
  auto capabilities = reader.capabilities_of((*document)["capabilities"]);
  if (!capabilities) return fail();
  warnings.insert(warnings.end(), reader.warnings.begin(), reader.warnings.end());
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
    std::error_code no_folder;
    if ((extension == ".yaml" || extension == ".yml") && !entry->is_directory(no_folder)) {
      files.push_back(entry->path());
    }
  }
  if (error) return problem = fmt::format("'{}', or a folder in it: {}", path, error.message()), false;
  if (files.size() == before) return problem = fmt::format("'{}' has no .yaml files", path), false;
  std::sort(files.begin() + static_cast<std::ptrdiff_t>(before), files.end());
  return true;
}

}  // namespace

std::optional<Names> find_capability_files(std::span<const std::string> paths, std::string& problem) {
  Names all, files;
  std::set<fs::path> seen;
  for (const std::string& path : paths) {
    if (!add_files(path, all, problem)) return std::nullopt;
  }
  for (std::string& file : all) {
    std::error_code error;
    const fs::path canonical = fs::weakly_canonical(file, error);
    if (seen.insert(error ? fs::path(file) : canonical).second) files.push_back(std::move(file));
  }
  return files;
}

std::optional<Annotators> read_capabilities(std::span<const std::string> files, Names& warnings, std::string& problem) {
  Annotators annotators;
  std::map<std::string, std::string> file_of;
  for (const std::string& file : files) {
    std::unique_ptr<Annotator> annotator;
    if (!read_annotator(file, annotator, warnings, problem)) return std::nullopt;
    if (!annotator) continue;
    const auto [other, is_new] = file_of.emplace(annotator->name(), file);
    if (!is_new) {
      problem = fmt::format("{}: the annotator '{}' is in {} too", file, annotator->name(), other->second);
      return std::nullopt;
    }
    annotators.push_back(std::move(annotator));
  }
  if (annotators.empty()) {
    return problem = fmt::format("no annotator is described in {}", fmt::join(files, ", ")), std::nullopt;
  }
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
