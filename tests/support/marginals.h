// Marginals by way of the front door: a model and evidence as text, answered by `exact`.
#pragma once

#include <gtest/gtest.h>

#include <map>
#include <string>
#include <vector>

#include "grounding/ground.h"
#include "inference/inference.h"
#include "mln/evidence.h"
#include "mln/model.h"
#include "mln/query.h"

namespace sherlog {

// By the atom's text.
inline std::map<std::string, double> exact_marginals(const std::string& model_text, const std::string& evidence_text,
                                                     const std::vector<std::string>& query_texts) {
  std::map<std::string, double> found;
  Diagnostics diagnostics;
  const auto model = parse_model(model_text, "model.mln", diagnostics);
  EXPECT_TRUE(model) << diagnostics.render();
  if (!model) return found;
  const auto databases = parse_evidence(*model, evidence_text, "evidence.db", diagnostics);
  EXPECT_TRUE(databases) << diagnostics.render();
  if (!databases) return found;
  const auto query = parse_query(*model, databases->front(), query_texts, diagnostics);
  EXPECT_TRUE(query) << diagnostics.render();
  if (!query) return found;
  Monitor monitor;
  const GroundingResult grounded = ground(*model, databases->front(), *query, {}, monitor);
  EXPECT_TRUE(grounded.network) << grounded.message;
  if (!grounded.network) return found;
  InferenceOptions options;
  options.method = "exact";
  const InferenceResult result = infer(*grounded.network, options, monitor);
  for (std::size_t q = 0; q < result.marginals.size(); ++q) {
    found[grounded.network->atom_text(grounded.network->queries()[q].literal.atom())] = result.marginals[q].probability;
  }
  return found;
}

}  // namespace sherlog
