// The figures of the four-table evaluation: as text, CSV, a picture and a page.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "perception_bridge/track_score.h"

namespace sherlog {

// What all matchers made of the trials with one noise and one number of actions (figures a and b).
struct TrackCell {
  double noise = 0;
  std::uint32_t actions = 0;
  std::uint64_t trials = 0;
  std::vector<TrackScore> scores;  // by matcher
  std::vector<double> seconds;     // by matcher: evidence to belief, all trials
};

// Of the trials with one noise and one problem size, the old and new clusters of the step together (figure c).
struct TrackSize {
  double noise = 0;
  std::uint32_t size = 0;
  std::uint64_t trials = 0;
  std::vector<TrackScore> scores;
};

struct TrackEvaluation {
  std::vector<std::string> matchers;
  std::vector<TrackCell> cells;        // by noise, then actions
  std::vector<TrackSize> sizes;        // by noise, then size
  std::uint64_t seed = 1, trials = 0;  // a cell
  std::string config;                  // as JSON
  std::vector<std::string> notes;

  // Adds a trial of a cell (the last one, made by the caller) to it and to its size.
  void add(const FourTablesTrial& trial, std::size_t matcher, const Resolution& answer);
};

std::string track_csv(const TrackEvaluation& evaluation);
// Rows: matchers. Columns: association and explanation against actions (10a, 10b) and against the problem size (10c). One line for
// each noise, with 95 % intervals.
std::string track_svg(const TrackEvaluation& evaluation);
std::string track_html(const TrackEvaluation& evaluation);

}  // namespace sherlog
