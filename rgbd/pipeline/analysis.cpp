#include "rgbd/pipeline/analysis.h"

#include <algorithm>

#include "perception_bridge/annotation_types.h"

namespace sherlog::rgbd {
namespace {

bool is_among(std::span<const std::string> names, std::string_view type) {
  return std::ranges::any_of(names, [&](const std::string& name) { return is_annotation_of(type, name); });
}

}  // namespace

void Analysis::set_view(std::string name, View view) {
  const std::unique_lock lock(mutex_);
  contents_.views.insert_or_assign(std::move(name), std::move(view));
}

Analysis::View Analysis::find_view(std::string_view name) const {
  const std::shared_lock lock(mutex_);
  const auto found = contents_.views.find(name);
  return found == contents_.views.end() ? nullptr : found->second;
}

Analysis::Contents Analysis::snapshot() const {
  const std::shared_lock lock(mutex_);
  return contents_;
}

void Analysis::annotate(std::size_t cluster, Annotation annotation) {
  auto shared = std::make_shared<const Annotation>(std::move(annotation));
  const std::unique_lock lock(mutex_);
  if (cluster != kScene) contents_.clusters = std::max(contents_.clusters, cluster + 1);
  contents_.entries.push_back({cluster, std::move(shared)});
}

std::vector<const Annotation*> Analysis::annotations_of(std::size_t cluster, std::string_view type) const {
  const std::shared_lock lock(mutex_);
  std::vector<const Annotation*> found;
  for (const Entry& entry : contents_.entries) {
    if (entry.cluster == cluster && is_annotation_of(entry.annotation->type, type)) {
      found.push_back(entry.annotation.get());
    }
  }
  return found;
}

std::vector<const Annotation*> Analysis::annotations(std::size_t cluster) const {
  const std::shared_lock lock(mutex_);
  std::vector<const Annotation*> found;
  for (const Entry& entry : contents_.entries) {
    if (entry.cluster == cluster) found.push_back(entry.annotation.get());
  }
  return found;
}

std::size_t Analysis::clusters() const {
  const std::shared_lock lock(mutex_);
  return contents_.clusters;
}

Analysis Analysis::part(std::span<const std::string> names) const {
  const std::shared_lock lock(mutex_);
  Analysis result;
  for (const std::string& name : names) {
    if (const auto found = contents_.views.find(name); found != contents_.views.end()) {
      result.contents_.views.insert(*found);
    }
  }
  for (const Entry& entry : contents_.entries) {
    if (is_among(names, entry.annotation->type)) result.contents_.entries.push_back(entry);
  }
  result.contents_.clusters = contents_.clusters;
  return result;
}

std::vector<std::string> Analysis::beyond(std::span<const std::string> names) const {
  const std::shared_lock lock(mutex_);
  std::vector<std::string> result;
  for (const auto& [name, value] : contents_.views) {
    if (std::ranges::find(names, name) == names.end()) result.push_back(name);
  }
  for (const Entry& entry : contents_.entries) {
    const std::string& type = entry.annotation->type;
    if (!is_among(names, type) && std::ranges::find(result, type) == result.end()) result.push_back(type);
  }
  return result;
}

void Analysis::merge(const Analysis& other) {
  Contents added = other.snapshot();  // first, so that two locks are never held at once
  const std::unique_lock lock(mutex_);
  for (auto& [name, value] : added.views) contents_.views.insert_or_assign(name, std::move(value));
  contents_.entries.insert(contents_.entries.end(), added.entries.begin(), added.entries.end());
  contents_.clusters = std::max(contents_.clusters, added.clusters);
}

}  // namespace sherlog::rgbd
