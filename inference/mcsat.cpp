#include "inference/mcsat.h"

#include "inference/sampler.h"

namespace sherlog {

MethodResult run_mcsat(const MethodContext& context) { return sample(context, Kernel::kMcSat); }

}  // namespace sherlog
