// The subcommands of track that have files of their own.
#pragma once

#include <optional>
#include <string>

#include "cli/commands.h"
#include "cli/session.h"

namespace sherlog::cli {

void add_track_learn(CLI::App& track, Action& action);
void add_track_evaluate(CLI::App& track, Action& action);
void add_track_resolve(CLI::App& track, Action& action);
void add_track_show(CLI::App& track, Action& action);

// For the commands that read a store; nothing after saying what is wrong. "paper": Table 1; else a file.
std::optional<Model> identity_model(Session& session, const std::string& name);

}  // namespace sherlog::cli
