// What synthetic frames know: the truth beside what was perceived.
//
// Idea      A thing that was found is the object that most of its pixels show. Labels are annotations like others, which no
//           annotator, mapping or model reads unless it is told to learn from them.
#pragma once

#include "rgbd/objects/hypotheses.h"
#include "rgbd/pipeline/perception.h"
#include "rgbd/synthetic/sequences.h"

namespace sherlog::rgbd {

// Nothing where its pixels show no object.
const Entity* entity_of(const Hypothesis& thing, const TrueFrame& truth);

// rs.annotation.GroundTruth for every cluster of the scene that is an object: its name and class.
void add_labels(Perceived& perceived, const TrueFrame& truth);

}  // namespace sherlog::rgbd
