// A learned model as text that the parser reads back to the bit.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "learning/weight_table.h"
#include "mln/model.h"

namespace sherlog {

// The formula of a weight: + variables replaced by their constants, comparisons between constants decided ("true" or "false"
// where nothing else is left). Variables carry a ? where the model writes them so or where a constant has the same name;
// constants that would be read as variables are in quotes.
std::string weight_text(const Model& model, const WeightTable& table, std::size_t weight);
// Those of all weights, in time linear in the model and the texts.
std::vector<std::string> weight_texts(const Model& model, const WeightTable& table);

// The whole model, includes written out, each soft formula with its weight (shortest decimal that reads back to the same
// bits); `heading` becomes a comment at the top (without comment signs).
std::string learned_model_text(const Model& model, const WeightTable& table, std::span<const double> weights,
                               const std::string& heading);

}  // namespace sherlog
