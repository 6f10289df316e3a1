// MC-SAT: marginals by slice sampling over whole ground formulas, with Gibbs and joint-block moves between the slices.
//
// Idea      A slice step alone mixes too slowly between strong opposing weights: the world keeps nearly all it satisfies. Every
//           slice step is therefore followed by a Gibbs sweep and joint draws of bounded width; all three leave the
//           distribution unchanged, so any mixture of them does.
// See       sampler.h (the loop, its output and errors), slice.h, joint_block.h
#pragma once

#include "inference/inference.h"

namespace sherlog {

MethodResult run_mcsat(const MethodContext& context);

}  // namespace sherlog
