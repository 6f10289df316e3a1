// The commands. To add one: a file with a function `add_<command>`, its line here and its line in main.cpp.
#pragma once

#include <CLI/CLI.hpp>
#include <functional>

namespace sherlog::cli {

// What the chosen command does once all options are known; returns the exit code.
using Action = std::function<int()>;

void add_check(CLI::App& app, Action& action);
void add_ground(CLI::App& app, Action& action);
void add_infer(CLI::App& app, Action& action);
void add_explain(CLI::App& app, Action& action);
void add_learn(CLI::App& app, Action& action);
void add_xval(CLI::App& app, Action& action);
void add_convert(CLI::App& app, Action& action);
void add_scenes(CLI::App& app, Action& action);
void add_track(CLI::App& app, Action& action);
void add_advise(CLI::App& app, Action& action);
void add_perceive(CLI::App& app, Action& action);  // only where SHERLOG_HAS_RGBD is defined

}  // namespace sherlog::cli
