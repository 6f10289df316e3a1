#include "perception_bridge/track_report.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <iterator>
#include <set>

namespace sherlog {
namespace {

constexpr std::uint64_t kLeastPerPoint = 50;  // clusters; fewer make a point that is all interval
constexpr const char* kColours[] = {"#1b6ca8", "#2a9d5c", "#d98a00", "#c0392b",
                                    "#7d3c98", "#555555", "#16a085", "#884400"};

struct Measure {
  const char* name;
  const GroupedShare TrackScore::*share;
};
constexpr Measure kMeasures[] = {{"association", &TrackScore::association},
                                 {"explanation", &TrackScore::explanation},
                                 {"acted_on", &TrackScore::acted_on},
                                 {"acted_on_shown", &TrackScore::acted_on_shown}};

void csv_rows(std::string& text, const char* figure, const TrackEvaluation& e, double noise, std::uint32_t x,
              std::uint64_t trials, const std::vector<TrackScore>& scores) {
  for (std::size_t m = 0; m < e.matchers.size(); ++m) {
    for (const Measure& measure : kMeasures) {
      const GroupedShare& share = scores[m].*measure.share;
      if (share.total() == 0) continue;
      const auto [low, high] = share.interval();
      fmt::format_to(std::back_inserter(text), "{},{},{},{},{},{},{},{},{:.6f},{:.6f},{:.6f}\n", figure, e.matchers[m],
                     measure.name, noise, x, trials, share.right(), share.total(), share.rate(), low, high);
    }
  }
}

// One panel: lines over x by noise.
struct Point {
  double x, rate, low, high;
};
struct Panel {
  std::string title, x_label;
  std::vector<std::vector<Point>> lines;  // by noise
};

class Picture {
 public:
  static constexpr double kWidth = 300, kHeight = 210, kLeft = 46, kTop = 34, kPlotWidth = 236, kPlotHeight = 130;

  Picture(std::size_t columns, std::size_t rows, const std::vector<double>& noises) {
    const double width = kWidth * static_cast<double>(columns), height = 30 + kHeight * static_cast<double>(rows);
    fmt::format_to(
        out(),
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{0}\" height=\"{1}\" viewBox=\"0 0 {0} {1}\" "
        "font-family=\"sans-serif\" font-size=\"11\">\n<rect width=\"{0}\" height=\"{1}\" fill=\"white\"/>\n",
        width, height);
    for (std::size_t i = 0; i < noises.size(); ++i) {
      const double x = 60 + 110 * static_cast<double>(i);
      fmt::format_to(out(),
                     "<line x1=\"{}\" y1=\"16\" x2=\"{}\" y2=\"16\" stroke=\"{}\" stroke-width=\"2\"/>"
                     "<text x=\"{}\" y=\"20\">noise {}</text>\n",
                     x - 26, x - 6, colour(i), x, noises[i]);
    }
  }

  void draw(const Panel& panel, std::size_t column, std::size_t row) {
    const double x0 = kWidth * static_cast<double>(column) + kLeft, y0 = 30 + kHeight * static_cast<double>(row) + kTop;
    double low = 0.95, x_min = 1e9, x_max = -1e9;
    for (const auto& line : panel.lines) {
      for (const Point& p : line) {
        low = std::min(low, p.low);
        x_min = std::min(x_min, p.x);
        x_max = std::max(x_max, p.x);
      }
    }
    if (x_max < x_min) x_min = x_max = 0;
    low = std::floor(low * 20) / 20;
    const auto at_x = [&](double x) { return x0 + (x_max > x_min ? (x - x_min) / (x_max - x_min) : 0.5) * kPlotWidth; };
    const auto at_y = [&](double rate) { return y0 + (1 - rate) / (1 - low) * kPlotHeight; };
    fmt::format_to(out(), "<text x=\"{}\" y=\"{}\" font-weight=\"bold\">{}</text>\n", x0, y0 - 10, panel.title);
    for (int i = 0; i <= 4; ++i) {
      const double rate = low + (1 - low) * i / 4;
      fmt::format_to(out(),
                     "<line x1=\"{0}\" y1=\"{1:.1f}\" x2=\"{2}\" y2=\"{1:.1f}\" stroke=\"#dddddd\"/>"
                     "<text x=\"{3}\" y=\"{4:.1f}\" text-anchor=\"end\">{5:.3f}</text>\n",
                     x0, at_y(rate), x0 + kPlotWidth, x0 - 4, at_y(rate) + 4, rate);
    }
    for (double x = x_min; x <= x_max; ++x) {
      fmt::format_to(out(), "<text x=\"{:.1f}\" y=\"{}\" text-anchor=\"middle\">{}</text>\n", at_x(x),
                     y0 + kPlotHeight + 14, x);
    }
    fmt::format_to(out(), "<text x=\"{}\" y=\"{}\" text-anchor=\"middle\" fill=\"#555555\">{}</text>\n",
                   x0 + kPlotWidth / 2, y0 + kPlotHeight + 27, panel.x_label);
    for (std::size_t i = 0; i < panel.lines.size(); ++i) {
      std::string path;
      for (const Point& p : panel.lines[i]) {
        path += fmt::format("{}{:.1f},{:.1f}", path.empty() ? "M" : " L", at_x(p.x), at_y(p.rate));
        fmt::format_to(out(),
                       "<line x1=\"{0:.1f}\" y1=\"{1:.1f}\" x2=\"{0:.1f}\" y2=\"{2:.1f}\" stroke=\"{3}\"/>"
                       "<circle cx=\"{0:.1f}\" cy=\"{4:.1f}\" r=\"2.2\" fill=\"{3}\"/>\n",
                       at_x(p.x), at_y(p.low), at_y(p.high), colour(i), at_y(p.rate));
      }
      if (!path.empty())
        fmt::format_to(out(), "<path d=\"{}\" fill=\"none\" stroke=\"{}\" stroke-width=\"1.5\"/>\n", path, colour(i));
    }
  }

  std::string finish() && { return text_ + "</svg>\n"; }

 private:
  static const char* colour(std::size_t i) { return kColours[i % std::size(kColours)]; }
  std::back_insert_iterator<std::string> out() { return std::back_inserter(text_); }
  std::string text_;
};

std::vector<double> noises_of(const TrackEvaluation& e) {
  std::set<double> noises;
  for (const TrackCell& cell : e.cells) noises.insert(cell.noise);
  return {noises.begin(), noises.end()};
}

void add_point(Panel& panel, std::size_t line, double x, const GroupedShare& share) {
  if (share.total() < kLeastPerPoint) return;
  const auto [low, high] = share.interval();
  panel.lines[line].push_back({x, share.rate(), low, high});
}

std::string escaped(const std::string& text) {
  std::string out;
  for (const char c : text) out += c == '&' ? "&amp;" : c == '<' ? "&lt;" : c == '>' ? "&gt;" : std::string(1, c);
  return out;
}

}  // namespace

void TrackEvaluation::add(const FourTablesTrial& trial, std::size_t matcher, const Resolution& answer) {
  const auto size = static_cast<std::uint32_t>(trial.old_clusters.size() + trial.new_clusters.size());
  auto at =
      std::ranges::find_if(sizes, [&](const TrackSize& s) { return s.noise == trial.config.noise && s.size == size; });
  if (at == sizes.end()) {
    at = std::ranges::find_if(sizes, [&](const TrackSize& s) {
      return s.noise > trial.config.noise || (s.noise == trial.config.noise && s.size > size);
    });
    at = sizes.insert(at, {trial.config.noise, size, 0, std::vector<TrackScore>(matchers.size())});
  }
  if (matcher == 0) ++at->trials;
  at->scores[matcher].add(trial, answer);
  if (matcher == 0) ++cells.back().trials;
  cells.back().scores[matcher].add(trial, answer);
}

std::string track_csv(const TrackEvaluation& e) {
  std::string text = "by,matcher,measure,noise,x,trials,right,total,rate,low95,high95\n";
  for (const TrackCell& c : e.cells) csv_rows(text, "actions", e, c.noise, c.actions, c.trials, c.scores);
  for (const TrackSize& s : e.sizes) csv_rows(text, "problem_size", e, s.noise, s.size, s.trials, s.scores);
  return text;
}

std::string track_svg(const TrackEvaluation& e) {
  const std::vector<double> noises = noises_of(e);
  const auto line_of = [&](double noise) {
    return static_cast<std::size_t>(std::ranges::find(noises, noise) - noises.begin());
  };
  Picture picture(4, e.matchers.size(), noises);
  for (std::size_t m = 0; m < e.matchers.size(); ++m) {
    for (std::size_t i = 0; i < 2; ++i) {  // association, explanation
      const Measure& measure = kMeasures[i];
      Panel by_actions{fmt::format("10{}: {}, {}", i == 0 ? 'a' : 'b', measure.name, e.matchers[m]), "actions", {}};
      Panel by_size{fmt::format("10c: {}, {}", measure.name, e.matchers[m]), "problem size (old + new clusters)", {}};
      by_actions.lines.resize(noises.size());
      by_size.lines.resize(noises.size());
      for (const TrackCell& c : e.cells) add_point(by_actions, line_of(c.noise), c.actions, c.scores[m].*measure.share);
      for (const TrackSize& s : e.sizes) add_point(by_size, line_of(s.noise), s.size, s.scores[m].*measure.share);
      picture.draw(by_actions, i, m);
      picture.draw(by_size, 2 + i, m);
    }
  }
  return std::move(picture).finish();
}

std::string track_html(const TrackEvaluation& e) {
  std::string text =
      "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><title>Four "
      "tables</title>\n<style>body{font-family:"
      "sans-serif;margin:2em;max-width:1250px}table{border-collapse:collapse;margin:1em 0}td,th{padding:.2em .7em;"
      "text-align:right;border-bottom:1px solid "
      "#ddd}th{background:#f4f4f4}td:first-child,th:first-child{text-align:left}"
      "small{color:#777}svg{max-width:100%;height:auto}</style></head><body>\n<h1>Who is who on four tables</h1>\n";
  const auto out = std::back_inserter(text);
  fmt::format_to(
      out, "<p>{} trials a cell, seed {}. Shares with 95 % intervals, which come from the spread between trials.</p>\n",
      e.trials, e.seed);
  for (const std::string& note : e.notes) fmt::format_to(out, "<p>{}</p>\n", escaped(note));
  static constexpr const char* kTitles[] = {"Association of new clusters", "Explanation of all clusters",
                                            "Explanation of the objects that were acted on",
                                            "Explanation of the objects that were acted on and are not hidden"};
  for (std::size_t i = 0; i < std::size(kMeasures); ++i) {
    fmt::format_to(out, "<h2>{}</h2>\n<table><tr><th>noise</th><th>actions</th>", kTitles[i]);
    for (const std::string& matcher : e.matchers) fmt::format_to(out, "<th>{}</th>", escaped(matcher));
    text += "</tr>\n";
    for (const TrackCell& c : e.cells) {
      fmt::format_to(out, "<tr><td>{}</td><td>{}</td>", c.noise, c.actions);
      for (const TrackScore& score : c.scores) {
        const GroupedShare& share = score.*kMeasures[i].share;
        const auto [low, high] = share.interval();
        fmt::format_to(out, "<td>{:.3f} <small>{:.3f}&ndash;{:.3f}</small></td>", share.rate(), low, high);
      }
      text += "</tr>\n";
    }
    text += "</table>\n";
  }
  text += "<h2>Figure 10</h2>\n" + track_svg(e);
  fmt::format_to(out, "<h2>The simulated world</h2>\n<pre>{}</pre>\n</body></html>\n", escaped(e.config));
  return text;
}

}  // namespace sherlog
