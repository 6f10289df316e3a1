#include "cli/scenes.h"
namespace sherlog::cli {
void add_scenes_evidence(CLI::App&, Action&) {}
}  // namespace sherlog::cli
