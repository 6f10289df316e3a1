#include "inference/gibbs.h"

#include "inference/sampler.h"

namespace sherlog {

MethodResult run_gibbs(const MethodContext& context) { return sample(context, Kernel::kGibbs); }

}  // namespace sherlog
