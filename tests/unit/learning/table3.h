// The confusion matrix that was published for the fusion model: half of the recorded scenes, five folds.
#pragma once

#include <string>
#include <vector>

#include "learning/evaluation.h"

namespace sherlog {

inline const std::vector<std::string>& published_labels() {
  static const std::vector<std::string> labels{"Coffe_pitcher",
                                               "Coffee_pitcher",
                                               "Kellogs_corn_flakes",
                                               "Pfanner_ice_tea",
                                               "Pfanner_orange_juice",
                                               "Pringles_chips",
                                               "Vitalis_cereal",
                                               "bowl",
                                               "coffee",
                                               "cup",
                                               "fork",
                                               "hot_plate",
                                               "ja_oil",
                                               "ketchup",
                                               "knife",
                                               "milk",
                                               "nutella",
                                               "pancake_mix",
                                               "plate",
                                               "pot",
                                               "salt",
                                               "spatula",
                                               "spoon",
                                               "sugar",
                                               "tea",
                                               "toaster"};
  return labels;
}

// Rows: prediction, columns: truth, one digit a cell.
inline const std::vector<std::string>& published_rows() {
  static const std::vector<std::string> rows{
      "00000100000000000000000010", "00000000000000000100001000", "00100000000000000000000000",
      "00000000000000000000000000", "00002000000000000000000000", "00000000000000100000021000",
      "00000020000000000010000000", "00001001120010010010010000", "00000000000000000020000000",
      "10001002132000110000100000", "00001000021000002021000000", "00000000000100000000000000",
      "00000001000010000001000000", "00000000000004000020010000", "00040000030000310010011000",
      "00100000020000140110001100", "00000000000001000000000000", "00000000000010000201001000",
      "00000000012000200050054000", "01000000000000000020000000", "00010001001001010000000001",
      "00000000000100001000010000", "00000000000000010000001000", "00000000000001010000100101",
      "00000000000000000000000000", "00000000100000000001000001"};
  return rows;
}

// One prediction for each object, sure of itself.
inline std::vector<Prediction> published_predictions() {
  std::vector<Prediction> predictions;
  for (std::size_t predicted = 0; predicted < published_rows().size(); ++predicted) {
    for (std::size_t truth = 0; truth < published_labels().size(); ++truth) {
      for (int i = 0; i < published_rows()[predicted][truth] - '0'; ++i) {
        Prediction prediction;
        prediction.probabilities.assign(published_labels().size(), 0.0);
        prediction.probabilities[predicted] = 1.0;
        prediction.truth = static_cast<std::uint32_t>(truth);
        predictions.push_back(prediction);
      }
    }
  }
  return predictions;
}

}  // namespace sherlog
