// Model + Evidence + Query to GroundNetwork.
//
// Idea      Which predicates are open is read off the query and the options; AtomTable applies the evidence and the
//           rules of blocks; FormulaJoin visits what is left of each formula, and NetworkBuilder simplifies and shares
//           it. Ground formulas that the evidence makes true are counted from the sizes of the domains, not visited.
//           Hard formulas come first, since one that is false ends the work; a hard conjunction is so many hard
//           formulas.
#include "grounding/ground.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "grounding/block_values.h"
#include "grounding/conflict.h"
#include "grounding/contradiction.h"
#include "grounding/formula_joins.h"
#include "grounding/symmetry.h"

namespace sherlog {
namespace {

constexpr double kMostVisits = 2e10;     // about an hour
constexpr double kBytesPerFeature = 48;  // a feature, its gate and its place in two hash tables, at least
constexpr double kMostAtoms = 1 << 29;   // what a Literal can number

NameTable names_of(const Model& model, const Evidence& evidence) {
  NameTable names;
  for (const Predicate& predicate : model.predicates()) {
    names.predicates.push_back(predicate.name);
    names.predicate_domains.emplace_back();
    for (DomainId domain : predicate.domains) names.predicate_domains.back().push_back(domain.value);
  }
  for (std::size_t d = 0; d < model.domains().size(); ++d) {
    names.constants.push_back(model.domains()[d].constants);
    const auto& added = evidence.added_constants(DomainId(d));
    names.constants.back().insert(names.constants.back().end(), added.begin(), added.end());
  }
  return names;
}

void mark_predicates(const FormulaNode& node, std::vector<bool>& marked) {
  if (node.kind == NodeKind::kAtom) marked[node.predicate.index()] = true;
  for (const FormulaNode& child : node.children) mark_predicates(child, marked);
}

std::vector<bool> open_predicates(const Model& model, const Query& query, const GroundingOptions& options) {
  std::vector<bool> open(model.predicates().size(), false);
  for (std::size_t p = 0; p < open.size(); ++p) open[p] = options.open_world_all && !model.predicates()[p].closed;
  for (PredicateId p : options.open_world) open[p.index()] = true;
  for (const QueryItem& item : query.items) {
    if (item.kind == QueryItem::Kind::kAtoms) {
      open[item.predicate.index()] = true;
    } else {
      mark_predicates(item.formula.root, open);
    }
  }
  return open;
}

std::vector<std::uint32_t> outer_variables(const Formula& formula) {
  std::vector<std::uint32_t> result;
  for (std::uint32_t v = 0; v < formula.variables.size(); ++v) {
    if (!formula.variables[v].quantified) result.push_back(v);
  }
  return result;
}

class Grounder {
 public:
  Grounder(const Model& model, const Evidence& evidence, const Query& query, const GroundingOptions& options,
           Monitor& monitor)
      : model_(model),
        evidence_(evidence),
        query_(query),
        options_(options),
        stop_(monitor, options.max_seconds),
        builder_(names_of(model, evidence)),
        atoms_(model, evidence, open_predicates(model, query, options), builder_, options.dense_atoms),
        numbers_(model, evidence) {}

  GroundingResult run() {
    if (work() && keep_going()) {
      builder_.add_free_log_count(atoms_.free_log_count());
      result_.network = builder_.build();
      monitor().progress("grounding", static_cast<double>(model_.formulas().size()),
                         static_cast<double>(model_.formulas().size()));
    }
    result_.seconds = stop_.seconds();
    return std::move(result_);
  }

 private:
  // Weights of a template: one for each choice of constants for its + variables.
  struct Instances {
    std::vector<std::uint32_t> plus;  // variables
    TupleTable table;
    std::vector<WeightId> ids;
    std::vector<ConstantIndex> key;
  };

  Monitor& monitor() const { return stop_.monitor(); }

  bool work() {
    if (atoms_.empty_block()) return fail(conflict_of_block(model_, evidence_, *atoms_.empty_block()));
    count_evidence();
    for (std::size_t f = 0; f < model_.formulas().size(); ++f) {
      result_.formulas.push_back({FormulaId(f), 0, 0, 0, 0});
    }
    if (!ask()) return false;
    for (const bool hard : {true, false}) {
      for (std::size_t f = 0; f < model_.formulas().size(); ++f) {
        if (model_.formulas()[f].hard == hard && !ground_formula(FormulaId(f))) return false;
      }
      if (hard && contradiction()) return false;
    }
    return weigh_soft_evidence();
  }

  void count_evidence() {
    std::size_t count = 0;
    for (std::size_t p = 0; p < model_.predicates().size(); ++p) {
      for (EvidenceKind kind : evidence_.of(PredicateId(p)).kinds) count += kind != EvidenceKind::kUnknown ? 1 : 0;
    }
    builder_.set_evidence_atom_count(count);
  }

  // --- ends

  bool fail(Conflict conflict) {
    result_.termination = Termination::kNoPossibleWorld;
    result_.message = "no possible world: " + conflict.sentence;
    result_.conflict = std::move(conflict);
    return false;
  }

  bool halt(Termination termination, std::string message) {
    if (result_.termination == Termination::kCompleted) {
      result_.termination = termination;
      result_.message = std::move(message);
    }
    return false;
  }

  std::string described(const Formula& formula) const {
    return fmt::format("'{}' ({})", formula.text,
                       model_.sources().describe({formula.place.file, formula.place.line, 0, 0}));
  }

  std::string where() const {
    if (current_ == nullptr) return "while listing the queried atoms";
    return fmt::format("while grounding {}, after {} ground formulas", described(*current_),
                       builder_.so_far().features().size() + builder_.so_far().constraints().size());
  }

  // Asked every few thousand steps of every loop.
  bool keep_going() {
    if (result_.termination != Termination::kCompleted) return false;
    if (stop_.interrupted()) return halt(Termination::kInterrupted, fmt::format("interrupted {}", where()));
    if (stop_.out_of_time()) {
      return halt(Termination::kTimeLimit, fmt::format("the time limit was reached {}", where()));
    }
    if (atoms_.overflowed()) {
      return halt(Termination::kMemoryLimit,
                  fmt::format("more than {:.0f} open atoms are needed {}", kMostAtoms, where()));
    }
    const std::size_t bytes = builder_.memory_bytes() + atoms_.memory_bytes();
    if (bytes > options_.max_memory) {
      return halt(Termination::kMemoryLimit, fmt::format("the limit of {:.3g} MB was reached {}",
                                                         static_cast<double>(options_.max_memory) / 1e6, where()));
    }
    const double now = stop_.seconds();
    if (now - last_progress_ > 0.25) {
      last_progress_ = now;
      monitor().progress("grounding", done_, static_cast<double>(model_.formulas().size()));
    }
    return true;
  }

  // --- what is asked

  bool ask() {
    for (const QueryItem& item : query_.items) {
      if (item.absent) continue;
      if (!(item.kind == QueryItem::Kind::kAtoms ? ask_atoms(item) : ask_formula(item))) return false;
    }
    return keep_going();
  }

  bool ask_atoms(const QueryItem& item) {
    const Predicate& predicate = model_.predicate(item.predicate);
    std::vector<bool> seen(item.pattern_variables, false);
    double count = 1;
    for (std::size_t i = 0; i < item.pattern.size(); ++i) {
      const Term& term = item.pattern[i];
      if (!term.is_variable || seen[term.index]) continue;
      seen[term.index] = true;
      count *= atoms_.domain_size(predicate.domains[i]);
    }
    if (count > kMostAtoms || count * kBytesPerFeature > static_cast<double>(options_.max_memory)) {
      return halt(Termination::kMemoryLimit,
                  fmt::format("the query '{}' asks for {:.3g} atoms, more than the memory holds", item.text, count));
    }
    std::vector<ConstantIndex> arguments(item.pattern.size());
    std::vector<std::int64_t> values(item.pattern_variables, -1);
    return ask_matching(item, 0, arguments, values);
  }

  bool ask_matching(const QueryItem& item, std::size_t depth, std::vector<ConstantIndex>& arguments,
                    std::vector<std::int64_t>& values) {
    if (depth == item.pattern.size()) return ask_atom(item.predicate, arguments);
    const Term& term = item.pattern[depth];
    if (!term.is_variable || values[term.index] >= 0) {
      arguments[depth] = term.is_variable ? static_cast<ConstantIndex>(values[term.index]) : term.index;
      return ask_matching(item, depth + 1, arguments, values);
    }
    const std::uint32_t size = atoms_.domain_size(model_.predicate(item.predicate).domains[depth]);
    for (ConstantIndex c = 0; c < size; ++c) {
      arguments[depth] = c;
      values[term.index] = c;
      if (!ask_matching(item, depth + 1, arguments, values)) return false;
    }
    values[term.index] = -1;
    return true;
  }

  bool ask_atom(PredicateId predicate, std::span<const ConstantIndex> arguments) {
    if ((++asked_count_ & 4095u) == 0 && !keep_going()) return false;
    const std::uint32_t code = atoms_.materialised_code(predicate, arguments);
    if (atoms_.overflowed()) return keep_going();
    if (code < atom_code::kFirst) return true;
    const std::size_t atom = code - atom_code::kFirst;
    if (asked_.size() < builder_.atom_count()) asked_.resize(builder_.atom_count() + builder_.atom_count() / 2, false);
    if (asked_[atom]) return true;
    asked_[atom] = true;
    builder_.add_query({Literal::atom(AtomId(atom)), false, ""});
    return true;
  }

  bool ask_formula(const QueryItem& item) {
    const Formula& formula = item.formula;
    NormalNode root = normal_form(formula, atoms_, numbers_);
    Literal literal = Literal::constant(root.shape != NodeShape::kFalse);
    if (root.shape != NodeShape::kTrue && root.shape != NodeShape::kFalse) {
      const bool disjunctive = root.shape == NodeShape::kOr;
      literal = Literal::constant(disjunctive);
      FormulaJoin join(std::move(root), formula, outer_variables(formula), {}, disjunctive, atoms_, builder_,
                       [this] { return keep_going(); });
      const bool finished = join.run([&](const auto&, Literal found) {
        literal = found;
        return true;
      });
      if (!finished) return false;
    }
    builder_.add_query({literal, true, formula.text.empty() ? item.text : formula.text});
    return true;
  }

  // --- formulas

  // Ground formulas of one formula, all instances of a template together.
  double grounding_count(const Formula& formula) const {
    double count = 1;
    std::vector<bool> grouped(formula.variables.size(), false);
    const auto size_of = [&](std::uint32_t v) {
      return static_cast<double>(atoms_.domain_size(formula.variables[v].domain));
    };
    for (const auto& group : formula.unique) {
      for (std::size_t i = 0; i < group.size(); ++i) {  // binomial coefficient
        count *= std::max(0.0, size_of(group[i]) - static_cast<double>(i)) / static_cast<double>(i + 1);
        grouped[group[i]] = true;
      }
    }
    for (std::uint32_t v : outer_variables(formula)) count *= grouped[v] ? 1 : size_of(v);
    return std::round(count);
  }

  bool ground_formula(FormulaId id) {
    const Formula& formula = model_.formula(id);
    done_ += 1;
    if (!formula.hard && formula.weight == 0 && !options_.keep_zero_weights) return true;
    current_ = &formula;
    const double began = stop_.seconds();
    FormulaGrounding& report = result_.formulas[id.index()];
    report.groundings = grounding_count(formula);
    builder_.add_grounding_count(report.groundings);
    const std::size_t before = builder_.so_far().features().size() + builder_.so_far().constraints().size();
    const bool finished = formula.hard ? ground_hard(id, report) : ground_soft(id, report);
    report.features = builder_.so_far().features().size() + builder_.so_far().constraints().size() - before;
    report.seconds = stop_.seconds() - began;
    return finished;
  }

  // Variables of a #unique group stand in the order of their domain.
  static std::vector<NormalNode> order_of_groups(const Formula& formula) {
    std::vector<NormalNode> filters;
    for (const auto& group : formula.unique) {
      for (std::size_t i = 0; i + 1 < group.size(); ++i) filters.push_back(earlier(group[i], group[i + 1]));
    }
    return filters;
  }

  bool affordable(const Formula& formula, const FormulaJoins& join) {
    const double visits = join.expected_visits();
    std::vector<bool> used(model_.predicates().size(), false);
    mark_predicates(formula.root, used);
    bool open = false;
    for (std::size_t p = 0; p < used.size(); ++p) open = open || (used[p] && atoms_.has_open_atoms(PredicateId(p)));
    if (visits > kMostVisits) {
      return halt(Termination::kMemoryLimit,
                  fmt::format("grounding {} would take about {:.3g} steps; at most {:.0e} are tried",
                              described(formula), visits, kMostVisits));
    }
    if (open && join.expected_leaves() * kBytesPerFeature > static_cast<double>(options_.max_memory)) {
      return halt(
          Termination::kMemoryLimit,
          fmt::format("grounding {} gives about {:.3g} ground formulas, which need {:.3g} MB; the limit is {:.3g} MB",
                      described(formula), join.expected_leaves(), join.expected_leaves() * kBytesPerFeature / 1e6,
                      static_cast<double>(options_.max_memory) / 1e6));
    }
    return true;
  }

  bool ground_hard(FormulaId id, FormulaGrounding& report) {
    const Formula& formula = model_.formula(id);
    if (report.groundings == 0) return true;
    NormalNode root = normal_form(formula, atoms_, numbers_);
    if (root.shape != NodeShape::kAnd) return ground_hard_part(id, std::move(root), report);
    for (NormalNode& part : root.children) {
      if (!ground_hard_part(id, std::move(part), report)) return false;
    }
    return true;
  }

  bool ground_hard_part(FormulaId id, NormalNode part, FormulaGrounding& report) {
    const Formula& formula = model_.formula(id);
    if (part.shape == NodeShape::kTrue) return true;
    const std::vector<std::uint32_t> by_block = say_by_blocks(part, formula, model_, atoms_);
    // Variables that this conjunct does not mention need no enumeration: their domains have constants.
    std::vector<std::uint32_t> outer = outer_variables(formula), variables = outer;
    if (formula.unique.empty()) {
      std::erase_if(variables, [&](std::uint32_t v) { return !std::ranges::binary_search(part.free, v); });
    }
    std::vector<NormalNode> filters = order_of_groups(formula);
    if (const auto pair = symmetric_pair(part, formula)) filters.push_back(earlier(pair->first, pair->second));
    FormulaJoins join = plan_joins(std::move(part), formula, variables, filters, true, atoms_, numbers_, builder_,
                                   [this] { return keep_going(); });
    if (!affordable(formula, join)) return false;
    std::vector<ConstantIndex> binding(outer.size()), by_variable(formula.variables.size());
    return join.run([&](const std::vector<ConstantIndex>& values, Literal literal) {
      ++report.joined;
      by_variable = values;
      for (std::uint32_t v : by_block) by_variable[v] = kEveryConstant;
      for (std::size_t i = 0; i < outer.size(); ++i) binding[i] = by_variable[outer[i]];
      if (builder_.add_constraint(literal, id, binding)) return true;
      return fail(conflict_of_formula(model_, evidence_, atoms_, id, by_variable));
    });
  }

  bool ground_soft(FormulaId id, FormulaGrounding& report) {
    const Formula& formula = model_.formula(id);
    Instances instances = prepare_instances(id);
    if (report.groundings == 0) return true;
    NormalNode root = normal_form(formula, atoms_, numbers_);
    if (root.shape == NodeShape::kTrue) builder_.add_constant_score(formula.weight * report.groundings);
    if (root.shape == NodeShape::kTrue || root.shape == NodeShape::kFalse) return true;
    const bool disjunctive = root.shape == NodeShape::kOr || root.shape == NodeShape::kForall ||
                             ((root.shape == NodeShape::kAtom || root.shape == NodeShape::kEqual) && root.negated);
    const std::vector<std::uint32_t> outer = outer_variables(formula);
    FormulaJoins join = plan_joins(std::move(root), formula, outer, order_of_groups(formula), disjunctive, atoms_,
                                   numbers_, builder_, [this] { return keep_going(); });
    if (!affordable(formula, join)) return false;
    std::vector<ConstantIndex> binding(outer.size());
    const bool finished = join.run([&](const std::vector<ConstantIndex>& values, Literal literal) {
      ++report.joined;
      if (literal.is_constant()) {
        if (literal == Literal::constant(true)) builder_.add_constant_score(formula.weight);
        return true;
      }
      for (std::size_t i = 0; i < outer.size(); ++i) binding[i] = values[outer[i]];
      builder_.add_feature(literal, formula.weight, weight_of(id, instances, values), binding);
      return true;
    });
    if (join.disjunctive) {
      builder_.add_constant_score(formula.weight * (report.groundings - static_cast<double>(report.joined)));
    }
    return finished;
  }

  // Whether the constraints refute each other by propagation alone.
  bool contradiction() {
    const GroundNetwork& network = builder_.so_far();
    std::vector<GroundFormula> core;
    for (std::uint32_t index : contradicting_constraints(network)) {
      const Constraint& constraint = network.constraints()[index];
      const Formula& formula = model_.formula(constraint.formula);
      core.push_back({constraint.formula, std::vector<ConstantIndex>(formula.variables.size(), 0)});
      const std::vector<std::uint32_t> outer = outer_variables(formula);
      for (std::size_t i = 0; i < outer.size(); ++i)
        core.back().by_variable[outer[i]] = network.binding(constraint.binding)[i];
    }
    if (core.empty()) return false;
    fail(conflict_of_formulas(model_, evidence_, atoms_, core));
    return true;
  }

  // --- weights

  Instances prepare_instances(FormulaId id) {
    const Formula& formula = model_.formula(id);
    Instances result;
    for (std::uint32_t v = 0; v < formula.variables.size(); ++v) {
      if (formula.variables[v].plus) result.plus.push_back(v);
    }
    result.table = TupleTable(result.plus.size());
    result.key.resize(result.plus.size());
    return result;
  }

  WeightId instance(FormulaId id, Instances& instances) {
    const std::uint32_t entry = instances.table.insert(instances.key);
    if (entry == instances.ids.size()) {
      instances.ids.push_back(builder_.add_weight({id, instances.key, model_.formula(id).weight}));
    }
    return instances.ids[entry];
  }

  WeightId weight_of(FormulaId id, Instances& instances, const std::vector<ConstantIndex>& values) {
    if (instances.plus.empty() && !instances.ids.empty()) return instances.ids.front();
    for (std::size_t i = 0; i < instances.plus.size(); ++i) instances.key[i] = values[instances.plus[i]];
    return instance(id, instances);
  }

  // --- soft evidence

  bool weigh_soft_evidence() {
    current_ = nullptr;
    for (std::size_t p = 0; p < model_.predicates().size(); ++p) {
      const PredicateEvidence& stated = evidence_.of(PredicateId(p));
      const std::size_t arity = model_.predicates()[p].arity();
      for (std::size_t i = 0; i < stated.size(); ++i) {
        if (stated.kinds[i] != EvidenceKind::kSoft) continue;
        if (!weigh_soft_atom(PredicateId(p), {stated.arguments.data() + i * arity, arity}, stated.degrees[i],
                             stated.places[i])) {
          return false;
        }
      }
    }
    return true;
  }

  bool weigh_soft_atom(PredicateId predicate, std::span<const ConstantIndex> arguments, double degree,
                       const Place& place) {
    const std::uint32_t code = atoms_.materialised_code(predicate, arguments);
    if (atoms_.overflowed()) return keep_going();
    const bool is_virtual = options_.soft_evidence == SoftEvidence::kVirtual;
    if (code < atom_code::kFirst) {
      if (!is_virtual) {
        return fail(conflict_of_soft_atom(model_, evidence_, atoms_, predicate, arguments, degree, place));
      }
      builder_.add_constant_score(code == atom_code::kTrue ? std::log(degree) : std::log1p(-degree));
      return true;
    }
    const AtomId atom(code - atom_code::kFirst);
    if (!is_virtual) {
      builder_.add_soft_target({atom, degree});
      return true;
    }
    builder_.add_constant_score(std::log1p(-degree));
    builder_.add_feature(Literal::atom(atom), std::log(degree) - std::log1p(-degree), kVirtualEvidence);
    return true;
  }

  const Model& model_;
  const Evidence& evidence_;
  const Query& query_;
  const GroundingOptions& options_;
  StopCondition stop_;
  NetworkBuilder builder_;
  AtomTable atoms_;
  ConstantNumbers numbers_;
  GroundingResult result_;
  const Formula* current_ = nullptr;
  std::vector<bool> asked_;  // by atom
  std::uint64_t asked_count_ = 0;
  double done_ = 0, last_progress_ = 0;
};

}  // namespace

GroundingResult ground(const Model& model, const Evidence& evidence, const Query& query,
                       const GroundingOptions& options, Monitor& monitor) {
  return Grounder(model, evidence, query, options, monitor).run();
}

}  // namespace sherlog
