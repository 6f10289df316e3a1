// sherlog scenes evidence, reprocess, mapping, sigmas: from stored scenes to a model's evidence and answers.
#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <memory>

#include "cli/scenes.h"
#include "cli/table.h"
#include "mln/parser.h"
#include "mln/text_file.h"
#include "perception_bridge/observe.h"

namespace sherlog::cli {
namespace {

struct Observing {
  StoreChoice store;
  std::vector<std::string> scenes;
  std::string mapping = "fusion";
  bool labels = false, fuzzy = false, crisp = false;
  std::string against;
  std::string output = "-";
};

// Two moments are compared where the user says with what, or where the mapping can do nothing else.
bool compares(const EvidenceMapping& mapping, const Observing& observing) {
  return !observing.against.empty() || mapping.rules.empty();
}

// The evidence of one scene, or nothing after saying why.
std::optional<SceneObservation> observe_stored(Session& session, SceneStore& store, const EvidenceMapping& mapping,
                                               const Observing& observing, const Scene& scene) {
  if (!compares(mapping, observing)) {
    ObserveOptions options;
    options.labels = observing.labels;
    if (observing.fuzzy) options.fuzzy = true;
    if (observing.crisp) options.fuzzy = false;
    return observe(mapping, scene, options);
  }
  const bool previous = observing.against.empty() || observing.against == "previous";
  const auto id = previous ? store.scene_before(scene.id) : std::optional(observing.against);
  if (!id) return observe_change(mapping, {}, scene);
  const auto before = store.scene(*id);
  if (!before) {
    if (!store.was_stopped()) session.error(fmt::format("--against: the store has no scene '{}'", *id));
    return std::nullopt;
  }
  return observe_change(mapping, before->clusters, scene);
}

// The ids that are asked for, or those of the time.
std::optional<std::vector<std::string>> chosen_scenes(Session& session, SceneStore& store, const Observing& observing) {
  std::vector<std::string> ids = observing.scenes;
  if (ids.empty()) {
    const auto filter = scene_filter(session, store, observing.store);
    if (!filter) return std::nullopt;
    for (const SceneSummary& scene : store.scenes(*filter)) ids.push_back(scene.id);
    if (store.problem().empty()) return ids;
    if (!store.was_stopped()) session.error(store.problem());
    return std::nullopt;
  }
  for (const std::string& id : ids) {
    if (store.has(id)) continue;
    if (!store.was_stopped()) {
      session.error(store.problem().empty() ? fmt::format("the store has no scene '{}'", id) : store.problem());
    }
    return std::nullopt;
  }
  return ids;
}

int write_evidence(Session& session, const Observing& observing) {
  const auto mapping = read_mapping(session, observing.mapping);
  if (!mapping) return kBadInput;
  auto store = open_to_read(session, observing.store);
  if (!store) return kBadInput;
  const auto ids = chosen_scenes(session, *store, observing);
  if (!ids) return store->was_stopped() ? finish_unread(session, *store, "sherlog.scenes.evidence/1") : kBadInput;
  std::string text;
  Json json{{"schema", "sherlog.scenes.evidence/1"},
            {"termination", to_string(Termination::kCompleted)},
            {"mapping", mapping->name},
            {"scenes", Json::array()}};
  std::size_t notes = 0, done = 0;
  Termination termination = Termination::kCompleted;
  for (const std::string& id : *ids) {
    const auto scene = store->scene(id);
    const auto observation = scene ? observe_stored(session, *store, *mapping, observing, *scene) : std::nullopt;
    termination = store->was_stopped() ? stopped_by(session) : Termination::kCompleted;
    if (termination != Termination::kCompleted) break;
    if (!scene) return session.error(store->problem()), kBadInput;
    if (!observation) return kBadInput;
    const std::string one = evidence_text(*observation);
    if (!text.empty()) text += "---\n";
    text += fmt::format("// {}\n{}", on_one_line(id), one);
    json["scenes"].push_back({{"scene", id}, {"text", one}, {"notes", observation->notes}});
    for (const std::string& note : observation->notes) {
      if (++notes <= 20) session.warning(fmt::format("{}: {}", id, note));
    }
    ++done;
  }
  if (notes > 20) session.warning(fmt::format("{} more such notes", notes - 20));
  if (termination != Termination::kCompleted) {
    json["termination"] = to_string(termination);
    session.error(fmt::format("{} after {} of {} scenes", stop_words(termination), done, ids->size()));
  }
  if (observing.output != "-") {
    if (!session.write(observing.output, text)) return kInternalError;
    text = fmt::format("{} databases\n", done);
  }
  return session.finish(exit_code(termination), text, [&] { return to_text(json); });
}

int run_evidence(Options options, const Observing& observing) {
  Session session(std::move(options));
  if (!session.check_options({observing.output})) return kBadInput;
  return session.run("sherlog.scenes.evidence/1", [&] { return write_evidence(session, observing); });
}

// What came of going over the stored scenes again.
struct Reprocessed {
  std::size_t scenes = 0, changed = 0, fresh = 0, beliefs = 0, failed = 0;
  Termination failure = Termination::kCompleted;  // of the first scene without an answer
};

// The marginals of the model on a scene's evidence; nothing where there are none, which is said, with the reason in `failure`.
std::optional<Value> infer_belief(Session& session, const Model& model, const std::string& scene,
                                  const std::string& text, GroundingOptions grounding, Termination& failure) {
  failure = Termination::kRefused;
  grounding.max_seconds = session.seconds_left();
  Diagnostics diagnostics;
  EvidenceOptions evidence_options;
  evidence_options.ignore_unknown_predicates = session.options().ignore_unknown_predicates;
  const auto databases = parse_evidence(model, text, scene, diagnostics, evidence_options);
  const auto query =
      databases ? parse_query(model, databases->front(), session.options().queries, diagnostics) : std::nullopt;
  if (!query) {
    session.print_message(diagnostics.render());
    return std::nullopt;
  }
  const auto grounded = ground(model, databases->front(), *query, grounding, session.monitor());
  const auto say = [&](Termination why, const std::string& message, const std::vector<ConflictItem>& conflict) {
    failure = why;
    const std::string words = fmt::format("{}: {}", scene, message.empty() ? to_string(why) : message);
    if (why == Termination::kNoPossibleWorld) {
      session.print_message(conflict_text(conflict, words));
    } else {
      session.error(words);
    }
  };
  if (!grounded.network) {
    const bool no_words = grounded.message.empty() && grounded.conflict;
    say(grounded.termination, no_words ? grounded.conflict->sentence : grounded.message,
        grounded.conflict ? conflict_items(*grounded.conflict) : std::vector<ConflictItem>());
    return std::nullopt;
  }
  const InferenceResult result = infer(*grounded.network, session.inference_options(), session.monitor());
  if (result.termination != Termination::kCompleted) {
    const bool conflicts = result.termination == Termination::kNoPossibleWorld;
    say(result.termination, result.message,
        conflicts ? conflict_items(model, databases->front(), *grounded.network, result.conflict)
                  : std::vector<ConflictItem>());
    return std::nullopt;
  }
  InferenceReport report;
  report.model = &model;
  report.evidence = &databases->front();
  report.network = &*grounded.network;
  report.result = result;
  const Json json = infer_json(report);
  Json belief{{"method", json.value("method", "")}, {"marginals", json.value("marginals", Json::array())}};
  if (json.contains("map")) belief["map"] = json["map"];
  std::string problem;
  return parse_json(belief.dump(), problem);
}

int reprocess_scenes(Session& session, const Observing& observing, const EvidenceMapping& mapping, SceneStore& store) {
  std::optional<Model> model;
  std::optional<GroundingOptions> grounding;
  if (session.options().models.empty()) {
    if (!session.options().queries.empty()) return session.error("--query needs a --model"), kBadInput;
  } else {
    if (session.options().queries.empty()) return session.error("--model needs a --query"), kBadInput;
    model = session.read_model();
    if (model) grounding = session.grounding_options(*model);
    if (!grounding) return kBadInput;
  }
  const auto ids = chosen_scenes(session, store, observing);
  if (!ids) return kBadInput;
  Reprocessed done;
  constexpr std::size_t kBatch = 200;
  if (!store.begin()) return session.error(store.problem()), kBadInput;
  Termination termination = Termination::kCompleted;
  for (const std::string& id : *ids) {
    session.monitor().progress("scenes", static_cast<double>(done.scenes), static_cast<double>(ids->size()));
    termination = stopped_by(session);
    if (termination != Termination::kCompleted) break;
    const auto scene = store.scene(id);
    const auto observation = scene ? observe_stored(session, store, mapping, observing, *scene) : std::nullopt;
    if (!observation) break;
    const std::string text = evidence_text(*observation);
    const auto before = store.evidence(id, mapping.name);
    done.fresh += before ? 0u : 1u;
    done.changed += before && *before != text ? 1u : 0u;
    if (!before || *before != text) store.add(StoredEvidence{id, mapping.name, text});
    if (model) {
      Termination failure = Termination::kCompleted;
      const auto belief = infer_belief(session, *model, id, text, *grounding, failure);
      if (belief && store.add(StoredBelief{id, mapping.name, *belief})) ++done.beliefs;
      if (!belief) {
        ++done.failed;
        if (done.failure == Termination::kCompleted) done.failure = failure;
      }
    }
    if (++done.scenes % kBatch == 0 && !(store.commit() && store.begin())) break;
  }
  if (!store.problem().empty() || !store.commit()) {
    const std::string problem = store.problem();
    store.roll_back();
    return session.error(problem), kBadInput;
  }
  if (termination != Termination::kCompleted) {
    session.error(fmt::format("{} after {} of {} scenes", stop_words(termination), done.scenes, ids->size()));
  } else if (done.failed > 0) {
    termination = done.failure;
  } else if (done.scenes < ids->size()) {
    termination = Termination::kRefused;
  }
  const std::string text =
      fmt::format("{} scenes: {} with new evidence, {} changed, {} as before; {} beliefs\n", done.scenes, done.fresh,
                  done.changed, done.scenes - done.fresh - done.changed, done.beliefs);
  return session.finish(exit_code(termination), text, [&] {
    return to_text(Json{{"schema", "sherlog.scenes.reprocess/1"},
                        {"termination", to_string(termination)},
                        {"mapping", mapping.name},
                        {"scenes", done.scenes},
                        {"new", done.fresh},
                        {"changed", done.changed},
                        {"beliefs", done.beliefs},
                        {"failed", done.failed},
                        {"seconds", {{"total", session.seconds()}}}});
  });
}

int run_reprocess(Options options, const Observing& observing) {
  Session session(std::move(options));
  if (!session.check_options()) return kBadInput;
  const auto mapping = read_mapping(session, observing.mapping);
  if (!mapping) return kBadInput;
  auto store = open_store(session, observing.store, {.create = false});
  if (!store) return kBadInput;
  return session.run("sherlog.scenes.reprocess/1",
                     [&] { return reprocess_scenes(session, observing, *mapping, *store); });
}

int run_mapping(Options options, const std::string& name) {
  Session session(std::move(options));
  if (!session.check_options()) return kBadInput;
  if (name.empty()) {
    return session.finish(kDone, fmt::format("{}\n", fmt::join(shipped_mapping_names(), "\n")), [] {
      return to_text(Json{{"schema", "sherlog.scenes.mapping/1"}, {"mappings", shipped_mapping_names()}});
    });
  }
  const auto mapping = read_mapping(session, name);
  if (!mapping) return kBadInput;
  std::string text = json_text(mapping_to_json(*mapping), 2) + "\n";
  return session.finish(kDone, text, [&] { return text; });
}

// Pairs of clusters of neighbouring scenes of which the stored identities say whether they are one thing.
std::vector<LabelledPair> labelled_pairs(SceneStore& store, const SimilarityConfig& config, const SceneFilter& filter) {
  constexpr double kSure = 0.9;
  std::map<std::pair<std::string, std::string>, std::string> owner;  // scene, cluster -> identity
  for (const std::string& id : store.identities()) {
    const auto identity = store.identity(id);
    if (!identity) break;
    for (const Sighting& sighting : identity->sightings) {
      if (sighting.probability.value_or(1) >= kSure) owner[{sighting.scene, sighting.cluster}] = id;
    }
  }
  std::vector<LabelledPair> pairs;
  std::optional<Scene> before;
  store.for_each_scene(filter, [&](const Scene& scene) {
    for (const Cluster& old_cluster : before ? before->clusters : std::vector<Cluster>()) {
      const auto first = owner.find({before->id, old_cluster.id});
      if (first == owner.end()) continue;
      for (const Cluster& cluster : scene.clusters) {
        const auto second = owner.find({scene.id, cluster.id});
        if (second == owner.end()) continue;
        pairs.push_back(labelled_pair(config, old_cluster, cluster, first->second == second->second));
      }
    }
    before = scene;
    return true;
  });
  return pairs;
}

int learn_from_store(Session& session, const Observing& observing) {
  auto mapping = read_mapping(session, observing.mapping);
  if (!mapping) return kBadInput;
  auto store = open_to_read(session, observing.store);
  if (!store) return kBadInput;
  const auto filter = scene_filter(session, *store, observing.store);
  if (!filter) return kBadInput;
  const auto pairs = labelled_pairs(*store, mapping->similarity, *filter);
  if (!store->problem().empty()) return finish_unread(session, *store, "sherlog.scenes.sigmas/1");
  const SigmaLearning learned = learn_sigmas(mapping->similarity, pairs);
  if (!learned.problem.empty()) {
    session.error(fmt::format("nothing can be learned from {} pairs of identities in the store: {}", pairs.size(),
                              learned.problem));
    return kBadInput;
  }
  Table table(
      {{"type", Align::kLeft}, {"pairs", Align::kRight}, {"sigma before", Align::kRight}, {"sigma", Align::kRight}});
  Json json{{"schema", "sherlog.scenes.sigmas/1"},
            {"termination", to_string(Termination::kCompleted)},
            {"pairs", pairs.size()},
            {"log_likelihood_before", learned.before},
            {"log_likelihood", learned.after},
            {"types", Json::array()}};
  for (std::size_t i = 0; i < learned.config.rules.size(); ++i) {
    const SimilarityRule& rule = learned.config.rules[i];
    table.add_row({rule.type, std::to_string(learned.pair_counts[i]),
                   fmt::format("{:.4g}", mapping->similarity.rules[i].sigma), fmt::format("{:.4g}", rule.sigma)});
    json["types"].push_back({{"type", rule.type}, {"pairs", learned.pair_counts[i]}, {"sigma", rule.sigma}});
  }
  mapping->similarity = learned.config;
  std::string text = json_text(mapping_to_json(*mapping), 2) + "\n";
  if (observing.output == "-") return session.finish(kDone, text, [&] { return to_text(json); });
  if (!session.write(observing.output, text)) return kInternalError;
  return session.finish(kDone,
                        fmt::format("{} pairs; mean log-likelihood {:.5f}, before {:.5f}\n\n{}", pairs.size(),
                                    learned.after, learned.before, table.text()),
                        [&] { return to_text(json); });
}

int run_sigmas(Options options, const Observing& observing) {
  Session session(std::move(options));
  if (!session.check_options({observing.output})) return kBadInput;
  return session.run("sherlog.scenes.sigmas/1", [&] { return learn_from_store(session, observing); });
}

void add_mapping_option(CLI::App& command, Observing& observing, const char* fallback) {
  observing.mapping = fallback;
  command
      .add_option("--mapping", observing.mapping,
                  fmt::format("Which annotation becomes which evidence: a shipped mapping or a JSON file (default {})",
                              fallback))
      ->type_name("fusion|identity|perception|robosherlock|robosherlock_wordnet|FILE");
}

void add_observing_options(CLI::App& command, Observing& observing) {
  add_store_option(command, observing.store);
  command.add_option("SCENE", observing.scenes, "Their ids; without: all, or those of the time that is given")
      ->type_name("");
  add_mapping_option(command, observing, "fusion");
  command.add_flag("--labels", observing.labels, "What people said that things are as well, for training");
  CLI::Option* fuzzy = command.add_flag("--fuzzy", observing.fuzzy, "Every confidence as a degree of evidence");
  command.add_flag("--crisp", observing.crisp, "No degrees: what was reported is a fact")->excludes(fuzzy);
  command
      .add_option("--against", observing.against,
                  "Compare with the clusters of that scene: pairs and what is out of view")
      ->type_name("SCENE|previous");
  add_time_options(command, observing.store);
}

}  // namespace

void add_scenes_evidence(CLI::App& scenes, Action& action) {
  const auto add = [&](const char* name, const char* help, int (*run)(Options, const Observing&), auto add_options) {
    auto options = std::make_shared<Options>();
    auto observing = std::make_shared<Observing>();
    CLI::App* command = scenes.add_subcommand(name, help);
    add_options(*command, *options, *observing);
    add_common_options(*command, *options);
    command->callback([options, observing, run, &action] {
      action = [options, observing, run] { return run(*options, *observing); };
    });
  };
  const auto add_output = [](CLI::App& command, Observing& observing) {
    command.add_option("-o,--output", observing.output, "Where it goes (default '-': standard output)")
        ->type_name("FILE|-");
  };
  add("evidence", "Stored scenes as evidence for a model", run_evidence,
      [&](CLI::App& command, Options&, Observing& observing) {
        add_observing_options(command, observing);
        add_output(command, observing);
      });
  add("reprocess", "The evidence of stored scenes again, and a model's answers, into the store", run_reprocess,
      [](CLI::App& command, Options& options, Observing& observing) {
        add_observing_options(command, observing);
        add_model_options(command, options);
        command.get_option("--model")->required(false);
        add_query_options(command, options);
        add_world_options(command, options);
        add_inference_options(command, options);
        command.add_flag("--ignore-unknown-predicates", options.ignore_unknown_predicates,
                         "Skip evidence for predicates that the model does not declare");
      });
  add("sigmas", "The spreads of a mapping's similarities, learned from the identities in a store", run_sigmas,
      [&](CLI::App& command, Options&, Observing& observing) {
        add_store_option(command, observing.store);
        add_mapping_option(command, observing, "identity");
        add_output(command, observing);
        add_time_options(command, observing.store);
      });
  auto options = std::make_shared<Options>();
  auto name = std::make_shared<std::string>();
  CLI::App* command = scenes.add_subcommand("mapping", "A mapping as JSON, to be edited; without a name: their names");
  command->add_option("NAME", *name, "One of the shipped ones, or a file")->type_name("");
  add_common_options(*command, *options);
  command->callback([options, name, &action] { action = [options, name] { return run_mapping(*options, *name); }; });
}

}  // namespace sherlog::cli
