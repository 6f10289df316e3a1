// What somebody asks of perception: {"detect": {"shape": "box", "color": ["red", "blue"]}}.
//
// Idea      A verb with an object of conditions, as RoboSherlock has it. A condition needs annotations of a type,
//           which the flow is planned from, and holds for a thing where one of the texts at a pointer is the asked one
//           (or one of those), upper and lower case alike. {"detect": {}} asks for everything about everything.
// Errors    a sentence that names the key and what there is
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "perception_bridge/scene.h"

namespace sherlog::rgbd {

// A key of requests: the types that it is about, separated by blanks, and the fields of each.
// To add one: a line in request.cpp.
struct RequestKey {
  std::string_view key, type, pointer;
};
const std::vector<RequestKey>& request_keys();

struct Request {
  struct Condition {
    std::string key;
    std::vector<std::string> values;  // one of them, in lower case
  };
  std::vector<Condition> conditions;

  bool wants_everything() const { return conditions.empty(); }
  // Types of annotations that are needed for an answer.
  std::vector<std::string> types() const;
  bool accepts(const Cluster& cluster) const;
};

std::optional<Request> parse_request(std::string_view text, std::string& problem);

// The designators that answer, as RoboSherlock writes them: one object for each thing.
Value answer_to(const Request& request, const sherlog::Scene& scene);

}  // namespace sherlog::rgbd
