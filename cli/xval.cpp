// sherlog xval: k-fold cross-validation by database.
#include <fmt/format.h>

#include <charconv>
#include <memory>
#include <sstream>

#include "cli/commands.h"
#include "cli/learning_options.h"
#include "cli/report.h"
#include "learning/confusion_report.h"
#include "learning/cross_validation.h"
#include "mln/text_file.h"

namespace sherlog::cli {
namespace {

struct XvalArguments {
  Options options;  // its method is that of inference
  LearningArguments learning;
  std::uint32_t folds = 5;
  std::string fold_file;
  std::vector<std::string> tuning;
  std::string tuning_method;
  std::uint32_t tuning_folds = 4, tuning_rounds = 1;
  std::string csv, latex, svg, html, predictions;
};

std::vector<std::string> outputs(const XvalArguments& arguments) {
  std::vector<std::string> files;
  for (const std::string* path :
       {&arguments.csv, &arguments.latex, &arguments.svg, &arguments.html, &arguments.predictions}) {
    if (!path->empty()) files.push_back(*path);
  }
  return files;
}

std::vector<std::string> inputs(const XvalArguments& arguments) {
  std::vector<std::string> files = arguments.learning.training;
  if (!arguments.fold_file.empty()) files.push_back(arguments.fold_file);
  return files;
}

// Whole numbers separated by white space: the fold of each database, counted from 1.
bool read_folds(Session& session, const std::string& path, CrossValidationOptions& options) {
  const TextFile file = load_text_file(path);
  if (!file.text) return session.error(fmt::format("--fold-file: '{}' {}", path, file.problem)), false;
  std::uint32_t largest = 0;
  std::istringstream words(*file.text);
  for (std::string word; words >> word;) {
    std::uint32_t fold = 0;
    const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), fold);
    if (error != std::errc() || end != word.data() + word.size() || fold == 0) {
      return session.error(fmt::format("{}: '{}' is not the number of a fold (1, 2, ...)", path, word)), false;
    }
    largest = std::max(largest, fold);
    options.fold_of.push_back(fold - 1);
  }
  if (largest < 2) {
    return session.error(fmt::format("{}: names {}; there must be two or more", path,
                                     largest == 0 ? "no fold" : "one fold only")),
           false;
  }
  options.folds = largest;
  return true;
}

// "1-6,8=0.5,1,2": soft formulas 1 to 6 and 8 get one of these standard deviations.
bool add_tuning(Session& session, const Model& model, const std::string& text, CrossValidationOptions& options) {
  const auto complain = [&](const std::string& what) {
    session.error(fmt::format("--tune: '{}' {}; expected e.g. 1-6,8=0.5,1,2", text, what));
    return false;
  };
  std::vector<FormulaId> soft;
  for (std::size_t f = 0; f < model.formulas().size(); ++f) {
    if (!model.formulas()[f].hard) soft.emplace_back(f);
  }
  const std::size_t equals = text.find('=');
  if (equals == std::string::npos) return complain("has no '='");
  TuningGroup group;
  for (const std::string& range : CLI::detail::split(text.substr(0, equals), ',')) {
    std::size_t first = 0, last = 0;
    const char* const end = range.data() + range.size();
    auto parsed = std::from_chars(range.data(), end, first);
    last = first;
    if (parsed.ec == std::errc() && parsed.ptr != end && *parsed.ptr == '-') {
      parsed = std::from_chars(parsed.ptr + 1, end, last);
    }
    if (parsed.ec != std::errc() || parsed.ptr != end) return complain("has something else than numbers of formulas");
    if (first < 1 || last < first || last > soft.size()) {
      return complain(fmt::format("names formulas that are not there (the model has {} soft ones)", soft.size()));
    }
    for (std::size_t f = first; f <= last; ++f) group.formulas.push_back(soft[f - 1]);
  }
  for (const std::string& value : CLI::detail::split(text.substr(equals + 1), ',')) {
    double stdev = 0;
    const auto [end, error] = std::from_chars(value.data(), value.data() + value.size(), stdev);
    if (error != std::errc() || end != value.data() + value.size() || !(stdev > 0)) {
      return complain(fmt::format("has '{}' where a standard deviation above 0 should be", value));
    }
    group.stdevs.push_back(stdev);
  }
  options.tuning.push_back(std::move(group));
  return true;
}

Json xval_json(const CrossValidationResult& result) {
  const Evaluation& evaluation = result.evaluation;
  Json json;
  json["schema"] = "sherlog.xval/1";
  json["method"] = result.method;
  json["termination"] = to_string(result.termination);
  if (!result.message.empty()) json["message"] = result.message;
  json["examples"] = evaluation.examples;
  if (evaluation.examples > 0) {
    json["accuracy"] = evaluation.accuracy;
    json["macro_precision"] = evaluation.macro_precision;
    json["macro_recall"] = evaluation.macro_recall;
    json["macro_f1"] = evaluation.macro_f1;
    json["log_loss"] = evaluation.log_loss;
    json["calibration_error"] = evaluation.calibration_error;
  }
  json["confusion"] = {{"labels", evaluation.labels}, {"counts", evaluation.counts}};
  json["folds"] = Json::array();
  for (const FoldResult& fold : result.folds) {
    Json entry;
    entry["databases"] = fold.databases;
    entry["examples"] = fold.examples;
    entry["train_seconds"] = fold.train_seconds;
    entry["test_seconds"] = fold.test_seconds;
    if (fold.examples > 0) {
      entry["accuracy"] = fold.accuracy;
      entry["log_loss"] = fold.log_loss;
    }
    entry["converged"] = fold.converged;
    for (const double stdev : fold.stdevs) entry["prior_stdevs"].push_back(finite_or_inf(stdev));
    json["folds"].push_back(std::move(entry));
  }
  if (!result.warnings.empty()) json["warnings"] = result.warnings;
  json["seconds"] = {{"count", result.count_seconds}, {"total", result.seconds}};
  return json;
}

std::string xval_text(const CrossValidationResult& result) {
  if (result.folds.empty()) return "";  // what is wrong has been said
  const Evaluation& e = result.evaluation;
  std::string text = fmt::format("method {}, {} folds, {} examples; {} ({:.2f} s)\n\n", result.method,
                                 result.folds.size(), e.examples, to_string(result.termination), result.seconds);
  text += fmt::format("{:>5} {:>10} {:>9} {:>9} {:>9} {:>8} {:>8}  {}\n", "fold", "databases", "examples", "accuracy",
                      "log-loss", "train s", "test s", result.folds[0].stdevs.empty() ? "" : "prior stdevs");
  for (std::size_t f = 0; f < result.folds.size(); ++f) {
    const FoldResult& fold = result.folds[f];
    const bool measured = fold.examples > 0;
    text += fmt::format("{:>5} {:>10} {:>9} {:>9} {:>9} {:>8.3f} {:>8.3f}  {}\n", f + 1, fold.databases, fold.examples,
                        measured ? fmt::format("{:.4f}", fold.accuracy) : "-",
                        measured ? fmt::format("{:.4f}", fold.log_loss) : "-", fold.train_seconds, fold.test_seconds,
                        fmt::join(fold.stdevs, " "));
  }
  if (e.examples == 0) return text;
  text += "\n" + evaluation_text(e);
  if (e.labels.size() <= 40) text += "\n" + confusion_text(e);
  return text;
}

// RFC 4180.
std::string csv_field(const std::string& text) {
  if (text.find_first_of(",\"\r\n") == std::string::npos) return text;
  std::string quoted = "\"";
  for (const char c : text) quoted += c == '"' ? std::string("\"\"") : std::string(1, c);
  return quoted + "\"";
}

std::string predictions_csv(const CrossValidationResult& result) {
  std::string text = "database,example,truth,predicted,probability_of_truth\n";
  for (const Prediction& p : result.predictions) {
    text += fmt::format("{},{},{},{},{}\n", p.database + 1, csv_field(p.example), csv_field(result.labels[p.truth]),
                        csv_field(result.labels[predicted_label(p)]), p.probabilities[p.truth]);
  }
  return text;
}

bool write_reports(Session& session, const XvalArguments& arguments, const CrossValidationResult& result) {
  const auto write = [&](const std::string& path, const auto& make) {
    return path.empty() || session.write(path, make());
  };
  const Evaluation& e = result.evaluation;
  return write(arguments.csv, [&] { return confusion_csv(e); }) &&
         write(arguments.latex, [&] { return confusion_latex(e); }) &&
         write(arguments.svg, [&] { return confusion_svg(e, "Cross-validation"); }) &&
         write(arguments.html, [&] { return confusion_html(e, "Cross-validation"); }) &&
         write(arguments.predictions, [&] { return predictions_csv(result); });
}

int validate_and_write(Session& session, const XvalArguments& arguments) {
  if (arguments.options.queries.size() != 1) {
    return session.error("name the one predicate that is to be predicted with -q"), kBadInput;
  }
  session.silence("no-weight");  // here that is what is asked for
  const auto model = session.read_model();
  if (!model) return kBadInput;
  const auto target = find_predicate(session, *model, "-q", arguments.options.queries[0]);
  if (!target) return kBadInput;
  LearningArguments learning = arguments.learning;
  // What is asked is what is to be predicted.
  const std::vector<std::string> asked{arguments.options.queries[0]};
  if (!learning.discriminative.empty() && learning.discriminative != asked) {
    return session.error("--discriminative: cross-validation predicts the predicate of -q, and no other"), kBadInput;
  }
  learning.discriminative = asked;
  for (const LearningMethodInfo& info : learning_methods()) {
    if (info.name == learning.method && !info.discriminative) learning.discriminative.clear();
  }
  const auto learning_chosen = learning_options(session, *model, learning);
  if (!learning_chosen) return kBadInput;
  CrossValidationOptions options;
  options.target = *target;
  options.folds = arguments.folds;
  options.seed = arguments.options.seed;
  options.learning = *learning_chosen;
  options.inference = session.inference_options();
  options.inference.search_gap = 1e-4;  // far below what sampling would miss
  options.tuning_method = arguments.tuning_method;
  options.tuning_folds = arguments.tuning_folds;
  options.tuning_rounds = arguments.tuning_rounds;
  for (const std::string& text : arguments.tuning) {
    if (!add_tuning(session, *model, text, options)) return kBadInput;
  }
  if (!arguments.fold_file.empty() && !read_folds(session, arguments.fold_file, options)) return kBadInput;
  const auto databases = read_training(session, *model, learning);
  if (!databases) return kBadInput;

  const CrossValidationResult result = cross_validate(*model, *databases, options, session.monitor());
  session.release_memory();
  for (const std::string& warning : result.warnings) session.warning(warning);
  if (result.termination != Termination::kCompleted) {
    session.error(result.message + (result.folds.empty() ? "" : "; the figures are those of the folds so far"));
  }
  if (result.evaluation.examples > 0 && !write_reports(session, arguments, result)) return kInternalError;
  return session.finish(exit_code(result.termination), xval_text(result), [&] { return to_text(xval_json(result)); });
}

int run_xval(const XvalArguments& arguments) {
  Session session(arguments.options);
  if (!session.check_options(outputs(arguments), inputs(arguments))) return kBadInput;
  return session.run("sherlog.xval/1", [&] { return validate_and_write(session, arguments); });
}

}  // namespace

void add_xval(CLI::App& app, Action& action) {
  auto arguments = std::make_shared<XvalArguments>();
  CLI::App* command = app.add_subcommand("xval", "How well a model predicts databases it was not trained on");
  add_model_options(*command, arguments->options);
  add_training_options(*command, arguments->learning, arguments->options);
  command->add_option("-q,--query", arguments->options.queries, "The predicate that is to be predicted")
      ->allow_extra_args(false)
      ->type_name("PRED")
      ->required();
  command->add_option("--folds", arguments->folds, "Folds, dealt by the seed (default 5)")->type_name("K");
  command
      ->add_option("--fold-file", arguments->fold_file,
                   "The fold (1, 2, ...) of each database, separated by white space, in place of --folds")
      ->type_name("FILE");
  arguments->learning.method = "cll";
  add_learning_options(*command, arguments->learning);
  command
      ->add_option("--tune", arguments->tuning,
                   "FORMULAS=STDEVS, e.g. 1-6,8=0.5,1,2: these soft formulas share the standard deviation that does "
                   "best in a cross-validation inside each fold's training databases; repeatable")
      ->allow_extra_args(false)
      ->type_name("F=X,..");
  command
      ->add_option("--tune-method", arguments->tuning_method,
                   "Method of learning inside that search, e.g. dpll where cll is slow (default: that of --method)")
      ->type_name("METHOD");
  command->add_option("--tune-folds", arguments->tuning_folds, "Folds of that inner cross-validation (default 4)")
      ->check(CLI::Range(2u, 1000000u).description(""))
      ->type_name("K");
  command->add_option("--tune-rounds", arguments->tuning_rounds, "Rounds through all --tune groups (default 1)")
      ->check(CLI::Range(1u, 100u).description(""))
      ->type_name("N");
  command->add_option("--csv", arguments->csv, "Confusion matrix as CSV")->type_name("FILE");
  command->add_option("--latex", arguments->latex, "Confusion matrix as LaTeX")->type_name("FILE");
  command->add_option("--svg", arguments->svg, "Confusion matrix as a picture")->type_name("FILE");
  command->add_option("--html", arguments->html, "Confusion matrix and calibration as a page")->type_name("FILE");
  command->add_option("--predictions", arguments->predictions, "What was predicted for each example, as CSV")
      ->type_name("FILE");
  add_common_options(*command, arguments->options);
  command->callback([arguments, &action] { action = [arguments] { return run_xval(*arguments); }; });
}

}  // namespace sherlog::cli
