// The information-fusion experiment: which things are on the table? Several models, cross-validated by scene.
//
//   fusion_experiment [--data SCENES.db] [--seeds N] [--folds K] [--scenes N] [--quick] [--out FOLDER]
//
// Without --data it runs on synthetic scenes (perception_bridge/kitchen_generator.h), so it needs nothing but this
// project. For each seed the scenes are dealt into folds; for each fold every model is trained on the other scenes and
// asked for the labels of the fold's objects, all of them unknown. Priors are chosen by a second cross-validation inside
// the training scenes: one standard deviation for what speaks of one object, one for the pairs. The figures are means
// over the seeds; differences are paired by object, with an interval that takes a scene's objects (and its repetition
// under several seeds) as one observation.
#include <fmt/format.h>

#include <atomic>
#include <cstdlib>
#include <fstream>
#include <functional>
#include <map>
#include <mutex>
#include <string>
#include <thread>

#include "inference/parallel.h"
#include "learning/confusion_report.h"
#include "learning/cross_validation.h"
#include "mln/model.h"
#include "perception_bridge/kitchen_generator.h"

namespace {

using namespace sherlog;

struct Settings {
  std::string data, out;
  std::uint32_t seeds = 1, folds = 4, scenes = 12;
  bool quick = true;
};

// --- the models

struct Candidate {
  std::string name, file, method;
  bool tuned = true;       // priors chosen by nested folds; else standard deviation 10, as published
  std::size_t pairs = 0;   // how many of its last formulas are about pairs
  bool as_before = false;  // the priors of the candidate before it stay; what they leave open is searched
};

std::vector<Candidate> candidates() {
  return {
      {"published model, PLL, stdev 10", "paper.mln", "pll", false, 1},
      {"published model without pairs", "paper_alone.mln", "dpll"},
      {"published model, DPLL", "paper.mln", "dpll", true, 1, true},
      {"published model, PLL", "paper.mln", "pll", true, 1, true},
      {"logistic regression on annotations", "annotations.mln", "dpll"},
      {"extended model without pairs", "extended_alone.mln", "dpll"},
      {"extended model, CLL", "extended.mln", "cll", true, 1, true},
      {"extended model, PLL", "extended.mln", "pll", true, 1, true},
  };
}

// --- a baseline that is no Markov logic model

// Naive Bayes on the annotations that are there: P(label) * product of P(annotation | label), Laplace-smoothed.
class NaiveBayes {
 public:
  NaiveBayes(const Model& model, std::span<const Evidence> databases, PredicateId target)
      : model_(model), databases_(databases), target_(target), scene_(model.find_predicate("scene")) {}

  struct Object {
    std::string name, label;
    std::vector<std::pair<std::string, std::string>> annotations;  // (predicate, value)
  };

  std::vector<Object> objects(std::size_t database) const {
    const Evidence& evidence = databases_[database];
    std::map<std::string, Object> by_cluster;
    std::vector<std::pair<std::string, std::string>> common;
    for (std::size_t p = 0; p < model_.predicates().size(); ++p) {
      const Predicate& predicate = model_.predicates()[p];
      const PredicateEvidence& stated = evidence.of(PredicateId(p));
      for (std::size_t a = 0; a < stated.size(); ++a) {
        if (stated.kinds[a] != EvidenceKind::kTrue) continue;
        const auto constant = [&](std::size_t i) {
          return evidence.constant_name(model_, predicate.domains[i], stated.arguments[a * predicate.arity() + i]);
        };
        if (predicate.arity() == 1) {
          common.emplace_back(predicate.name, constant(0));
          continue;
        }
        Object& object = by_cluster[constant(0)];
        if (PredicateId(p) == target_) {
          object.label = constant(1);
        } else {
          object.annotations.emplace_back(predicate.name, constant(1));
        }
      }
    }
    std::vector<Object> result;
    for (auto& [name, object] : by_cluster) {
      if (object.label.empty()) continue;
      object.name = name;
      object.annotations.insert(object.annotations.end(), common.begin(), common.end());
      result.push_back(std::move(object));
    }
    return result;
  }

  std::vector<Prediction> cross_validate(const std::vector<std::string>& labels,
                                         const std::vector<std::uint32_t>& fold_of, std::uint32_t folds) const {
    std::vector<Prediction> predictions;
    for (std::uint32_t fold = 0; fold < folds; ++fold) {
      std::map<std::string, double> label_count;
      std::map<std::string, std::map<std::pair<std::string, std::string>, double>> count;  // by label
      std::map<std::string, std::map<std::string, double>> values;                         // by predicate
      double total = 0.0;
      for (std::size_t d = 0; d < fold_of.size(); ++d) {
        if (fold_of[d] == fold) continue;
        for (const Object& object : objects(d)) {
          label_count[object.label] += 1.0;
          total += 1.0;
          for (const auto& annotation : object.annotations) {
            count[object.label][annotation] += 1.0;
            values[annotation.first][annotation.second] += 1.0;
          }
        }
      }
      for (std::uint32_t d = 0; d < fold_of.size(); ++d) {
        if (fold_of[d] != fold) continue;
        for (const Object& object : objects(d)) {
          Prediction prediction;
          prediction.database = d;
          prediction.example = object.name;
          std::vector<double> score;
          for (std::size_t l = 0; l < labels.size(); ++l) {
            const double n = label_count[labels[l]];
            double s = std::log((n + 1.0) / (total + static_cast<double>(labels.size())));
            for (const auto& annotation : object.annotations) {
              const auto v = static_cast<double>(values[annotation.first].size());
              s += std::log((count[labels[l]][annotation] + 1.0) / (n + v + 1.0));
            }
            score.push_back(s);
            if (labels[l] == object.label) prediction.truth = static_cast<std::uint32_t>(l);
          }
          const double top = *std::max_element(score.begin(), score.end());
          double sum = 0.0;
          for (double& s : score) sum += s = std::exp(s - top);
          for (const double s : score) prediction.probabilities.push_back(s / sum);
          predictions.push_back(std::move(prediction));
        }
      }
    }
    return predictions;
  }

 private:
  const Model& model_;
  std::span<const Evidence> databases_;
  PredicateId target_;
  std::optional<PredicateId> scene_;
};

// --- runs

struct Run {
  std::vector<Prediction> predictions;
  Evaluation evaluation;
  double train_seconds = 0.0, test_seconds = 0.0;
  std::vector<std::vector<double>> stdevs;  // by fold
  std::string problem;
};

struct Row {
  std::string name;
  std::vector<Run> runs;  // by seed

  double mean(const std::function<double(const Run&)>& figure) const {
    double sum = 0.0;
    for (const Run& run : runs) sum += figure(run);
    return sum / static_cast<double>(runs.size());
  }
  // Of all seeds, one after the other.
  ExampleScores scores() const {
    std::vector<Prediction> all;
    for (const Run& run : runs) all.insert(all.end(), run.predictions.begin(), run.predictions.end());
    return example_scores(all);
  }
};

void sort_by_scene(std::vector<Prediction>& predictions) {
  std::sort(predictions.begin(), predictions.end(), [](const Prediction& a, const Prediction& b) {
    return std::tie(a.database, a.example) < std::tie(b.database, b.example);
  });
}

Run run_candidate(const Candidate& candidate, const Model& model, std::span<const Evidence> databases,
                  const Settings& settings, std::uint64_t seed, const Run* before) {
  CrossValidationOptions options;
  options.target = *model.find_predicate("object");
  options.folds = settings.folds;
  options.seed = seed;
  options.learning.method = candidate.method;
  options.learning.threads = 1;
  options.learning.search_gap = 1e-2;  // nats for a scene: far below what its five objects can tell
  options.learning.optimiser.gradient_tolerance = 1e-3;
  options.learning.optimiser.function_tolerance = 1e-8;
  options.inference.threads = 1;
  options.inference.seed = seed;
  options.inference.search_gap = 1e-4;
  options.inference.samples = 5000;  // of the few scenes that are too wide for exact sums
  options.tuning_method = "dpll";
  options.tuning_folds = 3;
  if (candidate.tuned) {
    // What speaks of one object gets its prior from the model without pairs, the pairs after that.
    TuningGroup evidence, pairs;
    if (settings.quick) {
      evidence.stdevs = {3.0}, pairs.stdevs = {0.5};
    } else {
      evidence.stdevs = {1.0, 1.5, 2.0, 3.0, 4.0, 6.0}, pairs.stdevs = {0.5, 0.3, 0.8};
    }
    const std::size_t count = model.formulas().size();
    for (std::size_t f = 0; f < count; ++f) {
      (f + candidate.pairs >= count ? pairs : evidence).formulas.emplace_back(f);
    }
    options.tuning.push_back(std::move(evidence));
    if (candidate.pairs > 0) options.tuning.push_back(std::move(pairs));
    if (before != nullptr) options.chosen_stdevs = before->stdevs;
  }
  Monitor monitor;
  CrossValidationResult result = cross_validate(model, databases, options, monitor);
  Run run;
  if (result.termination != Termination::kCompleted) run.problem = result.message;
  run.predictions = std::move(result.predictions);
  sort_by_scene(run.predictions);
  run.evaluation = std::move(result.evaluation);
  for (const FoldResult& fold : result.folds) {
    run.train_seconds += fold.train_seconds;
    run.test_seconds += fold.test_seconds;
    run.stdevs.push_back(fold.stdevs);
  }
  return run;
}

// --- the report

std::string results_table(const std::vector<Row>& rows) {
  std::string text =
      "| model | accuracy | log-loss | macro F1 | calibration error | training s | test s |\n"
      "| --- | --- | --- | --- | --- | --- | --- |\n";
  for (const Row& row : rows) {
    text += fmt::format("| {} | {:.4f} | {:.4f} | {:.4f} | {:.4f} | {:.1f} | {:.1f} |\n", row.name,
                        row.mean([](const Run& r) { return r.evaluation.accuracy; }),
                        row.mean([](const Run& r) { return r.evaluation.log_loss; }),
                        row.mean([](const Run& r) { return r.evaluation.macro_f1; }),
                        row.mean([](const Run& r) { return r.evaluation.calibration_error; }),
                        row.mean([](const Run& r) { return r.train_seconds; }),
                        row.mean([](const Run& r) { return r.test_seconds; }));
  }
  return text;
}

const Row* find(const std::vector<Row>& rows, const std::string& name) {
  for (const Row& row : rows) {
    if (row.name == name) return &row;
  }
  return nullptr;
}

std::string differences_table(const std::vector<Row>& rows) {
  const std::pair<const char*, const char*> kPairs[] = {
      {"extended model, CLL", "extended model without pairs"},
      {"extended model, CLL", "logistic regression on annotations"},
      {"extended model, CLL", "naive Bayes"},
      {"extended model, CLL", "extended model, PLL"},
      {"published model, DPLL", "published model without pairs"},
      {"published model, DPLL", "published model, PLL, stdev 10"},
  };
  std::string text =
      "| difference, paired by scene | accuracy [95 % interval] | log-loss [95 % interval] |\n| --- | --- | --- |\n";
  for (const auto& [better, worse] : kPairs) {
    const Row *a = find(rows, better), *b = find(rows, worse);
    if (a == nullptr || b == nullptr) continue;
    const ExampleScores x = a->scores(), y = b->scores();
    const PairedDifference accuracy = paired_by_group(x.accuracy, y.accuracy, x.groups);
    const PairedDifference loss = paired_by_group(x.log_loss, y.log_loss, x.groups);
    text += fmt::format("| {} - {} | {:+.4f} [{:+.4f}, {:+.4f}] | {:+.4f} [{:+.4f}, {:+.4f}] |\n", better, worse,
                        accuracy.mean, accuracy.lower, accuracy.upper, loss.mean, loss.lower, loss.upper);
  }
  return text;
}

std::string priors_table(const std::vector<Row>& rows) {
  std::string text = "| model | standard deviations chosen, evidence/pairs: how often |\n| --- | --- |\n";
  for (const Row& row : rows) {
    std::map<std::vector<double>, int> chosen;
    for (const Run& run : row.runs) {
      for (const auto& stdevs : run.stdevs) ++chosen[stdevs];
    }
    std::string list;
    for (const auto& [stdevs, count] : chosen) {
      if (!stdevs.empty()) list += fmt::format("{}{}: {}", list.empty() ? "" : ", ", fmt::join(stdevs, "/"), count);
    }
    if (!list.empty()) text += fmt::format("| {} | {} |\n", row.name, list);
  }
  return text;
}

bool write(const std::string& path, const std::string& text) {
  std::ofstream file(path);
  file << text;
  return static_cast<bool>(file);
}

bool read_settings(int argc, char** argv, Settings& settings) {
  for (int i = 1; i < argc; ++i) {
    const std::string option = argv[i];
    const auto value = [&] { return i + 1 < argc ? std::string(argv[++i]) : std::string(); };
    if (option == "--data") {
      settings.data = value();
      settings.quick = false;
      settings.seeds = 10;
      settings.folds = 5;
    } else if (option == "--seeds") {
      settings.seeds = static_cast<std::uint32_t>(std::atoi(value().c_str()));
    } else if (option == "--folds") {
      settings.folds = static_cast<std::uint32_t>(std::atoi(value().c_str()));
    } else if (option == "--scenes") {
      settings.scenes = static_cast<std::uint32_t>(std::atoi(value().c_str()));
      settings.quick = false;
    } else if (option == "--quick") {
      settings.quick = true;
    } else if (option == "--out") {
      settings.out = value();
    } else {
      fmt::print(stderr, "usage: {} [--data SCENES.db] [--seeds N] [--folds K] [--scenes N] [--quick] [--out FOLDER]\n",
                 argv[0]);
      return false;
    }
  }
  return settings.seeds > 0 && settings.folds > 1;
}

}  // namespace

int main(int argc, char** argv) {
  Settings settings;
  if (!read_settings(argc, argv, settings)) return 2;

  // Each model file with the same scenes: evidence belongs to a model.
  const std::vector<Candidate> all = candidates();
  std::vector<Model> models;
  std::vector<std::vector<Evidence>> data;
  Diagnostics diagnostics;
  KitchenConfig kitchen = default_kitchen();
  if (settings.quick) kitchen.object_counts = {0, 0, 1, 1, 1};  // few things on each table: a try of seconds
  const std::string synthetic = settings.data.empty() ? kitchen_text(kitchen, 1, settings.scenes) : std::string();
  for (const Candidate& candidate : all) {
    auto model = parse_model_file("models/information_fusion/experiment/" + candidate.file, diagnostics);
    if (!model) return std::fputs(diagnostics.render().c_str(), stderr), 2;
    auto databases = settings.data.empty() ? parse_evidence(*model, synthetic, "synthetic.db", diagnostics)
                                           : parse_evidence_files(*model, {settings.data}, diagnostics);
    if (!databases) return std::fputs(diagnostics.render().c_str(), stderr), 2;
    models.push_back(std::move(*model));
    data.push_back(std::move(*databases));
  }

  // All runs are independent of each other; longest first.
  std::vector<Row> rows(all.size());
  for (std::size_t c = 0; c < all.size(); ++c) {
    rows[c].name = all[c].name;
    rows[c].runs.resize(settings.seeds);
  }
  std::atomic<std::size_t> next{0};
  std::mutex mutex;
  const std::size_t jobs = all.size() * settings.seeds;
  run_on_threads(std::max(1u, std::thread::hardware_concurrency()), [&] {
    for (std::size_t job = next++; job < jobs; job = next++) {
      const std::size_t first = all.size() - 1 - job % all.size(), seed = job / all.size();
      if (all[first].as_before) continue;  // with its predecessor
      const Run* before = nullptr;
      for (std::size_t c = first; c == first || (c < all.size() && all[c].as_before); ++c) {
        Run run = run_candidate(all[c], models[c], data[c], settings, seed + 1, before);
        const std::lock_guard lock(mutex);
        fmt::print(stderr, "seed {} {}: accuracy {:.4f}, log-loss {:.4f} {}\n", seed + 1, all[c].name,
                   run.evaluation.accuracy, run.evaluation.log_loss, run.problem);
        rows[c].runs[seed] = std::move(run);
        before = &rows[c].runs[seed];
        if (!before->problem.empty()) break;
      }
    }
  });
  for (const Row& row : rows) {
    for (const Run& run : row.runs) {
      if (!run.problem.empty()) return fmt::print(stderr, "{}: {}\n", row.name, run.problem), 1;
    }
  }

  Row bayes{"naive Bayes", {}};
  const NaiveBayes naive(models.back(), data.back(), *models.back().find_predicate("object"));
  const std::vector<std::string>& labels = rows.back().runs[0].evaluation.labels;
  for (std::uint32_t seed = 1; seed <= settings.seeds; ++seed) {
    Run run;
    run.predictions =
        naive.cross_validate(labels, deal_folds(data.back().size(), settings.folds, seed), settings.folds);
    sort_by_scene(run.predictions);
    run.evaluation = evaluate(labels, run.predictions);
    bayes.runs.push_back(std::move(run));
  }
  rows.insert(rows.begin(), std::move(bayes));

  const Evaluation& main_result = find(rows, "extended model, CLL")->runs[0].evaluation;
  std::string report =
      fmt::format("{} scenes, {} objects, {} classes; {} folds by scene, mean over {} seeds\n\n{}\n{}\n{}",
                  data.back().size(), main_result.examples, labels.size(), settings.folds, settings.seeds,
                  results_table(rows), differences_table(rows), priors_table(rows));
  fmt::print("{}", report);
  if (settings.out.empty()) return 0;
  const std::string base = settings.out + "/";
  const bool written = write(base + "report.md", report) &&
                       write(base + "confusion.txt", confusion_text(main_result)) &&
                       write(base + "confusion.csv", confusion_csv(main_result)) &&
                       write(base + "confusion.tex", confusion_latex(main_result)) &&
                       write(base + "confusion.svg", confusion_svg(main_result, "Extended model, CLL, seed 1")) &&
                       write(base + "confusion.html", confusion_html(main_result, "Extended model, CLL, seed 1"));
  if (!written) return fmt::print(stderr, "cannot write to '{}'\n", settings.out), 1;
  return 0;
}
