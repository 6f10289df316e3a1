// An Evaluation to look at: the confusion matrix as text, CSV, LaTeX, and as a picture (SVG, HTML).
//
// Idea      Rows are predictions, columns are truths, as in the papers on this model: a column shows where the things of
//           one class went. The picture shades a cell by its share of its column, so the diagonal shows the recall
//           whatever the size of the class; what is right is blue, what is wrong is orange. The reliability diagram below
//           it shows, for each bin of the predicted label's probability, how many predictions were right: on the diagonal
//           where the probabilities mean what they say.
// Input     labels may hold any UTF-8 text; each format escapes it in its own way
// Output    whole texts; the SVG and the HTML file need nothing beside them
#pragma once

#include <string>

#include "learning/evaluation.h"

namespace sherlog {

// Aligned columns with a sum of each row and column; zeros are dots, so that the errors stand out.
std::string confusion_text(const Evaluation& evaluation);
// RFC 4180, with a header: the first column holds the predicted labels.
std::string confusion_csv(const Evaluation& evaluation);
// A tabular without packages; the column heads are turned where the document has loaded graphicx.
std::string confusion_latex(const Evaluation& evaluation);
std::string confusion_svg(const Evaluation& evaluation, const std::string& title);
// The picture, the figures and precision, recall and F1 of each label.
std::string confusion_html(const Evaluation& evaluation, const std::string& title);

// The headline figures, one a line: accuracy, macro precision, recall and F1, log-loss, calibration error.
std::string evaluation_text(const Evaluation& evaluation);
// The bins of the reliability diagram as a table; empty ones are left out.
std::string reliability_text(const Evaluation& evaluation);

}  // namespace sherlog
