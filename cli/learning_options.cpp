#include "cli/learning_options.h"

#include <fmt/format.h>

#include <charconv>
#include <limits>

namespace sherlog::cli {
namespace {

std::optional<double> parse_stdev(std::string_view text) {
  if (text == "inf" || text == "none") return std::numeric_limits<double>::infinity();
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size()) return std::nullopt;
  return value;
}

// "3=0.5": the third soft formula of the model.
bool add_formula_prior(Session& session, const Model& model, const std::string& text, LearningOptions& options) {
  const auto complain = [&](const std::string& what) {
    session.error(fmt::format("--formula-stdev: '{}' {}", text, what));
    return false;
  };
  const std::size_t equals = text.find('=');
  std::size_t number = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + std::min(equals, text.size()), number);
  if (equals == std::string::npos || error != std::errc() || end != text.data() + equals) {
    return complain("is not of the form NUMBER=STDEV");
  }
  const auto stdev = parse_stdev(std::string_view(text).substr(equals + 1));
  if (!stdev) return complain("has no number behind the '='");
  for (std::size_t f = 0, soft = 0; f < model.formulas().size(); ++f) {
    if (model.formulas()[f].hard || ++soft != number) continue;
    Prior prior = options.prior;
    prior.stdev = *stdev;
    options.formula_priors.emplace_back(FormulaId(f), prior);
    return true;
  }
  return complain("names no soft formula of the model; they are numbered from 1 in their order");
}

}  // namespace

void add_training_options(CLI::App& command, LearningArguments& arguments, Options& options) {
  command
      .add_option("-t,--train", arguments.training,
                  "Training databases, several in a file separated by ---; repeatable; '-': standard input")
      ->allow_extra_args(false)
      ->type_name("T.db")
      ->required();
  command.add_flag("--ignore-unknown-predicates", options.ignore_unknown_predicates,
                   "Skip evidence for predicates that the model does not declare");
}

void add_learning_options(CLI::App& command, LearningArguments& arguments) {
  std::string names, help = fmt::format("What is maximised (default {})", arguments.method);
  for (const LearningMethodInfo& info : learning_methods()) {
    names += fmt::format("{}{}", names.empty() ? "" : "|", info.name);
    help += fmt::format("\n{}: {}", info.name, info.summary);
  }
  const auto repeatable = [&](const char* name, std::vector<std::string>& values, const char* type, const char* text) {
    command.add_option(name, values, text)->allow_extra_args(false)->type_name(type);
  };
  command.add_option("--method", arguments.method, help)->type_name(names);
  repeatable("--discriminative", arguments.discriminative, "PRED,..",
             "Predicates that are to be predicted; all others are given (dpll, cll, mcsat)");
  repeatable("--block", arguments.blocks, "PRED,..",
             "Atoms of these predicates with the same arguments are one variable (bpll); repeatable");
  command.add_option("--prior-mean", arguments.prior_mean, "Mean of the Gaussian prior of each weight (default 0)")
      ->type_name("X");
  command.add_option("--prior-stdev", arguments.prior_stdev, "Its standard deviation (default 10); 'inf': no prior")
      ->type_name("X");
  repeatable("--formula-stdev", arguments.formula_stdevs, "N=X",
             "Another standard deviation for the N-th soft formula and all its instances; repeatable");
  command
      .add_option("--prior-l1", arguments.prior_l1,
                  "Rate of an L1 prior (default 0: none): many weights become exactly 0")
      ->type_name("X");
  command.add_option("--max-iterations", arguments.max_iterations, "Iterations at most (default 1000)")->type_name("N");
  command
      .add_option("--search-gap", arguments.search_gap,
                  "Share of a sum that a bounded search may leave out, where a component is too wide for elimination "
                  "(cll, ll; default 0.001)")
      ->type_name("X");
  command
      .add_option("--tolerance", arguments.tolerance,
                  "The optimum is reached where no entry of the gradient exceeds X (default 1e-6)")
      ->type_name("X");
}

std::optional<PredicateId> find_predicate(Session& session, const Model& model, const std::string& option,
                                          const std::string& name) {
  const auto found = model.find_predicate(name);
  if (found) return found;
  std::vector<std::string> names;
  for (const Predicate& predicate : model.predicates()) names.push_back(predicate.name);
  const std::string nearest = did_you_mean(name, names);
  session.error(fmt::format("{}: unknown predicate '{}'{}", option, name,
                            nearest.empty() ? "" : fmt::format("; did you mean '{}'?", nearest)));
  return std::nullopt;
}

std::optional<std::vector<Evidence>> read_training(Session& session, const Model& model,
                                                   const LearningArguments& arguments) {
  EvidenceOptions options;
  options.ignore_unknown_predicates = session.options().ignore_unknown_predicates;
  std::vector<Evidence> all;
  bool good = true;
  for (const std::string& path : arguments.training) {
    auto databases = parse_evidence_files(model, {path}, session.diagnostics(), options);
    good = good && databases.has_value();
    if (databases) std::move(databases->begin(), databases->end(), std::back_inserter(all));
  }
  session.print_diagnostics();
  if (!good) return std::nullopt;
  return all;
}

std::optional<LearningOptions> learning_options(Session& session, const Model& model,
                                                const LearningArguments& arguments) {
  LearningOptions result;
  result.method = arguments.method;
  const auto predicates = [&](const std::string& option, const std::string& list, std::vector<PredicateId>& out) {
    for (const std::string& name : CLI::detail::split(list, ',')) {
      const auto predicate = find_predicate(session, model, option, CLI::detail::trim_copy(name));
      if (!predicate) return false;
      out.push_back(*predicate);
    }
    return true;
  };
  for (const std::string& list : arguments.discriminative) {
    if (!predicates("--discriminative", list, result.discriminative)) return std::nullopt;
  }
  for (const std::string& list : arguments.blocks) {
    if (!predicates("--block", list, result.blocks.emplace_back())) return std::nullopt;
  }
  result.prior.mean = arguments.prior_mean;
  result.prior.l1 = arguments.prior_l1;
  const auto stdev = parse_stdev(arguments.prior_stdev);
  if (!stdev) {
    session.error(fmt::format("--prior-stdev: '{}' is neither a number nor 'inf'", arguments.prior_stdev));
    return std::nullopt;
  }
  result.prior.stdev = *stdev;
  for (const std::string& text : arguments.formula_stdevs) {
    if (!add_formula_prior(session, model, text, result)) return std::nullopt;
  }
  result.optimiser.max_iterations = arguments.max_iterations;
  result.optimiser.gradient_tolerance = arguments.tolerance;
  result.standard_errors = arguments.standard_errors;
  result.search_gap = arguments.search_gap;
  result.samples = arguments.samples;
  result.seed = session.options().seed;
  result.threads = session.options().threads;
  result.max_seconds = session.seconds_left();
  result.max_memory = session.max_memory();
  if (const std::string problem = validate(result); !problem.empty()) {
    session.error(problem);
    return std::nullopt;
  }
  return result;
}

}  // namespace sherlog::cli
