// Annotators that are described and not there: RoboSherlock's files, for plans of pipelines that run elsewhere.
//
// Format    YAML, one annotator a file:
//             annotator:
//               name: PrimitiveShapeAnnotator
//             capabilities:
//               inputs: ['rs.scene.MergedCluster']
//               outputs:
//                 - rs.annotation.Shape: [box, round, flat]   # or the name alone
//               domain: [box, round, flat]                    # of the only output, where it has no values of its own
//           Everything else, such as parameters, is the annotator's own business. An analysis engine is a file with a
//           list `fixedflow` of names.
// Source    RoboSherlock's descriptors/annotators and descriptors/analysis_engines
// Errors    a sentence, with file, line and column where there are some: what is no YAML or of another form; several
//           documents; a key or a name that is there twice. Warnings: keys of `capabilities` that mean nothing here
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "rgbd/pipeline/flow.h"

namespace sherlog::rgbd {

// These files, and all .yaml and .yml files below folders in the order of their paths (below linked folders none); each once.
std::optional<std::vector<std::string>> find_capability_files(std::span<const std::string> paths, std::string& problem);

// Of these files, but for analysis engines. They can be planned with; process() throws.
std::optional<Annotators> read_capabilities(std::span<const std::string> files, std::vector<std::string>& warnings,
                                            std::string& problem);

// The names in an analysis engine's fixed flow.
std::optional<std::vector<std::string>> read_analysis_engine(const std::string& file, std::string& problem);

}  // namespace sherlog::rgbd
