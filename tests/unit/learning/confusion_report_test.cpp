#include "learning/confusion_report.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <sstream>
#include <string>
#include <vector>

#include "tests/unit/learning/table3.h"

namespace sherlog {
namespace {

using testing::HasSubstr;
using testing::Not;

Evaluation small(std::vector<std::string> labels) {
  std::vector<Prediction> predictions(4);
  predictions[0].probabilities = {0.7, 0.3};
  predictions[1].probabilities = {0.4, 0.6};  // a taken for b
  predictions[2].probabilities = {0.2, 0.8};
  predictions[2].truth = 1;
  predictions[3].probabilities = {0.25, 0.75};
  predictions[3].truth = 1;
  return evaluate(std::move(labels), predictions);
}

std::size_t occurrences(const std::string& text, const std::string& part) {
  std::size_t count = 0;
  for (std::size_t at = text.find(part); at != std::string::npos; at = text.find(part, at + 1)) ++count;
  return count;
}

// Every element is closed by its own name, every attribute is quoted, every '&' begins an entity.
testing::AssertionResult is_well_formed(const std::string& xml) {
  std::vector<std::string> open;
  for (std::size_t at = 0; at < xml.size(); ++at) {
    if (xml[at] == '&') {
      const std::string rest = xml.substr(at, 6);
      if (rest.rfind("&amp;", 0) != 0 && rest.rfind("&lt;", 0) != 0 && rest.rfind("&gt;", 0) != 0 &&
          rest.rfind("&quot;", 0) != 0 && rest.rfind("&#39;", 0) != 0) {
        return testing::AssertionFailure() << "a bare '&' before: " << rest;
      }
    }
    if (static_cast<unsigned char>(xml[at]) < 0x20 && xml[at] != '\n') {
      return testing::AssertionFailure() << "a control character";
    }
    if (xml[at] != '<') continue;
    const std::size_t end = xml.find('>', at);
    if (end == std::string::npos) return testing::AssertionFailure() << "a tag without an end";
    const std::string tag = xml.substr(at + 1, end - at - 1);
    const std::string name = tag.substr(0, tag.find_first_of(" /", 1));
    if (std::count(tag.begin(), tag.end(), '"') % 2 != 0 || tag.find('<') != std::string::npos) {
      return testing::AssertionFailure() << "a broken tag: " << tag;
    }
    if (tag[0] == '/') {
      if (open.empty() || open.back() != tag.substr(1)) return testing::AssertionFailure() << "closes: " << tag;
      open.pop_back();
    } else if (tag.back() != '/' && name != "meta" && tag[0] != '!') {
      open.push_back(name);
    }
    at = end;
  }
  if (!open.empty()) return testing::AssertionFailure() << "left open: " << open.back();
  return testing::AssertionSuccess();
}

TEST(ConfusionText, RowsArePredictionsAndColumnsTruths) {
  EXPECT_EQ(confusion_text(small({"Cup", "Bowl"})),
            "prediction \\ truth    1  2  sum\n"
            "1 Cup                 1  .    1\n"
            "2 Bowl                1  2    3\n"
            "sum                   2  2    4\n");
}

TEST(ConfusionText, ControlCharactersAndUtf8KeepTheColumns) {
  const std::string text = confusion_text(small({"Öl\nund\tEssig", "Bowl"}));
  std::istringstream lines(text);
  std::string line;
  std::vector<std::size_t> widths;
  while (std::getline(lines, line)) {
    widths.push_back(static_cast<std::size_t>(std::count_if(
        line.begin(), line.end(), [](char c) { return (static_cast<unsigned char>(c) & 0xc0u) != 0x80u; })));
  }
  EXPECT_EQ(widths, std::vector<std::size_t>(4, widths.front()));
}

TEST(ConfusionCsv, QuotesWhatNeedsQuotes) {
  EXPECT_EQ(confusion_csv(small({"Dr \"O\", Bielefeld", "Bowl"})),
            "prediction/truth,\"Dr \"\"O\"\", Bielefeld\",Bowl\n"
            "\"Dr \"\"O\"\", Bielefeld\",1,0\n"
            "Bowl,1,2\n");
}

TEST(ConfusionCsv, PublishedMatrixComesBack) {
  const Evaluation evaluation = evaluate(published_labels(), published_predictions());
  std::istringstream lines(confusion_csv(evaluation));
  std::string line;
  std::getline(lines, line);
  std::size_t row = 0, sum = 0;
  while (std::getline(lines, line)) {
    std::istringstream cells(line);
    std::string cell;
    std::getline(cells, cell, ',');
    EXPECT_EQ(cell, published_labels()[row]);
    std::string digits;
    while (std::getline(cells, cell, ',')) {
      digits += cell;
      sum += std::stoul(cell);
    }
    EXPECT_EQ(digits, published_rows()[row]);
    ++row;
  }
  EXPECT_EQ(row, 26u);
  EXPECT_EQ(sum, 131u);
}

TEST(ConfusionLatex, IsAPlainTabular) {
  EXPECT_EQ(confusion_latex(small({"pancake_mix", "[5%] & {more}"})),
            "% Rows: prediction, columns: truth. The heads are turned where the document has loaded graphicx.\n"
            "\\providecommand{\\rotatebox}[2]{#2}\n"
            "\\begin{tabular}{l|rr}\n"
            "Prediction / Truth & \\rotatebox{90}{pancake\\_mix} & \\rotatebox{90}{{[}5\\%] \\& \\{more\\}} \\\\\n"
            "\\hline\n"
            "pancake\\_mix & \\textbf{1} & 0 \\\\\n"
            "{[}5\\%] \\& \\{more\\} & 1 & \\textbf{2} \\\\\n"
            "\\end{tabular}\n");
}

TEST(ConfusionLatex, EscapesEverySpecialCharacter) {
  const std::string text = confusion_latex(small({"\\^~<>|$#", "b"}));
  EXPECT_THAT(text, HasSubstr("\\textbackslash{}\\textasciicircum{}\\textasciitilde{}\\textless{}\\textgreater{}"
                              "\\textbar{}\\$\\#"));
}

TEST(ConfusionSvg, IsWellFormedWithAnyLabels) {
  const std::string svg = confusion_svg(small({"<b>&\"'\x01", "Tee & Öl"}), "a < b & \"c\"");
  EXPECT_TRUE(is_well_formed(svg)) << svg;
  EXPECT_THAT(svg, HasSubstr("Tee &amp; Öl"));
  EXPECT_THAT(svg, Not(HasSubstr("<b>")));
}

TEST(ConfusionSvg, HasACellForEachPairAndItsCount) {
  const std::string svg = confusion_svg(small({"Cup", "Bowl"}), "t");
  EXPECT_EQ(occurrences(svg, "<title>predicted "), 4u);
  EXPECT_THAT(svg, HasSubstr("predicted Bowl, is Cup: 1<"));
  EXPECT_THAT(svg, HasSubstr("predicted Bowl, is Bowl: 2<"));
  EXPECT_THAT(svg, HasSubstr("rotate(-60)\">Cup<"));
  // Both Bowls are right: the full blue. The one Cup that was missed is half of its column.
  EXPECT_THAT(svg, HasSubstr("#1f77b4"));
  EXPECT_THAT(svg, HasSubstr("1 predictions with probability 0.6 to 0.7: mean probability 0.600, right 0.000"));
}

TEST(ConfusionSvg, PublishedMatrixIsDrawnWhole) {
  const std::string svg = confusion_svg(evaluate(published_labels(), published_predictions()), "Table 3");
  EXPECT_TRUE(is_well_formed(svg));
  EXPECT_EQ(occurrences(svg, "<title>predicted "), 26u * 26u);
  EXPECT_THAT(svg, HasSubstr("131 examples, accuracy 0.2595"));
}

TEST(ConfusionHtml, IsOneWellFormedFile) {
  const std::string html = confusion_html(small({"<script>", "a&b"}), "</title><script>");
  EXPECT_TRUE(is_well_formed(html)) << html;
  EXPECT_THAT(html, Not(HasSubstr("<script>")));
  EXPECT_THAT(html, Not(HasSubstr("src=")));
  EXPECT_THAT(html, HasSubstr("<svg "));
  EXPECT_THAT(html, HasSubstr("<tr><td>accuracy</td><td>0.7500</td></tr>"));
}

TEST(ConfusionReports, AreThereWithoutLabels) {
  const Evaluation nothing = evaluate({}, {});
  EXPECT_TRUE(is_well_formed(confusion_svg(nothing, "")));
  EXPECT_TRUE(is_well_formed(confusion_html(nothing, "")));
  EXPECT_EQ(confusion_csv(nothing), "prediction/truth\n");
  EXPECT_THAT(confusion_latex(nothing), HasSubstr("\\begin{tabular}{l|}"));
  EXPECT_THAT(confusion_text(nothing), HasSubstr("sum"));
}

TEST(ReliabilityText, ListsTheBinsThatHoldSomething) {
  EXPECT_EQ(reliability_text(small({"a", "b"})),
            "probability  predictions  mean probability  share right\n"
            "0.6 to 0.7             1            0.6000       0.0000\n"
            "0.7 to 0.8             2            0.7250       1.0000\n"
            "0.8 to 0.9             1            0.8000       1.0000\n");
}

}  // namespace
}  // namespace sherlog
