#include "rgbd/pipeline/analysis.h"

#include <algorithm>

#include "perception_bridge/annotation_types.h"

namespace sherlog::rgbd {
namespace {

bool is_among(std::span<const std::string> names, std::string_view type) {
  return std::ranges::any_of(names, [&](const std::string& name) { return is_annotation_of(type, name); });
}

}  // namespace

void Analysis::annotate(std::size_t cluster, Annotation annotation) {
  if (cluster != kScene) clusters_ = std::max(clusters_, cluster + 1);
  entries_.push_back({cluster, std::make_shared<const Annotation>(std::move(annotation))});
}

std::vector<const Annotation*> Analysis::annotations_of(std::size_t cluster, std::string_view type) const {
  std::vector<const Annotation*> found;
  for (const Entry& entry : entries_) {
    if (entry.cluster == cluster && is_annotation_of(entry.annotation->type, type)) {
      found.push_back(entry.annotation.get());
    }
  }
  return found;
}

std::vector<const Annotation*> Analysis::annotations(std::size_t cluster) const {
  std::vector<const Annotation*> found;
  for (const Entry& entry : entries_) {
    if (entry.cluster == cluster) found.push_back(entry.annotation.get());
  }
  return found;
}

Analysis Analysis::part(std::span<const std::string> names) const {
  Analysis result;
  for (const std::string& name : names) {
    if (const auto found = views_.find(name); found != views_.end()) result.views_.insert(*found);
  }
  for (const Entry& entry : entries_) {
    if (is_among(names, entry.annotation->type)) result.entries_.push_back(entry);
  }
  result.clusters_ = clusters_;
  return result;
}

std::vector<std::string> Analysis::beyond(std::span<const std::string> names) const {
  std::vector<std::string> result;
  for (const auto& [name, value] : views_) {
    if (std::ranges::find(names, name) == names.end()) result.push_back(name);
  }
  for (const Entry& entry : entries_) {
    const std::string& type = entry.annotation->type;
    if (!is_among(names, type) && std::ranges::find(result, type) == result.end()) result.push_back(type);
  }
  return result;
}

void Analysis::merge(const Analysis& other) {
  for (const auto& [name, value] : other.views_) views_.insert_or_assign(name, value);
  entries_.insert(entries_.end(), other.entries_.begin(), other.entries_.end());
  clusters_ = std::max(clusters_, other.clusters_);
}

}  // namespace sherlog::rgbd
