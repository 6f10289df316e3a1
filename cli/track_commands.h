// The subcommands of track that have files of their own.
#pragma once

#include "cli/commands.h"

namespace sherlog::cli {

void add_track_learn(CLI::App& track, Action& action);
void add_track_evaluate(CLI::App& track, Action& action);
void add_track_resolve(CLI::App& track, Action& action);

}  // namespace sherlog::cli
