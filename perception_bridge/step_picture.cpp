#include "perception_bridge/step_picture.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <iterator>
#include <map>

#include "perception_bridge/association_question.h"

namespace sherlog {
namespace {

std::string escaped(std::string_view text) {
  std::string out;
  for (const char c : text) {
    if (std::iscntrl(static_cast<unsigned char>(c)) != 0) {
      out += "\xEF\xBF\xBD";  // XML has no word for it
      continue;
    }
    out += c == '&' ? "&amp;" : c == '<' ? "&lt;" : c == '>' ? "&gt;" : c == '"' ? "&quot;" : std::string(1, c);
  }
  return out;
}

// Long names would cover the picture; the whole one is in the tooltips.
std::string shortened(const std::string& name) {
  constexpr std::size_t kMost = 14;
  if (name.size() <= kMost) return escaped(name);
  std::size_t end = kMost - 2;
  while (end > 0 && (static_cast<unsigned char>(name[end]) & 0xC0U) == 0x80U) --end;  // no half characters
  return escaped(name.substr(0, end)) + "..";
}

// White to dark blue.
std::string shade(double value) {
  const double v = std::clamp(value, 0.0, 1.0);
  const auto channel = [&](double dark) { return std::lround(255 + (dark - 255) * v); };
  return fmt::format("#{:02x}{:02x}{:02x}", channel(18), channel(60), channel(120));
}

class Picture {
 public:
  Picture(const StepPicture& step, std::size_t panels) : step_(step) {
    const std::size_t most = std::max({step.old_names.size(), step.new_names.size(), std::size_t{1}});
    cell_ = std::clamp(420.0 / static_cast<double>(most), 6.0, 30.0);
    panel_width_ = kNames + cell_ * static_cast<double>(step.new_names.size() + 1) + kGap;
    const double width = std::max(360.0, panel_width_ * static_cast<double>(panels)),
                 height = kTop + kNames + cell_ * static_cast<double>(step.old_names.size() + 1) + 34;
    fmt::format_to(
        out(),
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{0:.0f}\" height=\"{1:.0f}\" viewBox=\"0 0 {0:.0f} "
        "{1:.0f}\" "
        "font-family=\"sans-serif\" font-size=\"10\">\n<rect width=\"{0:.0f}\" height=\"{1:.0f}\" fill=\"white\"/>\n"
        "<text x=\"8\" y=\"18\" font-size=\"13\" font-weight=\"bold\">{2}</text>\n"
        "<text x=\"8\" y=\"{3:.0f}\" fill=\"#555555\">{4}</text>\n",
        width, height, escaped(step.title), height - 8,
        "columns: new clusters, rows: old ones. S stay, M move, V new view, A appear, D disappear, H hidden; grey: out "
        "of view");
  }

  void begin_panel(const std::string& title, std::size_t index) {
    left_ = kNames + panel_width_ * static_cast<double>(index);
    fmt::format_to(out(), "<text x=\"{:.1f}\" y=\"38\" font-weight=\"bold\">{}</text>\n", left_, escaped(title));
    for (std::size_t o = 0; o < step_.old_names.size(); ++o) {
      fmt::format_to(out(),
                     "<text x=\"{:.1f}\" y=\"{:.1f}\" text-anchor=\"end\" font-size=\"{:.1f}\" fill=\"{}\">{}</text>\n",
                     left_ - 4, y(o) + 0.5 * cell_ + 3, name_size(), step_.out_of_view[o] ? "#888888" : "#000000",
                     shortened(step_.old_names[o]));
    }
    for (std::size_t n = 0; n < step_.new_names.size(); ++n) {
      fmt::format_to(out(), "<text transform=\"translate({:.1f},{:.1f}) rotate(-60)\" font-size=\"{:.1f}\">{}</text>\n",
                     x(n) + 0.5 * cell_ + 3, kTop + kNames - 4, name_size(), shortened(step_.new_names[n]));
    }
  }

  // `n` or `o` one beyond the last: the margin.
  void cell(std::size_t o, std::size_t n, double value, const std::string& what) {
    fmt::format_to(out(),
                   "<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.1f}\" height=\"{:.1f}\" fill=\"{}\" stroke=\"#cccccc\">"
                   "<title>{}: {:.4f}</title></rect>\n",
                   x(n), y(o), cell_, cell_, shade(value), escaped(what), value);
    if (cell_ < 22) return;
    fmt::format_to(out(),
                   "<text x=\"{:.1f}\" y=\"{:.1f}\" text-anchor=\"middle\" font-size=\"8\" fill=\"{}\">{:.2f}</text>\n",
                   x(n) + 0.5 * cell_, y(o) + 0.5 * cell_ + 3, value > 0.5 ? "#ffffff" : "#000000", value);
  }

  void mark(std::size_t o, std::size_t n, std::optional<char> letter, bool wrong, bool framed) {
    if (framed || wrong) {
      fmt::format_to(
          out(), "<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.1f}\" height=\"{:.1f}\" fill=\"none\" stroke=\"{}\"/>\n",
          x(n), y(o), cell_, cell_, wrong ? "#c0392b" : "#cccccc");
    }
    if (!letter) return;
    static const std::map<char, const char*> colours = {{'S', "#2a9d5c"}, {'M', "#d98a00"}, {'V', "#7d3c98"},
                                                        {'A', "#1b6ca8"}, {'D', "#c0392b"}, {'H', "#777777"}};
    fmt::format_to(out(),
                   "<text x=\"{:.1f}\" y=\"{:.1f}\" text-anchor=\"middle\" font-weight=\"bold\" font-size=\"{:.1f}\" "
                   "fill=\"{}\">{}</text>\n",
                   x(n) + 0.5 * cell_, y(o) + 0.5 * cell_ + 0.22 * cell_, std::min(14.0, 0.7 * cell_),
                   colours.at(*letter), *letter);
  }

  std::string finish() && { return text_ + "</svg>\n"; }

 private:
  static constexpr double kTop = 30, kNames = 78, kGap = 16;
  double x(std::size_t n) const { return left_ + cell_ * static_cast<double>(n); }
  double y(std::size_t o) const { return kTop + kNames + cell_ * static_cast<double>(o); }
  double name_size() const { return std::clamp(cell_, 5.0, 10.0); }
  std::back_insert_iterator<std::string> out() { return std::back_inserter(text_); }

  const StepPicture& step_;
  double cell_ = 24, left_ = 0, panel_width_ = 0;
  std::string text_;
};

std::string pair_text(const StepPicture& step, std::size_t o, std::size_t n) {
  return step.old_names[o] + ", " + step.new_names[n];
}

void draw_grades(Picture& picture, const StepPicture& step, const StepPicture::Grades& grades) {
  for (std::size_t o = 0; o < step.old_names.size(); ++o) {
    for (std::size_t n = 0; n < step.new_names.size(); ++n) {
      picture.cell(o, n, grades.values[o * step.new_names.size() + n], pair_text(step, o, n));
    }
  }
}

void draw_belief(Picture& picture, const StepPicture& step) {
  const std::size_t olds = step.old_names.size(), news = step.new_names.size();
  for (std::size_t o = 0; o < olds; ++o) {
    double here = 0;
    for (std::size_t n = 0; n < news; ++n) {
      const auto& pair = step.belief.pair(o, n);
      picture.cell(o, n, step.belief.same(o, n),
                   fmt::format("{} (stay {:.4f}, move {:.4f}, newview {:.4f})", pair_text(step, o, n), pair[0], pair[1],
                               pair[2]));
      here += step.belief.same(o, n);
    }
    picture.cell(o, news, std::max(0.0, 1 - here),
                 fmt::format("{} {}", step.old_names[o], step.out_of_view[o] ? "hidden" : "disappeared"));
  }
  for (std::size_t n = 0; n < news; ++n)
    picture.cell(olds, n, step.belief.appeared(n), step.new_names[n] + " appeared");
}

std::optional<char> new_mark(const Resolution& resolution, std::size_t n) {
  return resolution.association[n] ? std::nullopt : std::optional('A');
}

void draw_explanation(Picture& picture, const StepPicture& step) {
  const std::size_t olds = step.old_names.size(), news = step.new_names.size();
  const auto differs = [&](const auto& mark_of) {
    return step.truth && mark_of(step.resolution) != mark_of(*step.truth);
  };
  for (std::size_t o = 0; o < olds; ++o) {
    for (std::size_t n = 0; n < news; ++n) {
      const auto mark_of = [&](const Resolution& resolution) { return pair_mark(resolution, o, n); };
      picture.mark(o, n, mark_of(step.resolution), differs(mark_of), true);
    }
    const auto mark_of = [&](const Resolution& resolution) { return old_mark(resolution, o); };
    picture.mark(o, news, mark_of(step.resolution), differs(mark_of), false);
  }
  for (std::size_t n = 0; n < news; ++n) {
    const auto mark_of = [&](const Resolution& resolution) { return new_mark(resolution, n); };
    picture.mark(olds, n, mark_of(step.resolution), differs(mark_of), false);
  }
}

}  // namespace

std::vector<StepPicture::Grades> grades_of(const SceneObservation& observation, const EvidenceMapping& mapping,
                                           std::size_t olds, std::size_t news) {
  std::map<std::string, std::size_t> old_position, new_position;
  for (std::size_t o = 0; o < olds; ++o) old_position[fmt::format("{}{}", mapping.old_clusters.prefix, o)] = o;
  for (std::size_t n = 0; n < news; ++n) new_position[fmt::format("{}{}", mapping.new_clusters.prefix, n)] = n;
  std::vector<StepPicture::Grades> grades;
  for (const PairRule& rule : mapping.pairs) {
    StepPicture::Grades& matrix =
        grades.emplace_back(StepPicture::Grades{rule.predicate, std::vector<double>(olds * news, rule.missing)});
    for (const ObservedAtom& atom : observation.atoms) {
      if (atom.predicate != rule.predicate || atom.arguments.size() != 2) continue;
      const auto o = old_position.find(atom.arguments[0]);
      const auto n = new_position.find(atom.arguments[1]);
      if (o != old_position.end() && n != new_position.end()) matrix.values[o->second * news + n->second] = atom.degree;
    }
  }
  return grades;
}

StepPicture picture_of(const Scene& before, const Scene& now, const EvidenceMapping& mapping,
                       const IdentityBelief& belief) {
  StepPicture picture;
  picture.title = fmt::format("{} against {}", now.id, before.id);
  for (const Cluster& cluster : before.clusters) picture.old_names.push_back(cluster.id);
  for (const Cluster& cluster : now.clusters) picture.new_names.push_back(cluster.id);
  picture.out_of_view = out_of_view_of(before.clusters, now);
  picture.grades =
      grades_of(observe_change(mapping, before.clusters, now), mapping, before.clusters.size(), now.clusters.size());
  picture.belief = belief;
  picture.resolution = decide(belief, picture.out_of_view);
  return picture;
}

std::optional<char> pair_mark(const Resolution& resolution, std::size_t o, std::size_t n) {
  if (resolution.association[n] != o) return std::nullopt;
  const ClusterExplanation why = resolution.explanation[o];
  return why == ClusterExplanation::kStay ? 'S' : why == ClusterExplanation::kMove ? 'M' : 'V';
}

std::optional<char> old_mark(const Resolution& resolution, std::size_t o) {
  const ClusterExplanation why = resolution.explanation[o];
  if (why == ClusterExplanation::kHidden) return 'H';
  return why == ClusterExplanation::kDisappear ? std::optional('D') : std::nullopt;
}

std::string step_svg(const StepPicture& step) {
  Picture picture(step, step.grades.size() + 2);
  std::size_t panel = 0;
  for (const StepPicture::Grades& grades : step.grades) {
    picture.begin_panel(grades.name, panel++);
    draw_grades(picture, step, grades);
  }
  picture.begin_panel("is: stay, move or newview", panel++);
  draw_belief(picture, step);
  picture.begin_panel(step.truth ? "explanation (red: the truth differs)" : "explanation", panel);
  draw_explanation(picture, step);
  return std::move(picture).finish();
}

std::string step_html(std::span<const StepPicture> steps) {
  std::string text =
      "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><title>Who is who</title>\n<style>"
      "body{font-family:sans-serif;margin:2em}svg{max-width:100%;height:auto;margin:1em 0}</style></head><body>\n"
      "<h1>Who is who</h1>\n<p>New clusters on top, old ones on the left; the darker, the nearer to 1. The column on "
      "the right: gone; the row below: new.</p>\n";
  for (const StepPicture& step : steps) text += step_svg(step);
  return text + "</body></html>\n";
}

}  // namespace sherlog
