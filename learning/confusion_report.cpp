#include "learning/confusion_report.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string_view>

namespace sherlog {
namespace {

// Continuation bytes of UTF-8 take no column.
std::size_t width_of(std::string_view text) {
  return static_cast<std::size_t>(
      std::count_if(text.begin(), text.end(), [](char c) { return (static_cast<unsigned char>(c) & 0xc0u) != 0x80u; }));
}

std::string padded(std::string_view text, std::size_t width, bool right) {
  const std::size_t own = width_of(text);
  const std::string blanks(own < width ? width - own : 0, ' ');
  return right ? blanks + std::string(text) : std::string(text) + blanks;
}

bool is_control(char c) { return static_cast<unsigned char>(c) < 0x20 || c == 0x7f; }

// A label in a line of text: what would break the line becomes a blank.
std::string one_line(std::string_view label) {
  std::string out(label);
  std::replace_if(out.begin(), out.end(), is_control, ' ');
  return out;
}

std::string csv_cell(std::string_view text) {
  const bool blank_end = !text.empty() && (text.front() == ' ' || text.back() == ' ');
  if (text.find_first_of(",\"\r\n") == std::string_view::npos && !blank_end) return std::string(text);
  std::string out = "\"";
  for (const char c : text) out += c == '"' ? std::string("\"\"") : std::string(1, c);
  return out + "\"";
}

std::string latex_text(std::string_view text) {
  std::string out;
  for (const char c : text) {
    switch (c) {
      case '\\':
        out += "\\textbackslash{}";
        break;
      case '~':
        out += "\\textasciitilde{}";
        break;
      case '^':
        out += "\\textasciicircum{}";
        break;
      case '<':
        out += "\\textless{}";
        break;
      case '>':
        out += "\\textgreater{}";
        break;
      case '|':
        out += "\\textbar{}";
        break;
      case '{':
      case '}':
      case '$':
      case '&':
      case '#':
      case '_':
      case '%':
        out += {'\\', c};
        break;
      // At the start of a row these would be read as an argument of the line break before it.
      case '[':
      case '*':
        out += {'{', c, '}'};
        break;
      default:
        out += is_control(c) ? ' ' : c;
    }
  }
  return out;
}

// Text and attribute values of XML and HTML. Most control characters are no part of XML, however they are written.
std::string xml_text(std::string_view text) {
  std::string out;
  for (const char c : text) {
    switch (c) {
      case '&':
        out += "&amp;";
        break;
      case '<':
        out += "&lt;";
        break;
      case '>':
        out += "&gt;";
        break;
      case '"':
        out += "&quot;";
        break;
      case '\'':
        out += "&#39;";
        break;
      default:
        out += is_control(c) ? ' ' : c;
    }
  }
  return out;
}

// --- the picture ------------------------------------------------------------------------------------------------------

constexpr double kCell = 26;     // pixels
constexpr double kLetter = 6.6;  // mean width of a letter at 12 pixels
constexpr double kMargin = 16;
constexpr double kReliability = 240;  // side of the reliability diagram

struct Colour {
  double red, green, blue;
};
constexpr Colour kRight{31, 119, 180}, kWrong{230, 115, 20};

// White for 0, the colour itself for 1; small shares are lifted so that single errors can be seen.
std::string shade(const Colour& colour, double share) {
  const double depth = share <= 0 ? 0.0 : 0.12 + 0.88 * share;
  const auto channel = [&](double value) { return static_cast<int>(std::lround(255 - depth * (255 - value))); };
  return fmt::format("#{:02x}{:02x}{:02x}", channel(colour.red), channel(colour.green), channel(colour.blue));
}

std::string svg_label(double x, double y, std::string_view anchor, std::string_view text) {
  return fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\" text-anchor=\"{}\">{}</text>\n", x, y, anchor, xml_text(text));
}

std::string svg_cells(const Evaluation& evaluation, double left, double top) {
  std::string out;
  for (std::size_t row = 0; row < evaluation.labels.size(); ++row) {
    for (std::size_t column = 0; column < evaluation.labels.size(); ++column) {
      const std::size_t count = evaluation.counts[row][column];
      const double share =
          count == 0 ? 0.0
                     : static_cast<double>(count) / static_cast<double>(evaluation.label_scores[column].true_count);
      const double x = left + kCell * static_cast<double>(column), y = top + kCell * static_cast<double>(row);
      out += fmt::format(
          "<g><title>predicted {}, is {}: {}</title><rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.0f}\" height=\"{:.0f}\" "
          "fill=\"{}\" stroke=\"#dddddd\"/>",
          xml_text(evaluation.labels[row]), xml_text(evaluation.labels[column]), count, x, y, kCell, kCell,
          shade(row == column ? kRight : kWrong, share));
      if (count > 0) {
        out += fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\" text-anchor=\"middle\"{}>{}</text>", x + kCell / 2,
                           y + kCell / 2 + 4, share > 0.6 ? " fill=\"#ffffff\"" : "", count);
      }
      out += "</g>\n";
    }
  }
  return out;
}

std::string svg_matrix(const Evaluation& evaluation, double left, double top) {
  std::string out;
  const double side = kCell * static_cast<double>(evaluation.labels.size());
  for (std::size_t i = 0; i < evaluation.labels.size(); ++i) {
    const double at = kCell * (static_cast<double>(i) + 0.5);
    out += svg_label(left - 6, top + at + 4, "end", evaluation.labels[i]);
    out += fmt::format("<text transform=\"translate({:.1f} {:.1f}) rotate(-60)\">{}</text>\n", left + at + 4, top - 6,
                       xml_text(evaluation.labels[i]));
    out += svg_label(left + at, top + side + 16, "middle", std::to_string(evaluation.label_scores[i].true_count));
    out +=
        svg_label(left + side + 8, top + at + 4, "start", std::to_string(evaluation.label_scores[i].predicted_count));
  }
  return out + svg_cells(evaluation, left, top) + svg_label(left - 6, top + side + 16, "end", "sum");
}

std::string svg_reliability(const Evaluation& evaluation, double left, double top) {
  const double bottom = top + kReliability;
  std::string out = fmt::format(
      "<rect x=\"{0:.1f}\" y=\"{1:.1f}\" width=\"{2:.0f}\" height=\"{2:.0f}\" fill=\"#ffffff\" stroke=\"#888888\"/>\n",
      left, top, kReliability);
  for (const CalibrationBin& bin : evaluation.bins) {
    if (bin.count == 0) continue;
    const double x = left + kReliability * bin.lower, width = kReliability * (bin.upper - bin.lower);
    const double height = kReliability * bin.accuracy;
    out += fmt::format(
        "<g><title>{} predictions with probability {:.1f} to {:.1f}: mean probability {:.3f}, right {:.3f}</title>"
        "<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.1f}\" height=\"{:.1f}\" fill=\"{}\" stroke=\"#ffffff\"/>"
        "<line x1=\"{:.1f}\" y1=\"{:.1f}\" x2=\"{:.1f}\" y2=\"{:.1f}\" stroke=\"{}\" stroke-width=\"3\"/></g>\n",
        bin.count, bin.lower, bin.upper, bin.confidence, bin.accuracy, x, bottom - height, width, height,
        shade(kRight, 0.5), x, bottom - kReliability * bin.confidence, x + width,
        bottom - kReliability * bin.confidence, shade(kWrong, 1.0));
    out += fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\" text-anchor=\"middle\" font-size=\"9\">{}</text>\n",
                       x + width / 2, bottom - 3, bin.count);
  }
  out += fmt::format(
      "<line x1=\"{:.1f}\" y1=\"{:.1f}\" x2=\"{:.1f}\" y2=\"{:.1f}\" stroke=\"#888888\" stroke-dasharray=\"4 3\"/>\n",
      left, bottom, left + kReliability, top);
  for (int tick = 0; tick <= 10; tick += 2) {
    const double at = kReliability * tick / 10.0;
    out += svg_label(left + at, bottom + 16, "middle", fmt::format("{:.1f}", tick / 10.0));
    out += svg_label(left - 6, bottom - at + 4, "end", fmt::format("{:.1f}", tick / 10.0));
  }
  out += svg_label(left + kReliability / 2, bottom + 34, "middle", "probability of the predicted label");
  return out +
         fmt::format(
             "<text transform=\"translate({:.1f} {:.1f}) rotate(-90)\" text-anchor=\"middle\">share right</text>\n",
             left - 34, top + kReliability / 2);
}

std::string headline(const Evaluation& evaluation) {
  return fmt::format("{} examples, accuracy {:.4f}, macro F1 {:.4f}, log-loss {:.4f}, calibration error {:.4f}",
                     evaluation.examples, evaluation.accuracy, evaluation.macro_f1, evaluation.log_loss,
                     evaluation.calibration_error);
}

}  // namespace

std::string confusion_text(const Evaluation& evaluation) {
  const std::size_t count = evaluation.labels.size();
  // Columns are headed by numbers, which the rows explain: heads of 20 letters each would not fit any screen.
  std::vector<std::string> names;
  std::size_t name_width = width_of("prediction \\ truth");
  for (const std::string& label : evaluation.labels) {
    names.push_back(one_line(label));
    name_width = std::max(name_width, width_of(names.back()));
  }
  std::size_t width = std::to_string(std::max(evaluation.examples, count)).size();
  const std::size_t number_width = std::to_string(count).size();
  std::string out = padded("prediction \\ truth", number_width + 1 + name_width, false);
  for (std::size_t label = 0; label < count; ++label) out += "  " + padded(std::to_string(label + 1), width, true);
  out += "  " + padded("sum", std::max<std::size_t>(width, 3), true) + "\n";
  const auto add_row = [&](const std::string& head, const auto& cell_at, std::size_t sum) {
    out += head;
    for (std::size_t label = 0; label < count; ++label) out += "  " + padded(cell_at(label), width, true);
    out += "  " + padded(std::to_string(sum), std::max<std::size_t>(width, 3), true) + "\n";
  };
  for (std::size_t row = 0; row < count; ++row) {
    add_row(
        padded(std::to_string(row + 1), number_width, true) + " " + padded(names[row], name_width, false),
        [&](std::size_t column) {
          const std::size_t cell = evaluation.counts[row][column];
          return cell == 0 ? std::string(".") : std::to_string(cell);
        },
        evaluation.label_scores[row].predicted_count);
  }
  add_row(
      padded("sum", number_width + 1 + name_width, false),
      [&](std::size_t column) { return std::to_string(evaluation.label_scores[column].true_count); },
      evaluation.examples);
  return out;
}

std::string confusion_csv(const Evaluation& evaluation) {
  std::string out = "prediction/truth";
  for (const std::string& label : evaluation.labels) out += "," + csv_cell(label);
  out += "\n";
  for (std::size_t row = 0; row < evaluation.labels.size(); ++row) {
    out += csv_cell(evaluation.labels[row]);
    for (const std::size_t cell : evaluation.counts[row]) out += fmt::format(",{}", cell);
    out += "\n";
  }
  return out;
}

std::string confusion_latex(const Evaluation& evaluation) {
  std::string out =
      "% Rows: prediction, columns: truth. The heads are turned where the document has loaded graphicx.\n"
      "\\providecommand{\\rotatebox}[2]{#2}\n\\begin{tabular}{l|";
  out += std::string(evaluation.labels.size(), 'r') + "}\nPrediction / Truth";
  for (const std::string& label : evaluation.labels)
    out += fmt::format(" & \\rotatebox{{90}}{{{}}}", latex_text(label));
  out += " \\\\\n\\hline\n";
  for (std::size_t row = 0; row < evaluation.labels.size(); ++row) {
    out += latex_text(evaluation.labels[row]);
    for (std::size_t column = 0; column < evaluation.labels.size(); ++column) {
      const std::size_t cell = evaluation.counts[row][column];
      out += row == column ? fmt::format(" & \\textbf{{{}}}", cell) : fmt::format(" & {}", cell);
    }
    out += " \\\\\n";
  }
  return out + "\\end{tabular}\n";
}

std::string confusion_svg(const Evaluation& evaluation, const std::string& title) {
  std::size_t letters = 10;
  for (const std::string& label : evaluation.labels) letters = std::max(letters, width_of(label));
  const double names = kLetter * static_cast<double>(letters) + 12;
  const double side = kCell * static_cast<double>(evaluation.labels.size());
  const double left = kMargin + names, top = kMargin + 60 + names * 0.87;  // sin 60 degrees
  const double reliability_top = top + side + 64;
  const double text_width = kLetter * static_cast<double>(std::max(width_of(title), width_of(headline(evaluation))));
  const double width =
      std::max({left + side + 40 + names / 2, left + kReliability + kMargin, text_width + 2 * kMargin});
  const double height = reliability_top + kReliability + 50;
  std::string out = fmt::format(
      "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{0:.0f}\" height=\"{1:.0f}\" viewBox=\"0 0 {0:.0f} {1:.0f}\" "
      "font-family=\"sans-serif\" font-size=\"12\" role=\"img\">\n<title>{2}</title>\n"
      "<rect width=\"100%\" height=\"100%\" fill=\"#ffffff\"/>\n",
      width, height, xml_text(title));
  out += fmt::format("<text x=\"{:.0f}\" y=\"{:.0f}\" font-size=\"15\" font-weight=\"bold\">{}</text>\n", kMargin,
                     kMargin + 10, xml_text(title));
  out += svg_label(kMargin, kMargin + 30, "start", headline(evaluation));
  out += svg_label(kMargin, kMargin + 48, "start", "rows: prediction, columns: truth");
  out += svg_matrix(evaluation, left, top);
  out += svg_label(left, reliability_top - 12, "start", "Reliability: blue: share right; orange: mean probability");
  return out + svg_reliability(evaluation, left, reliability_top) + "</svg>\n";
}

std::string confusion_html(const Evaluation& evaluation, const std::string& title) {
  std::string out = fmt::format(
      "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n<title>{0}</title>\n<style>\n"
      "body {{ font-family: sans-serif; margin: 2em; }}\ntable {{ border-collapse: collapse; margin: 1em 0; }}\n"
      "td, th {{ padding: 0.2em 0.8em; text-align: right; border-bottom: 1px solid #dddddd; }}\n"
      "td:first-child, th:first-child {{ text-align: left; }}\n</style>\n</head>\n<body>\n<h1>{0}</h1>\n<table>\n",
      xml_text(title));
  const auto row = [&](std::string_view name, const std::string& value) {
    out += fmt::format("<tr><td>{}</td><td>{}</td></tr>\n", name, value);
  };
  row("examples", std::to_string(evaluation.examples));
  row("accuracy", fmt::format("{:.4f}", evaluation.accuracy));
  row("macro precision", fmt::format("{:.4f}", evaluation.macro_precision));
  row("macro recall", fmt::format("{:.4f}", evaluation.macro_recall));
  row("macro F1", fmt::format("{:.4f}", evaluation.macro_f1));
  row("log-loss (nats)", fmt::format("{:.4f}", evaluation.log_loss));
  row("calibration error", fmt::format("{:.4f}", evaluation.calibration_error));
  out += "</table>\n" + confusion_svg(evaluation, title);
  out +=
      "<table>\n<tr><th>label</th><th>is</th><th>predicted</th><th>right</th><th>precision</th><th>recall</th>"
      "<th>F1</th></tr>\n";
  for (std::size_t label = 0; label < evaluation.labels.size(); ++label) {
    const LabelScore& score = evaluation.label_scores[label];
    const auto ratio = [](double value, std::size_t of) {
      return of == 0 ? std::string("-") : fmt::format("{:.3f}", value);
    };
    out += fmt::format("<tr><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td></tr>\n",
                       xml_text(evaluation.labels[label]), score.true_count, score.predicted_count, score.right,
                       ratio(score.precision, score.predicted_count), ratio(score.recall, score.true_count),
                       ratio(score.f1, score.true_count + score.predicted_count));
  }
  return out + "</table>\n</body>\n</html>\n";
}

std::string evaluation_text(const Evaluation& evaluation) {
  return fmt::format(
      "examples           {}\naccuracy           {:.4f}\nmacro precision    {:.4f}\nmacro recall       {:.4f}\n"
      "macro F1           {:.4f}\nlog-loss           {:.4f}\ncalibration error  {:.4f}\n",
      evaluation.examples, evaluation.accuracy, evaluation.macro_precision, evaluation.macro_recall,
      evaluation.macro_f1, evaluation.log_loss, evaluation.calibration_error);
}

std::string reliability_text(const Evaluation& evaluation) {
  std::string out = "probability  predictions  mean probability  share right\n";
  for (const CalibrationBin& bin : evaluation.bins) {
    if (bin.count == 0) continue;
    out += fmt::format("{:.1f} to {:.1f}   {:>11}  {:>16.4f}  {:>11.4f}\n", bin.lower, bin.upper, bin.count,
                       bin.confidence, bin.accuracy);
  }
  return out;
}

}  // namespace sherlog
