// How probable it is what happens to one object in so many actions.
#pragma once

#include "perception_bridge/four_tables.h"

namespace sherlog {

// Of an object that was on a table at first.
struct ObjectFates {
  double untouched = 0, moved = 0, changed = 0, moved_and_changed = 0;  // and is on a table now
  double gone = 0;
  double put = 0;  // of an object that was on none at first: is on one now
};

// Exactly, by a Markov chain over what has happened to the object so far and how many objects are on tables.
ObjectFates object_fates(const FourTablesConfig& config);

}  // namespace sherlog
