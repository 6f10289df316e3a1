// An association that was not clear when it was made, kept as it was asked so that a later scene can settle it.
//
// Idea      Two equal cups change places behind the robot's back: each of the two clusters could be either. The tracker takes
//           the better explanation, keeps the question, and follows the clusters on. When a later look at one of them shows what
//           the earlier one did not (a number on its bottom), the earlier look is completed by it and the same question is asked
//           again. What is not comparable between the looks stays unclear, and nothing is guessed.
// Limits    A later look counts only as far as it is clear that it is of the same thing: over two unclear scenes in a row nothing
//           is passed back to the first one.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "perception_bridge/scene.h"

namespace sherlog {

struct OpenQuestion {
  struct Old {
    std::string object;
    Cluster look;  // as it was believed before the scene
    bool out_of_view = false;
  };
  Scene scene;  // its clusters gain what later looks at the same things show
  std::vector<Old> olds;
  std::vector<std::string> objects;  // by cluster: what it is taken for
  std::vector<bool> open;            // by cluster: something else is nearly as probable

  std::vector<Cluster> old_looks() const;
  std::vector<bool> out_of_view() const;
  // The old one of that name; nothing where the object came with this scene.
  const Old* old_of(const std::string& object) const;
};

// Adds to the earlier look what only the later one of the same thing shows: annotations of types that the earlier one lacks,
// except where the thing is. False where there is nothing of that kind.
bool complete_look(Cluster& earlier, const Cluster& later);

// For the store; what was read back is asked in the same way.
Value question_to_json(const OpenQuestion& question);
std::optional<OpenQuestion> question_from_json(const Value& document, std::string& problem);

}  // namespace sherlog
