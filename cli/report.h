// Results as text for people and as JSON for programs. Only this file knows how they are written.
//
// JSON: keys in a fixed order; a value that a method has not, or that is not finite, is left out.
#pragma once

#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "grounding/ground.h"
#include "inference/explain.h"
#include "inference/inference.h"
#include "inference/standing_question.h"
#include "mln/diagnostics.h"
#include "mln/evidence.h"
#include "mln/model.h"

namespace sherlog::cli {

using Json = nlohmann::ordered_json;

struct Seconds {
  double parse = 0, ground = 0, infer = 0, total = 0;
};

// A ground formula or a piece of evidence that a contradiction is made of.
struct ConflictItem {
  std::string text;
  std::string file;
  std::uint32_t line = 0;
  std::uint32_t column = 0;
  bool is_formula = true;
};

// Everything about the inference on one database.
struct InferenceReport {
  const Model* model = nullptr;
  const Evidence* evidence = nullptr;
  const GroundNetwork* network = nullptr;  // where grounding came to an end
  InferenceResult result;                  // termination and message also where it was grounding that stopped
  std::vector<ConflictItem> conflict;
  Seconds seconds;
};

std::string to_text(const Json& document);
// JSON has no infinity: "inf".
Json finite_or_inf(double number);

// "Smokes(Anna) => Cancer(Anna)": the formula of a constraint or feature with the constants of one grounding.
std::string bound_formula_text(const Model& model, const Evidence& evidence, const GroundNetwork& network,
                               FormulaId formula, std::uint32_t binding);
std::vector<ConflictItem> conflict_items(const Conflict& conflict);
std::vector<ConflictItem> conflict_items(const Model& model, const Evidence& evidence, const GroundNetwork& network,
                                         std::span<const std::uint32_t> constraints);
std::vector<ConflictItem> conflict_items(const Contradiction& contradiction);
// file:line:column: error: ... with one note for each item.
std::string conflict_text(const std::vector<ConflictItem>& conflict, const std::string& sentence);
Json conflict_json(const std::vector<ConflictItem>& conflict);

std::string infer_text(const InferenceReport& report);
Json infer_json(const InferenceReport& report);

Json diagnostics_json(const Diagnostics& diagnostics);

}  // namespace sherlog::cli
