// The texts of models/identity_resolution, built into the library: a program finds them wherever it runs.
#pragma once

#include <string_view>

namespace sherlog {

std::string_view paper_identity_model();     // table1.mln
std::string_view scenes_identity_model();    // scenes.mln
std::string_view learned_identity_model();   // learned.mln
std::string_view identity_learning_model();  // learning.mln

}  // namespace sherlog
