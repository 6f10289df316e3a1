// One trial as a line of JSON.
#pragma once

#include <string>

#include "perception_bridge/identity_belief.h"

namespace sherlog {

// {"trial": 0, "seed": 1, "objects": 15, "noise": 0.05, "view": {...}, "actions": [...], "old": [...], "new": [...],
//  "truth": {...}, "result": {...}} with a line end. `with_seconds`: how long it took, which is no two times the same.
std::string trial_line(const FourTablesTrial& trial, const MatcherAnswer& answer, bool with_seconds = true);

}  // namespace sherlog
