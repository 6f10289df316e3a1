// What somebody asks of perception: {"detect": {"shape": "box", "color": ["red", "blue"]}}.
//
// Idea      A verb with an object of conditions, as RoboSherlock has it. A condition needs annotations of a type,
//           which the flow is planned from, and holds for a thing where one of the texts at a pointer is the asked one
//           (or one of those), upper and lower case alike. {"detect": {}} asks for everything about everything.
//             detect   the things that meet the conditions, with what the conditions are about
//             inspect  the same things with all that can be found out about them
//             scan     all that there is, with all that can be found out; it takes no conditions but the location
//             track    detect over time: a thing keeps its rs.annotation.Tracking id, which the caller gives
// Errors    a sentence that names the key and what there is
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "perception_bridge/scene.h"
#include "rgbd/pipeline/flow.h"

namespace sherlog::rgbd {

// A key of requests: a type of annotations that it is about, and the field. A key may have several of these.
struct RequestKey {
  std::string key, type, pointer;
};
const std::vector<RequestKey>& request_keys();
// RoboSherlock's query_specifications.ini: a section for each key, in it location=/rs.annotation.Shape/*/shape, alternatives
// with | between them. Nothing, and a sentence, where it is something else or says nothing.
std::optional<std::vector<RequestKey>> parse_request_keys(const std::string& text, std::string& problem);

struct Request {
  struct Condition {
    std::string key;
    std::vector<std::string> values;  // one of them, in lower case
  };
  enum class Verb : std::uint8_t { kDetect, kInspect, kScan, kTrack };
  Verb verb = Verb::kDetect;
  std::vector<RequestKey> keys;  // that there are
  std::vector<Condition> conditions;

  // Following a thing takes all of its looks.
  bool wants_everything() const { return conditions.empty() || verb != Verb::kDetect; }
  // Of each condition the types of annotations, one of which is needed for an answer, and the values asked for.
  std::vector<Wanted> wanted() const;
  bool accepts(const Cluster& cluster) const;
};

std::optional<Request> parse_request(std::string_view text, std::string& problem,
                                     const std::vector<RequestKey>& keys = request_keys());

// The designators that answer, as RoboSherlock writes them: one object for each thing.
Value answer_to(const Request& request, const sherlog::Scene& scene);

}  // namespace sherlog::rgbd
