#include "inference/advice.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "mln/evidence_builder.h"

namespace sherlog {
namespace {

// The arguments of a predicate that say what it is about: those in a domain over which the query ranges.
std::vector<std::size_t> key_arguments(const Predicate& predicate, const std::set<DomainId>& key_domains) {
  std::vector<std::size_t> keys;
  for (std::size_t i = 0; i < predicate.arity(); ++i) {
    if (!predicate.marked[i] && key_domains.contains(predicate.domains[i])) keys.push_back(i);
  }
  return keys;
}

// Steps through all tuples below `sizes`, the last place fastest; false after the last.
bool next_tuple(std::vector<ConstantIndex>& tuple, const std::vector<std::size_t>& sizes) {
  for (std::size_t i = tuple.size(); i-- > 0;) {
    if (++tuple[i] < sizes[i]) return true;
    tuple[i] = 0;
  }
  return false;
}

class Advisor {
 public:
  Advisor(const Model& model, const Evidence& evidence, const Query& query,
          const std::vector<AnnotatorCost>& annotators, const AdviceOptions& options, Monitor& monitor)
      : model_(model),
        evidence_(evidence),
        query_(query),
        annotators_(annotators),
        options_(options),
        monitor_(monitor),
        stop_(monitor, options.information.inference.max_seconds) {}

  AdviceResult run() {
    if (check() && find_entropy()) {
      find_candidates();
      for (std::size_t i = 0; i < result_.advice.size(); ++i) {
        monitor_.progress("advising", static_cast<double>(i), static_cast<double>(result_.advice.size()));
        weigh(result_.advice[i], keys_[i]);
      }
      rank();
    }
    return std::move(result_);
  }

 private:
  bool fail(Termination termination, std::string message) {
    result_.termination = termination;
    result_.message = std::move(message);
    return false;
  }

  bool check() {
    for (const QueryItem& item : query_.items) {
      if (item.kind == QueryItem::Kind::kFormula) {
        return fail(Termination::kRefused, "advice is about atoms, not about formulas");
      }
      queried_.insert(item.predicate);
      const Predicate& predicate = model_.predicate(item.predicate);
      for (std::size_t i = 0; i < predicate.arity(); ++i) {
        if (!predicate.marked[i]) key_domains_.insert(predicate.domains[i]);
      }
    }
    if (queried_.empty()) return fail(Termination::kRefused, "nothing is asked");
    for (const AnnotatorCost& annotator : annotators_) {
      if (!(annotator.seconds > 0.0) || !std::isfinite(annotator.seconds)) {
        return fail(Termination::kRefused, fmt::format("annotator '{}': {} is not a run time above 0 seconds",
                                                       annotator.name, annotator.seconds));
      }
      if (annotator.predicates.empty()) {
        return fail(Termination::kRefused, fmt::format("annotator '{}' reports no predicate", annotator.name));
      }
      for (const PredicateId predicate : annotator.predicates) {
        if (queried_.contains(predicate)) {
          return fail(Termination::kRefused, fmt::format("annotator '{}' reports '{}', which is what is asked",
                                                         annotator.name, model_.predicate(predicate).name));
        }
        if (key_domains(predicate) != key_domains(annotator.predicates.front())) {
          return fail(Termination::kRefused, fmt::format("annotator '{}': '{}' and '{}' are about different things",
                                                         annotator.name, model_.predicate(predicate).name,
                                                         model_.predicate(annotator.predicates.front()).name));
        }
      }
    }
    if (options_.grounding.soft_evidence == SoftEvidence::kJeffrey) {
      return fail(
          Termination::kRefused,
          "no advice where degrees of evidence are read as posteriors (jeffrey): read them as virtual evidence");
    }
    return true;
  }

  std::vector<DomainId> key_domains(PredicateId predicate) const {
    std::vector<DomainId> domains;
    for (const std::size_t i : key_arguments(model_.predicate(predicate), key_domains_)) {
      domains.push_back(model_.predicate(predicate).domains[i]);
    }
    return domains;
  }

  GroundingOptions grounding_options() const {
    GroundingOptions options = options_.grounding;
    options.max_seconds = std::min(options.max_seconds, seconds_left());
    return options;
  }
  InformationOptions information_options() const {
    InformationOptions options = options_.information;
    options.inference.max_seconds = seconds_left();
    return options;
  }
  double seconds_left() const { return std::max(0.0, stop_.max_seconds() - stop_.seconds()); }
  void remember(const std::string& method) {
    auto& methods = result_.methods;
    if (!method.empty() && std::find(methods.begin(), methods.end(), method) == methods.end())
      methods.push_back(method);
  }

  bool find_entropy() {
    result_.grounding = ground(model_, evidence_, query_, grounding_options(), monitor_);
    if (!result_.grounding.network) return fail(result_.grounding.termination, result_.grounding.message);
    result_.entropy = query_entropy(*result_.grounding.network, information_options().inference, monitor_);
    remember(result_.entropy.result.method);
    if (result_.entropy.termination == Termination::kCompleted) return true;
    return fail(result_.entropy.termination, result_.entropy.message);
  }

  // Every annotator with every thing about which the evidence has none of its atoms.
  void find_candidates() {
    for (std::size_t a = 0; a < annotators_.size(); ++a) {
      const std::vector<PredicateId>& predicates = annotators_[a].predicates;
      const std::vector<DomainId> domains = key_domains(predicates.front());
      std::vector<std::size_t> sizes;
      sizes.reserve(domains.size());
      for (const DomainId domain : domains) sizes.push_back(evidence_.domain_size(model_, domain));
      if (std::find(sizes.begin(), sizes.end(), 0u) != sizes.end()) continue;
      std::set<std::vector<ConstantIndex>> answered;
      for (const PredicateId predicate : predicates) collect_answered(predicate, answered);
      std::vector<ConstantIndex> key(domains.size(), 0);
      do {
        if (answered.contains(key)) continue;
        Advice advice;
        advice.annotator = a;
        for (std::size_t i = 0; i < key.size(); ++i) {
          advice.cluster.push_back(evidence_.constant_name(model_, domains[i], key[i]));
        }
        result_.advice.push_back(std::move(advice));
        keys_.push_back(key);
      } while (next_tuple(key, sizes));
    }
  }

  void collect_answered(PredicateId predicate, std::set<std::vector<ConstantIndex>>& answered) const {
    const PredicateEvidence& atoms = evidence_.of(predicate);
    const std::size_t arity = model_.predicate(predicate).arity();
    const auto keys = key_arguments(model_.predicate(predicate), key_domains_);
    for (std::size_t atom = 0; atom < atoms.size(); ++atom) {
      if (atoms.kinds[atom] == EvidenceKind::kUnknown) continue;
      std::vector<ConstantIndex> key;
      key.reserve(keys.size());
      for (const std::size_t i : keys) key.push_back(atoms.arguments[atom * arity + i]);
      answered.insert(std::move(key));
    }
  }

  // Whether the atom is the annotator's to report about this thing.
  bool is_of(std::span<const ConstantIndex> arguments, const std::vector<std::size_t>& keys,
             const std::vector<ConstantIndex>& key) const {
    for (std::size_t i = 0; i < keys.size(); ++i) {
      if (arguments[keys[i]] != key[i]) return false;
    }
    return true;
  }

  // The evidence with these atoms unknown. Constants keep their numbers; places are left out, since they are into texts
  // that the copy does not share.
  Evidence opened(const AnnotatorCost& annotator, const std::vector<ConstantIndex>& key) const {
    Diagnostics unused;
    EvidenceContext context(model_, unused, {});
    EvidenceBuilder builder(context);
    bool widened = false;
    for (std::uint32_t d = 0; d < model_.domains().size(); ++d) {
      for (const std::string& name : evidence_.added_constants(DomainId(d)))
        builder.constant(DomainId(d), name, widened);
    }
    for (std::uint32_t p = 0; p < model_.predicates().size(); ++p) {
      const PredicateEvidence& atoms = evidence_.of(PredicateId(p));
      const std::size_t arity = model_.predicates()[p].arity();
      for (std::size_t atom = 0; atom < atoms.size(); ++atom) {
        builder.state(PredicateId(p), {atoms.arguments.data() + atom * arity, arity}, atoms.kinds[atom],
                      atoms.degrees[atom], {});
      }
    }
    for (const PredicateId id : annotator.predicates) {
      const Predicate& predicate = model_.predicate(id);
      const auto keys = key_arguments(predicate, key_domains_);
      std::vector<std::size_t> sizes;
      for (const DomainId domain : predicate.domains) sizes.push_back(evidence_.domain_size(model_, domain));
      if (std::find(sizes.begin(), sizes.end(), 0u) != sizes.end()) continue;
      std::vector<ConstantIndex> arguments(predicate.arity(), 0);
      do {
        if (is_of(arguments, keys, key)) builder.state(id, arguments, EvidenceKind::kUnknown, 0.0, {});
      } while (next_tuple(arguments, sizes));
    }
    return std::move(builder).finish();
  }

  void weigh(Advice& advice, const std::vector<ConstantIndex>& key) {
    const AnnotatorCost& annotator = annotators_[advice.annotator];
    if (stop_.reached()) {
      advice.termination = stop_.reason();
      advice.message = "stopped before";
      return;
    }
    const Evidence evidence = opened(annotator, key);
    const GroundingResult grounded = ground(model_, evidence, query_, grounding_options(), monitor_);
    if (!grounded.network) {
      advice.termination = grounded.termination;
      advice.message = grounded.message;
      return;
    }
    const GroundNetwork& network = *grounded.network;
    std::vector<VariableId> outcome;
    for (std::uint32_t a = 0; a < network.atom_count(); ++a) {
      const PredicateId predicate = network.predicate_of(AtomId(a));
      const auto& own = annotator.predicates;
      if (std::find(own.begin(), own.end(), predicate) == own.end()) continue;
      const auto keys = key_arguments(model_.predicate(predicate), key_domains_);
      if (!is_of(network.arguments_of(AtomId(a)), keys, key)) continue;
      const VariableId v = network.variable_of(AtomId(a));
      if (outcome.empty() || outcome.back() != v) outcome.push_back(v);
    }
    const Information information = expected_information(network, outcome, information_options(), monitor_);
    remember(information.method);
    advice.termination = information.termination;
    advice.message = information.message;
    advice.expected_entropy_drop = information.expected_drop;
    advice.mcse = information.mcse;
    advice.drop_per_second = information.expected_drop / annotator.seconds;
  }

  void rank() {
    const auto has_figures = [](const Advice& a) { return a.termination == Termination::kCompleted || a.mcse; };
    std::stable_sort(result_.advice.begin(), result_.advice.end(), [&](const Advice& a, const Advice& b) {
      if (has_figures(a) != has_figures(b)) return has_figures(a);
      return a.drop_per_second > b.drop_per_second;
    });
    for (const Advice& advice : result_.advice) {
      if (advice.termination == Termination::kCompleted) continue;
      result_.termination = advice.termination;
      result_.message = fmt::format("some annotators could not be weighed: {}", advice.message);
      if (advice.termination == Termination::kInterrupted) return;
    }
  }

  const Model& model_;
  const Evidence& evidence_;
  const Query& query_;
  const std::vector<AnnotatorCost>& annotators_;
  const AdviceOptions& options_;
  Monitor& monitor_;
  StopCondition stop_;
  AdviceResult result_;
  std::set<PredicateId> queried_;
  std::set<DomainId> key_domains_;                // over which the query's blocks range
  std::vector<std::vector<ConstantIndex>> keys_;  // of result_.advice, before it is ranked
};

}  // namespace

AdviceResult advise(const Model& model, const Evidence& evidence, const Query& query,
                    const std::vector<AnnotatorCost>& annotators, const AdviceOptions& options, Monitor& monitor) {
  return Advisor(model, evidence, query, annotators, options, monitor).run();
}

}  // namespace sherlog
