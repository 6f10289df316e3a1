// From frames to beliefs, as a page with the pictures of each stage: a synthetic table, or a recording.
// Usage: perception_report [REPORT.html [FRAMES]]; without a name the page is made and not kept.
#include <fmt/format.h>

#include <fstream>
#include <map>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "mln/parser.h"
#include "perception_bridge/scene_tracker.h"
#include "perception_bridge/shipped_models.h"
#include "rgbd/pipeline/frame_source.h"
#include "rgbd/pipeline/perception.h"
#include "rgbd/pipeline/truth.h"

using namespace sherlog;

namespace {

constexpr std::size_t kEvery = 10;

std::string base64(const std::vector<unsigned char>& bytes) {
  constexpr char kDigits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    unsigned group = 0;
    for (std::size_t k = 0; k < 3; ++k) group = group << 8 | (i + k < bytes.size() ? bytes[i + k] : 0U);
    for (std::size_t k = 0; k < 4; ++k) text += i + k <= bytes.size() ? kDigits[group >> (18 - 6 * k) & 63] : '=';
  }
  return text;
}

std::string picture(const cv::Mat& image, const std::string& title) {
  cv::Mat small;
  cv::resize(image, small, {}, 0.5, 0.5, cv::INTER_AREA);
  std::vector<unsigned char> bytes;
  cv::imencode(".jpg", small, bytes);
  return fmt::format("<figure><img alt='{0}' src='data:image/jpeg;base64,{1}'><figcaption>{0}</figcaption></figure>\n",
                     title, base64(bytes));
}

cv::Mat coloured(const rgbd::DepthImage& depth) {
  cv::Mat bytes, colours;
  depth.convertTo(bytes, CV_8U, 255.0 / 3500);
  cv::applyColorMap(bytes, colours, cv::COLORMAP_TURBO);
  colours.setTo(cv::Scalar(0, 0, 0), depth == 0);
  return colours;
}

// The table's surface, what is on it, and the names that the belief has for it.
cv::Mat marked(const rgbd::Frame& frame, const rgbd::Perceived& seen, const std::map<std::string, std::string>& names) {
  cv::Mat image = frame.colour.clone();
  if (const auto* tables = seen.analysis.view<std::vector<rgbd::Table>>("tables")) {
    for (const rgbd::Table& table : *tables) image.setTo(cv::Scalar(90, 120, 90), table.surface);
  }
  const auto* found = seen.analysis.view<rgbd::Hypotheses>("things");
  if (found == nullptr) return image;
  image.setTo(cv::Scalar(0, 0, 90), found->reaching_mask);
  for (std::size_t i = 0; i < found->things.size(); ++i) {
    const rgbd::Hypothesis& thing = found->things[i];
    frame.colour(thing.roi).copyTo(image(thing.roi), thing.mask);
    cv::rectangle(image, thing.roi, {255, 255, 255}, 2);
    const auto name = names.find(fmt::format("c{}", i));
    const std::string text = name == names.end() ? "" : name->second;
    cv::putText(image, text, thing.roi.tl() - cv::Point(0, 6), cv::FONT_HERSHEY_SIMPLEX, 0.6, {255, 255, 255}, 2);
  }
  return image;
}

std::string first(const Cluster& cluster, const char* type, const char* field) {
  const auto found = annotations_of(cluster.annotations, type);
  return found.empty() ? "" : std::string(text_field(*found.front(), field));
}

// `names`: of clusters by what they are, where that is known.
std::string belief_rows(const Scene& scene, const TrackingStep& step, const std::map<std::string, std::string>& names) {
  std::string rows = fmt::format(
      "<table><tr><th>thing<th>is<th>explanation<th>probability<th>shape<th>size<th>colour<th>class{}</tr>\n",
      names.empty() ? "" : "<th>in truth");
  for (const auto& belief : step.clusters) {
    const auto cluster = std::ranges::find(scene.clusters, belief.cluster, &Cluster::id);
    rows += fmt::format(
        "<tr><td>{}<td>{}<td>{}<td>{:.2f}<td>{}<td>{}<td>{}<td>{}{}</tr>\n", belief.cluster, belief.object,
        belief.explanation, belief.probability.value_or(0), first(*cluster, "rs.annotation.Shape", "shape"),
        first(*cluster, "rs.annotation.SemanticSize", "size"), first(*cluster, "rs.annotation.SemanticColor", "color"),
        first(*cluster, "rs.annotation.Classification", "classname"),
        names.empty() ? "" : "<td>" + (names.contains(belief.cluster) ? names.at(belief.cluster) : "nothing"));
  }
  rows += "</table>\n";
  if (!step.disappeared.empty()) rows += fmt::format("<p>disappeared: {}</p>\n", fmt::join(step.disappeared, ", "));
  return rows;
}

// appear, stay, stay, move: "appear, 2 x stay, move"
std::string in_short(const std::vector<std::string>& words) {
  std::string text;
  for (std::size_t i = 0, end = 0; i < words.size(); i = end) {
    while (end < words.size() && words[end] == words[i]) ++end;
    text += (i == 0 ? "" : ", ") + (end - i > 1 ? fmt::format("{} x {}", end - i, words[i]) : words[i]);
  }
  return text;
}

// Belief beside truth, object by object; and how many of them are right.
std::string truth_table(const std::vector<rgbd::ObjectBelief>& beliefs, std::size_t identities, std::string& summary) {
  constexpr const char* kTruth[] = {"can be seen", "is covered", "is gone"};
  std::string rows =
      "<h2>Belief and truth</h2><table><tr><th>object<th>in truth<th>first taken for<th>in the end<th>explanations<th>"
      "</tr>\n";
  std::size_t right = 0;
  for (const rgbd::ObjectBelief& belief : beliefs) {
    right += belief.is_right ? 1U : 0U;
    const std::string end = !belief.now.empty()      ? belief.now
                            : belief.has_disappeared ? belief.first + " has disappeared"
                                                     : belief.first + " is hidden";
    rows += fmt::format("<tr><td>{}<td>{}<td>{}<td>{}<td>{}<td>{}</tr>\n", belief.object,
                        kTruth[static_cast<std::size_t>(belief.truth)], belief.first, end,
                        in_short(belief.explanations), belief.is_right ? "right" : "<b>wrong</b>");
  }
  summary =
      fmt::format("{} of {} right, {} identities for {} things", right, beliefs.size(), identities, beliefs.size());
  return rows + "</table>\n<p>" + summary + "</p>\n";
}

std::string times_table(const rgbd::RunTimes& times) {
  std::string rows = "<h2>Run times, ms</h2><table><tr><th>annotator<th>runs<th>mean<th>std</tr>\n";
  auto all = times.rows();
  all.push_back(times.total());
  for (const auto& row : all) {
    rows +=
        fmt::format("<tr><td>{}<td>{}<td>{:.1f}<td>{:.1f}</tr>\n", row.annotator, row.runs, row.mean, row.deviation);
  }
  return rows + "</table>\n";
}

// The people of a frame: their keypoints, a colour for each.
cv::Mat people_in(const rgbd::Frame& frame, const rgbd::Perceived& seen) {
  cv::Mat image = frame.colour.clone() * 0.4;
  const auto* people = seen.analysis.view<std::vector<rgbd::Person>>("people");
  if (people == nullptr) return image;
  const cv::Scalar colours[] = {{80, 220, 255}, {255, 180, 60}, {120, 255, 120}, {200, 120, 255}};
  for (const rgbd::Person& person : *people) {
    const cv::Scalar& colour = colours[static_cast<std::size_t>(person.label) % std::size(colours)];
    for (const auto& point : person.keypoints) cv::circle(image, {point.pixel.x, point.pixel.y}, 1, colour, -1);
    const auto& first_point = person.keypoints.front().pixel;
    cv::putText(image, fmt::format("{} (posture {})", person.label, person.posture),
                {first_point.x, std::max(16, first_point.y - 8)}, cv::FONT_HERSHEY_SIMPLEX, 0.7, colour, 2);
  }
  return image;
}

// People who cross, from frame to foreground to keypoints with labels; and a robot's arm that is taken away.
std::string other_branches(std::string& problem) {
  std::string page = "<h2>People</h2>\n";
  const auto crossing = rgbd::open_frames("synthetic:people_crossing", 1, problem);
  rgbd::Annotators annotators = rgbd::object_annotators({});
  for (auto& annotator : rgbd::people_annotators()) annotators.push_back(std::move(annotator));
  auto people = rgbd::Perception::make(std::move(annotators), {.also = {"sherlog.annotation.Person"}}, problem);
  if (!crossing || !people) return {};
  for (std::size_t index = 0; index <= 150; ++index) {
    const auto frame = crossing->read(index, problem);
    const auto seen = people->perceive(*frame, crossing->calibration, index, crossing->bodies_at(index));
    if (index != 90 && index != 120 && index != 150) continue;
    page += picture(coloured(frame->depth), fmt::format("frame {}: depth", index));
    if (const auto* mask = seen.analysis.view<rgbd::MaskImage>("foreground")) page += picture(*mask, "foreground");
    page += picture(people_in(*frame, seen), "people: keypoints, labels, postures");
  }
  page += times_table(people->times()) + "<h2>Known structure</h2>\n";
  const auto robot = rgbd::open_frames("synthetic:robot_table", 1, problem);
  auto filter = rgbd::Perception::make(rgbd::object_annotators({}), {.also = {"robot"}}, problem);
  if (!robot || !filter) return {};
  const auto frame = robot->read(70, problem);
  const auto seen = filter->perceive(*frame, robot->calibration, 70, robot->bodies_at(70));
  rgbd::DepthImage without = frame->depth.clone();
  without.setTo(0, *seen.analysis.view<rgbd::MaskImage>("robot"));
  return page + picture(frame->colour, "a robot's arm") + picture(coloured(frame->depth), "depth") +
         picture(coloured(without), "without what the robot knows of its arm");
}

}  // namespace

int main(int argc, char** argv) {
  std::string problem;
  const std::string frames = argc > 2 ? argv[2] : "synthetic:table_removals";
  const auto source = rgbd::open_frames(frames, 1, problem);
  Diagnostics diagnostics;
  auto model = parse_model(scenes_identity_model(), "scenes.mln", diagnostics);
  rgbd::PerceptionOptions options{.request = rgbd::Request{}, .also = {"filled", "foreground"}};
  auto perception =
      source ? rgbd::Perception::make(rgbd::object_annotators(source->knowledge), options, problem) : std::nullopt;
  auto tracker = SceneTracker::make(std::move(*model), *shipped_mapping("perception"), {}, {}, problem);
  if (!perception || !tracker) return fmt::print(stderr, "{}\n", problem), 2;

  std::string page = fmt::format(
      "<!doctype html><meta charset='utf-8'><title>From frames to "
      "beliefs</title><style>body{{font-family:sans-serif;margin:2em}}"
      "figure{{display:inline-block;margin:4px}}td,th{{padding:2px 10px;text-align:left}}</style><h1>From frames to "
      "beliefs: {}</h1>"
      "<p>{}</p>\n",
      source->name, fmt::join(perception->annotators(), " &rarr; "));
  Monitor monitor;
  std::size_t scenes = 0;
  rgbd::BeliefLog log;
  for (std::size_t index = 0; index < source->frames; index += kEvery) {
    const auto frame = source->read(index, problem);
    if (!frame) {
      fmt::print(stderr, "frame {}: {}\n", index, problem);
      continue;
    }
    const rgbd::Perceived seen = perception->perceive(*frame, source->calibration, index, source->bodies_at(index));
    std::map<std::string, std::string> names;
    std::string belief = "<p>Something reaches over the table: no scene.</p>\n";
    if (seen.reaching == 0) {
      const TrackingStep step = tracker->feed(seen.scene, monitor);
      for (const auto& cluster : step.clusters) names[cluster.cluster] = cluster.object;
      std::map<std::string, std::string> truth;
      if (source->truth) {
        const rgbd::TrueFrame true_frame = source->truth(index);
        truth = rgbd::true_names(seen, true_frame);
        log.add(seen, true_frame, step);
      }
      belief = belief_rows(seen.scene, step, truth);
      ++scenes;
    }
    page += fmt::format("<h2>Frame {}, {:.2f} s</h2>\n", index, frame->time) + picture(frame->colour, "colour") +
            picture(coloured(frame->depth), "depth as measured");
    if (const auto* filled = seen.analysis.view<rgbd::DepthImage>("filled"))
      page += picture(coloured(*filled), "gaps filled");
    if (const auto* mask = seen.analysis.view<rgbd::MaskImage>("foreground")) page += picture(*mask, "foreground");
    page += picture(marked(*frame, seen, names), "table, things and who they are") + belief;
  }
  std::string summary;
  if (source->truth) page += truth_table(log.compare(tracker->objects()), tracker->objects().size(), summary);
  page += times_table(perception->times());
  if (argc > 1) page += other_branches(problem);
  fmt::print("{} scenes, {} objects{}\n", scenes, tracker->objects().size(), summary.empty() ? "" : "; " + summary);
  if (argc > 1) std::ofstream(argv[1]) << page;
  return scenes > 0 ? 0 : 1;
}
