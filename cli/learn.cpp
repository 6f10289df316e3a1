// sherlog learn: the weights that explain training databases best, as a new model file.
#include <fmt/format.h>

#include <memory>
#include <new>

#include "cli/commands.h"
#include "cli/learning_options.h"
#include "cli/report.h"
#include "learning/learned_model.h"

namespace sherlog::cli {
namespace {

struct LearnArguments {
  Options options;
  LearningArguments learning;
  std::string output;
};

std::string prior_text(const LearningOptions& options) {
  std::string text = std::isinf(options.prior.stdev)
                         ? "no Gaussian prior"
                         : fmt::format("Gaussian prior with mean {:g} and standard deviation {:g}", options.prior.mean,
                                       options.prior.stdev);
  if (options.prior.l1 > 0.0) text += fmt::format(", L1 prior with rate {:g}", options.prior.l1);
  if (!options.formula_priors.empty()) text += fmt::format(", {} formulas with another", options.formula_priors.size());
  return text;
}

std::string objective_text(const LearningResult& result) {
  if (!result.objective) return "";
  return fmt::format("objective {:.8g}, with the prior {:.8g}", *result.objective, *result.objective_with_prior);
}

std::string outcome_text(const LearningResult& result) {
  return fmt::format("{} after {} iterations: {}", result.converged ? "converged" : "not converged", result.iterations,
                     result.reason);
}

// A model without soft formulas has all of its none.
bool has_weights(const LearningResult& result) {
  return !result.weights.empty() || result.termination == Termination::kCompleted;
}

std::string databases_text(const LearningResult& result) {
  return fmt::format("{} database{}", result.databases, result.databases == 1 ? "" : "s");
}

// What the output file says of itself.
std::string provenance(const LearningResult& result, const LearnArguments& arguments) {
  std::string text = fmt::format("Weights learned by sherlog {}: method {}\n", SHERLOG_VERSION, result.method);
  text += fmt::format("model: {}\n", fmt::join(arguments.options.models, ", "));
  text += fmt::format("data: {} ({})\n", fmt::join(arguments.learning.training, ", "), databases_text(result));
  if (!arguments.learning.discriminative.empty()) {
    text += fmt::format("predicted: {}\n", fmt::join(arguments.learning.discriminative, ", "));
  }
  for (const std::string& block : arguments.learning.blocks) text += fmt::format("taken jointly: {}\n", block);
  text += prior_text(result.options) + "\n";
  for (const std::string& stdev : arguments.learning.formula_stdevs) text += fmt::format("formula stdev {}\n", stdev);
  if (result.objective) text += objective_text(result) + "\n";
  return text + outcome_text(result);
}

Json learn_json(const LearningResult& result) {
  Json json;
  json["schema"] = "sherlog.learn/1";
  json["method"] = result.method;
  json["termination"] = to_string(result.termination);
  if (!result.message.empty()) json["message"] = result.message;
  if (result.objective) json["objective"] = *result.objective;
  if (result.objective_with_prior) json["objective_with_prior"] = *result.objective_with_prior;
  Json prior;
  prior["mean"] = result.options.prior.mean;
  prior["stdev"] = finite_or_inf(result.options.prior.stdev);
  if (result.options.prior.l1 > 0.0) prior["l1"] = result.options.prior.l1;
  json["prior"] = std::move(prior);
  if (has_weights(result)) {
    json["converged"] = result.converged;
    json["reason"] = result.reason;
    json["iterations"] = result.iterations;
    if (result.gradient_norm) json["gradient_norm"] = *result.gradient_norm;
  }
  json["databases"] = result.databases;
  json["weights"] = Json::array();
  std::vector<std::string> formulas;
  if (!result.weights.empty()) formulas = weight_texts(*result.model, WeightTable(*result.model));
  for (std::size_t w = 0; w < result.weights.size(); ++w) {
    const LearnedWeight& learned = result.weights[w];
    Json entry;
    entry["formula"] = formulas[w];
    entry["weight"] = learned.weight;
    if (learned.standard_error) entry["standard_error"] = *learned.standard_error;
    if (learned.fixed) entry["fixed"] = true;
    if (!learned.identified || learned.shared) entry["identified"] = false;
    json["weights"].push_back(std::move(entry));
  }
  if (!result.warnings.empty()) json["warnings"] = result.warnings;
  json["seconds"] = {
      {"count", result.seconds.count}, {"optimise", result.seconds.optimise}, {"total", result.seconds.total}};
  return json;
}

std::string learn_text(const LearningResult& result, const LearnArguments& arguments) {
  if (!has_weights(result)) return "";  // what is wrong has been said
  std::string text = fmt::format("method {}: {} weights from {}; {} ({:.3f} s)\n", result.method, result.weights.size(),
                                 databases_text(result), to_string(result.termination), result.seconds.total);
  text += outcome_text(result) + "\n";
  if (result.objective) text += objective_text(result) + "\n";
  text += prior_text(result.options) + "\n";
  constexpr std::size_t kShown = 40;
  if (result.weights.size() <= kShown) {
    const WeightTable table(*result.model);
    text += '\n';
    for (std::size_t w = 0; w < result.weights.size(); ++w) {
      const LearnedWeight& learned = result.weights[w];
      text += fmt::format("{:12.6f}", learned.weight);
      if (result.options.standard_errors) {
        text += learned.standard_error ? fmt::format(" +- {:<10.6f}", *learned.standard_error) : std::string(14, ' ');
      }
      const char* const note = learned.fixed         ? "  (fixed)"
                               : !learned.identified ? "  (the data says nothing about it)"
                               : learned.shared      ? "  (not determined alone)"
                                                     : "";
      text += fmt::format("  {}{}\n", weight_text(*result.model, table, w), note);
    }
  }
  if (arguments.output != "-") text += fmt::format("\nwritten to {}\n", arguments.output);
  return text;
}

int learn_and_write(Session& session, const LearnArguments& arguments) {
  session.silence("no-weight");  // here that is what is asked for
  const auto model = session.read_model();
  if (!model) return kBadInput;
  const auto options = learning_options(session, *model, arguments.learning);
  if (!options) return kBadInput;
  const auto databases = read_training(session, *model, arguments.learning);
  if (!databases) return kBadInput;

  const LearningResult result = learn(*model, *databases, *options, session.monitor());
  session.release_memory();
  for (const std::string& warning : result.warnings) session.warning(warning);
  if (result.termination != Termination::kCompleted) {
    session.error(result.message + (!has_weights(result) ? "" : "; the weights are the best so far"));
  }
  if (has_weights(result)) {
    std::vector<double> weights;
    for (const LearnedWeight& learned : result.weights) weights.push_back(learned.weight);
    const WeightTable table(*result.model);
    const std::string text = learned_model_text(*result.model, table, weights, provenance(result, arguments));
    if (!session.write(arguments.output, text)) return kInternalError;
  }
  const std::string text = arguments.output == "-" ? "" : learn_text(result, arguments);
  return session.finish(exit_code(result.termination), text, [&] { return to_text(learn_json(result)); });
}

int run_learn(const LearnArguments& arguments) {
  Session session(arguments.options);
  if (!session.check_options({arguments.output}, arguments.learning.training)) return kBadInput;
  return session.run("sherlog.learn/1", [&] { return learn_and_write(session, arguments); });
}

}  // namespace

void add_learn(CLI::App& app, Action& action) {
  auto arguments = std::make_shared<LearnArguments>();
  CLI::App* command = app.add_subcommand("learn", "The weights of a model from training databases");
  add_model_options(*command, arguments->options);
  add_training_options(*command, arguments->learning, arguments->options);
  command->add_option("-o,--output", arguments->output, "The model with its learned weights; '-': standard output")
      ->type_name("OUT.mln")
      ->required();
  add_learning_options(*command, arguments->learning);
  command->add_option("--samples", arguments->learning.samples, "Draws an iteration (mcsat; default 1000)")
      ->type_name("N");
  command->add_flag("--standard-errors", arguments->learning.standard_errors,
                    "Standard errors of the weights, from the curvature at the optimum");
  add_common_options(*command, arguments->options);
  command->callback([arguments, &action] { action = [arguments] { return run_learn(*arguments); }; });
}

}  // namespace sherlog::cli
