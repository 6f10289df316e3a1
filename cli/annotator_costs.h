// What annotators cost: read from a file, or the built-in table.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "inference/advice.h"
#include "mln/diagnostics.h"
#include "mln/model.h"

namespace sherlog::cli {

// The built-in table, without the predicates that the model does not declare.
std::vector<AnnotatorCost> default_annotators(const Model& model);

// Lines `name seconds [predicate ...]` (comments: // and #), or JSON {"name": seconds} and {"name": {"seconds": s,
// "predicates": [...]}}. An annotator without predicates reports the one of its name. Errors go to `diagnostics`.
std::optional<std::vector<AnnotatorCost>> read_annotators(const Model& model, const std::string& path,
                                                          Diagnostics& diagnostics);
std::optional<std::vector<AnnotatorCost>> parse_annotators(const Model& model, const std::string& text,
                                                           const std::string& name, Diagnostics& diagnostics);

}  // namespace sherlog::cli
