// One trial as a line of JSON.
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "perception_bridge/identity_belief.h"

namespace sherlog {

// {"trial": 0, "seed": 1, "objects": 15, "noise": 0.05, "view": {...}, "actions": [...], "old": [...], "new": [...],
//  "truth": {...}, "result": {...}} with a line end. `with_seconds`: how long it took, which is no two times the same.
std::string trial_line(const FourTablesTrial& trial, const MatcherAnswer& answer, bool with_seconds = true);

// The trial of such a line again: clusters, view, noise, actions and truth; the rest of the world is that of `config`. Nothing, and
// a sentence, where the line is something else.
std::optional<FourTablesTrial> trial_from_line(std::string_view line, const FourTablesConfig& config,
                                               std::string& problem);

}  // namespace sherlog
