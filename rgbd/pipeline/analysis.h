// The structure that all annotators of a frame share: views of the data, and what was said about it.
//
// Idea      A blackboard of values that are never changed once they are there: images, clouds, a table under their
//           names, and annotations in an index by cluster and type. A copy shares everything, so an annotator is given
//           a part of the blackboard (what it declares to read) and hands back another one (what it adds), and nobody
//           waits for anybody else.
// Threads   any number of them may add to one and read it: an annotator may share its own out among threads. What they say is
//           then in the order in which it came. Pointers that are handed out hold as long as the structure does, and of views
//           until one of that name is set again. Only what is moved from or assigned to has to be nobody else's.
// Source    the CAS of the UIMA standard as in Beetz et al., RoboSherlock, ICRA 2015, section 3; deliverable 2:
//           subjects of analysis are views here, index repositories annotations_of()
#pragma once

#include <any>
#include <limits>
#include <map>
#include <memory>
#include <mutex>
#include <shared_mutex>
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

  Analysis() = default;
  Analysis(const Analysis& other) : contents_(other.snapshot()) {}
  Analysis(Analysis&& other) noexcept : contents_(std::move(other.contents_)) {}
  Analysis& operator=(Analysis other) noexcept {
    contents_ = std::move(other.contents_);
    return *this;
  }
  ~Analysis() = default;

  // A value of any type under a name; one that is there is replaced.
  template <class T>
  void set(std::string name, T value) {
    set_view(std::move(name), std::make_shared<const std::any>(std::move(value)));
  }
  bool has(std::string_view name) const { return find_view(name) != nullptr; }
  // Null pointer: there is none of that name, or it is of another type.
  template <class T>
  const T* view(std::string_view name) const {
    return std::any_cast<T>(find_view(name).get());
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
  std::size_t clusters() const;

  // Views of these names, annotations of these types and below.
  Analysis part(std::span<const std::string> names) const;
  // Names of views, and types of annotations, that are here and not among `names`.
  std::vector<std::string> beyond(std::span<const std::string> names) const;
  // Adds what the other one has.
  void merge(const Analysis& other);

 private:
  using View = std::shared_ptr<const std::any>;
  struct Entry {
    std::size_t cluster = 0;
    std::shared_ptr<const Annotation> annotation;
  };
  struct Contents {
    std::map<std::string, View, std::less<>> views;
    std::vector<Entry> entries;
    std::size_t clusters = 0;
  };

  void set_view(std::string name, View view);
  View find_view(std::string_view name) const;  // null pointer: there is none
  Contents snapshot() const;

  mutable std::shared_mutex mutex_;
  Contents contents_;
};

// Names with a dot are types of annotations (rs.annotation.Shape), others are views (depth).
inline bool is_type_name(std::string_view name) { return name.find('.') != std::string_view::npos; }

}  // namespace sherlog::rgbd
