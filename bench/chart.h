// Line charts as SVG, for figures: panels side by side, each with lines over a linear or logarithmic axis.
#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <utility>
#include <vector>

namespace sherlog {

struct ChartLine {
  std::string name;
  std::vector<std::pair<double, double>> points;  // one that is not a number interrupts the line
  bool is_dashed = false;
};

struct ChartPanel {
  std::string title, x_label, y_label;
  std::vector<ChartLine> lines;
  bool is_log_x = false, is_log_y = false;  // such an axis shows values above 0 only
};

// An axis from data to pixels, with the values to write beside it.
class ChartAxis {
 public:
  ChartAxis(double low, double high, bool is_log, double from, double to) : is_log_(is_log), from_(from), to_(to) {
    if (is_log) {
      low_ = std::floor(std::log10(low) + 1e-9);
      high_ = std::max(std::ceil(std::log10(high) - 1e-9), low_ + 1);
      for (double decade = low_; decade <= high_; ++decade) ticks.push_back(std::pow(10, decade));
      return;
    }
    const double span = high > low ? high - low : 1, power = std::pow(10, std::floor(std::log10(span / 4)));
    double step = power;
    while (span / step > 6) step = step < 1.5 * power ? 2 * power : step < 3 * power ? 5 * power : 10 * power;
    low_ = std::floor(low / step + 1e-9) * step;
    high_ = std::max(std::ceil(high / step - 1e-9) * step, low_ + step);
    for (double tick = low_; tick <= high_ + step / 2; tick += step)
      ticks.push_back(std::abs(tick) < step / 2 ? 0 : tick);
  }
  bool shows(double value) const { return std::isfinite(value) && (!is_log_ || value > 0); }
  double operator()(double value) const {
    return from_ + ((is_log_ ? std::log10(value) : value) - low_) / (high_ - low_) * (to_ - from_);
  }
  std::vector<double> ticks;

 private:
  bool is_log_;
  double from_, to_, low_, high_;
};

inline std::string chart_panel(const ChartPanel& panel, double left, double width, double height) {
  static constexpr const char* kColours[] = {"#1f6fb4", "#d9661f", "#2a8a3e", "#8a3f98", "#7a7a7a"};
  double x_low = 1e300, x_high = -1e300, y_low = 1e300, y_high = -1e300;
  for (const ChartLine& line : panel.lines) {
    for (const auto& [x, y] : line.points) {
      if ((panel.is_log_x && !(x > 0)) || (panel.is_log_y && !(y > 0))) continue;
      x_low = std::min(x_low, x), x_high = std::max(x_high, x);
      y_low = std::min(y_low, y), y_high = std::max(y_high, y);
    }
  }
  if (x_low > x_high) return "";
  if (!panel.is_log_y) y_low = std::min(y_low, 0.0), y_high *= 1.3;  // room for the names
  const double x0 = left + 52, x1 = left + width - 16, y0 = height - 40, y1 = 34;
  const ChartAxis at_x(x_low, x_high, panel.is_log_x, x0, x1), at_y(y_low, y_high, panel.is_log_y, y0, y1);
  std::string text;
  const auto out = std::back_inserter(text);
  fmt::format_to(out, "<text x=\"{}\" y=\"16\" font-weight=\"bold\">{}</text>\n", x0, panel.title);
  fmt::format_to(out, "<text x=\"{}\" y=\"28\" fill=\"#555555\">{}</text>\n", left + 12, panel.y_label);
  for (const double tick : at_y.ticks) {
    fmt::format_to(out,
                   "<line x1=\"{0:.1f}\" y1=\"{1:.1f}\" x2=\"{2:.1f}\" y2=\"{1:.1f}\" stroke=\"#dddddd\"/>"
                   "<text x=\"{3:.1f}\" y=\"{4:.1f}\" text-anchor=\"end\">{5:g}</text>\n",
                   x0, at_y(tick), x1, x0 - 4, at_y(tick) + 4, tick);
  }
  for (const double tick : at_x.ticks) {
    fmt::format_to(out,
                   "<line x1=\"{0:.1f}\" y1=\"{1:.1f}\" x2=\"{0:.1f}\" y2=\"{2:.1f}\" stroke=\"#dddddd\"/>"
                   "<text x=\"{0:.1f}\" y=\"{3:.1f}\" text-anchor=\"middle\">{4:g}</text>\n",
                   at_x(tick), y0, y1, y0 + 14, tick);
  }
  fmt::format_to(out, "<text x=\"{:.1f}\" y=\"{:.1f}\" text-anchor=\"middle\" fill=\"#555555\">{}</text>\n",
                 (x0 + x1) / 2, y0 + 30, panel.x_label);
  for (std::size_t i = 0; i < panel.lines.size(); ++i) {
    const ChartLine& line = panel.lines[i];
    const char* colour = kColours[i % std::size(kColours)];
    std::string path;
    const char* command = "M";  // again after a point that cannot be shown: the line is interrupted
    for (const auto& [x, y] : line.points) {
      if (!at_x.shows(x) || !at_y.shows(y)) {
        command = " M";
        continue;
      }
      path += fmt::format("{}{:.1f},{:.1f}", command, at_x(x), at_y(y));
      command = " L";
      if (line.points.size() <= 25 && !line.is_dashed) {
        fmt::format_to(out, "<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"2.2\" fill=\"{}\"/>\n", at_x(x), at_y(y), colour);
      }
    }
    const char* dashes = line.is_dashed ? " stroke-dasharray=\"5 3\"" : "";
    fmt::format_to(out, "<path d=\"{}\" fill=\"none\" stroke=\"{}\" stroke-width=\"1.5\"{}/>\n", path, colour, dashes);
    fmt::format_to(out, "<text x=\"{:.1f}\" y=\"{:.1f}\" fill=\"{}\">{}</text>\n", x0 + 8,
                   y1 + 14 + 14 * static_cast<double>(i), colour, line.name);
  }
  return text;
}

inline std::string chart(const std::vector<ChartPanel>& panels, double width = 430, double height = 320) {
  const double all = width * static_cast<double>(panels.size());
  std::string text = fmt::format(
      "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{0}\" height=\"{1}\" viewBox=\"0 0 {0} {1}\" "
      "font-family=\"sans-serif\" font-size=\"11\">\n<rect width=\"{0}\" height=\"{1}\" fill=\"white\"/>\n",
      all, height);
  for (std::size_t i = 0; i < panels.size(); ++i) {
    text += chart_panel(panels[i], width * static_cast<double>(i), width, height);
  }
  return text + "</svg>\n";
}

inline bool write_text(const std::filesystem::path& file, const std::string& text) {
  std::ofstream out(file, std::ios::binary);
  out << text;
  out.flush();
  if (!out) fmt::print(stderr, "{}: cannot be written\n", file.string());
  return static_cast<bool>(out);
}

}  // namespace sherlog
