// The structure that all annotators of a frame share: views of the data, and what was said about it.
//
// Idea      A blackboard of values that are never changed once they are there: images, clouds, a table under their
//           names, and annotations in an index by cluster and type. A copy shares everything, so an annotator is given
//           a part of the blackboard (what it declares to read) and hands back another one (what it adds), and nobody
//           needs a lock.
// Source    the CAS of the UIMA standard as in Beetz et al., RoboSherlock, ICRA 2015, section 3; deliverable 2:
//           subjects of analysis are views here, index repositories annotations_of()
#pragma once

#include <any>
#include <limits>
#include <map>
#include <memory>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "perception_bridge/scene.h"

namespace sherlog::rgbd {

class Analysis {
 public:
  static constexpr std::size_t kScene = std::numeric_limits<std::size_t>::max();  // "cluster" of what is said of all

  // A value of any type under a name; one that is there is replaced.
  template <class T>
  void set(std::string name, T value) {
    views_.insert_or_assign(std::move(name), std::make_shared<const std::any>(std::move(value)));
  }
  bool has(std::string_view name) const { return views_.find(name) != views_.end(); }
  // Null pointer: there is none of that name, or it is of another type.
  template <class T>
  const T* view(std::string_view name) const {
    const auto found = views_.find(name);
    return found == views_.end() ? nullptr : std::any_cast<T>(found->second.get());
  }
  // For annotators, who may throw.
  template <class T>
  const T& need(std::string_view name) const {
    const T* value = view<T>(name);
    if (value == nullptr) throw std::runtime_error("there is no view '" + std::string(name) + "'");
    return *value;
  }

  // About the cluster of that number, or kScene.
  void annotate(std::size_t cluster, Annotation annotation);
  // Those of that type and of types below it, in the order in which they came.
  std::vector<const Annotation*> annotations_of(std::size_t cluster, std::string_view type) const;
  std::vector<const Annotation*> annotations(std::size_t cluster) const;
  // One more than the largest number of a cluster that something was said of.
  std::size_t clusters() const { return clusters_; }

  // Views of these names, annotations of these types and below.
  Analysis part(std::span<const std::string> names) const;
  // Names of views, and types of annotations, that are here and not among `names`.
  std::vector<std::string> beyond(std::span<const std::string> names) const;
  // Adds what the other one has.
  void merge(const Analysis& other);

 private:
  struct Entry {
    std::size_t cluster = 0;
    std::shared_ptr<const Annotation> annotation;
  };
  std::map<std::string, std::shared_ptr<const std::any>, std::less<>> views_;
  std::vector<Entry> entries_;
  std::size_t clusters_ = 0;
};

// Names with a dot are types of annotations (rs.annotation.Shape), others are views (depth).
inline bool is_type_name(std::string_view name) { return name.find('.') != std::string_view::npos; }

}  // namespace sherlog::rgbd
