// What the track commands share: the world they simulate and the matchers they compare.
#pragma once

#include <CLI/CLI.hpp>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "cli/report.h"
#include "cli/session.h"
#include "perception_bridge/four_tables.h"
#include "perception_bridge/identity_belief.h"
#include "perception_bridge/identity_learning.h"
#include "perception_bridge/track_score.h"

namespace sherlog::cli {

struct TrackOptions {
  std::string config_file;
  std::optional<std::uint32_t> objects, actions;
  std::optional<double> noise;
  std::uint64_t trials = 1000;
  std::uint64_t training_trials = 1000;
};

void add_world_file_options(CLI::App& command, TrackOptions& options);  // --config --objects
void add_training_trials_option(CLI::App& command, TrackOptions& options);
void add_trials_options(CLI::App& command, TrackOptions& options);  // --trials --training-trials

// The defaults, then the file, then the options; nothing after saying what is wrong.
std::optional<FourTablesConfig> read_config(Session& session, const TrackOptions& options);

// The names that --matcher knows: mln and the baselines.
std::vector<std::string> matcher_names();
const std::vector<std::string>& baseline_names();
// Nothing where the input is wrong, which was said; or where learning came to no end, which is left to say.
struct MadeMatcher {
  std::unique_ptr<Matcher> matcher;
  Termination termination = Termination::kRefused;
  std::string message = {};
};
// One by its name, for that world. `model`: of the matcher mln: paper, learned, or a file.
MadeMatcher make_matcher(Session& session, const std::string& name, const std::string& model,
                         const TrackOptions& options, const FourTablesConfig& config);
// Without a result: says why, if that is left to say, with a document of that schema. The exit code.
int finish_unlearned(Session& session, const char* schema, Termination termination, const std::string& message);
// Training trials at the config's noise, with 1 to 5 actions, far from any seed that trials are evaluated on.
IdentityTraining identity_training(Session& session, const TrackOptions& options, const FourTablesConfig& config);

// "0.968 +-0.004"
std::string share_text(const GroupedShare& share);
Json share_json(const GroupedShare& share);
Json config_json(const FourTablesConfig& config);

}  // namespace sherlog::cli
