// The four-table world of the RoboSherlock paper, simulated: what a robot saw, what was done behind its back, what it
// sees now, and the truth about it.
//
// Idea      Some tables of a square metre each, some objects of random colour, most of them on a table. The robot has had
//           one noisy look at everything: the old observations. Then things happen (an object is put on a table,
//           removed, moved, or changes its look, which stands for another partial view). Now the robot stands in front
//           of one table, a bit to the side of its middle, and sees a part of it one metre wide at most: the new
//           observations. Noise is Gaussian with the same sigma in each colour channel and each axis of the position; what
//           is measured off the table, or out of the range of a colour, is set to the nearest that is possible.
// Source    Blodow et al., RoboSherlock paper, 8.3 (Fig. 10). Values that it does not give are ours: see FourTablesConfig.
// Output    FourTablesTrial: as the JSON lines of `sherlog track simulate --dump` have it
// Random    draws only from (seed, number of the trial): trial 7 is the same whether 10 or 10,000 are made, on every machine
// Cost      linear in objects and actions; about 100,000 trials a second
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace sherlog {

// Everything that can be set. To add a parameter: a member here and a line in the table of four_tables_config.cpp.
struct FourTablesConfig {
  // Given in the paper.
  std::uint32_t tables = 4;
  double table_width = 1.0;  // metres
  double table_depth = 1.0;
  std::uint32_t objects = 15;
  double view_width = 1.0;  // of the table that the robot looks at
  std::uint32_t actions = 3;
  double noise = 0.05;  // sigma of each colour channel and of each axis
  // Not given there.
  double start_fill = 0.8;     // share of the objects that are on tables at first, rounded
  double sensor_range = 0.25;  // the robot stands at most so far to the side of the table's middle
  double table_gap = 1.0;      // between two tables, which stand in a row
  double put_weight = 1.0;     // how often each kind of action happens, relative to the others that are possible
  double remove_weight = 1.0;
  double move_weight = 1.0;
  double change_weight = 1.0;
};

// A bad value is answered with its name, the value and the bound that it broke; empty where all are good.
std::string validate(const FourTablesConfig& config);
// A JSON object with some of the members above, over the values in `config`. Returns what is wrong with it, or nothing.
std::string read_config(std::string_view json, FourTablesConfig& config);
std::string to_json(const FourTablesConfig& config);

enum class ActionKind : std::uint8_t { kPut, kRemove, kMove, kChange };
// What became of an old cluster, or of a new one without a partner (kAppear).
enum class ClusterExplanation : std::uint8_t { kStay, kMove, kNewview, kDisappear, kHidden, kAppear };
std::string_view to_string(ActionKind kind);
std::string_view to_string(ClusterExplanation explanation);

using Position = std::array<double, 2>;  // metres, from a corner of the table
using Color = std::array<double, 3>;     // each in [0, 1]

struct SimulatedAction {
  ActionKind kind = ActionKind::kMove;
  std::uint32_t object = 0;
};

struct Observation {
  std::uint32_t object = 0;  // the truth, which no matcher reads
  std::uint32_t table = 0;   // the first is 1
  Position position{};
  Color color{};
  bool out_of_view = false;    // of old ones: the place, as measured, lies outside the present view
  bool place_in_view = false;  // of old ones: the place as it truly was lies inside; no matcher reads this
};

struct View {
  std::uint32_t table = 1;
  Position min{}, max{};
  bool contains(std::uint32_t other_table, const Position& p) const {
    return other_table == table && p[0] >= min[0] && p[0] <= max[0] && p[1] >= min[1] && p[1] <= max[1];
  }
};

// Who is who, and why: the truth, or what a matcher says. Clusters are numbered from 0 as in the trial.
struct Resolution {
  std::vector<std::optional<std::uint32_t>> association;  // by new cluster: an old one, or none
  std::vector<ClusterExplanation> explanation;            // by old cluster; an unmatched new one is kAppear
  bool operator==(const Resolution&) const = default;
};

struct FourTablesTrial {
  std::uint64_t seed = 0, number = 0;
  FourTablesConfig config;
  View view;
  std::vector<SimulatedAction> actions;
  std::vector<Observation> old_clusters, new_clusters;
  Resolution truth;
};

// What happened to each object between the two looks, as far as it matters.
struct ObjectHistory {
  bool moved = false;    // moved, or removed and put back
  bool changed = false;  // looks different
};

// Requires a good config.
FourTablesTrial simulate_four_tables(const FourTablesConfig& config, std::uint64_t seed, std::uint64_t number);

// The truth by its definition: an old cluster whose object is seen now is a move if the object was moved (changed or not), a
// newview if it was only changed, and stays otherwise. One whose object is not seen is hidden if its old place lies outside the
// present view, and has disappeared if inside. `histories` by object.
Resolution true_resolution(const FourTablesTrial& trial, const std::vector<ObjectHistory>& histories);

}  // namespace sherlog
