// Duplicates, contradictions and block rules of one database. Atoms are compared as packed arguments in flat arrays.
#include "mln/evidence_builder.h"

#include <fmt/format.h>

#include <algorithm>
#include <functional>
#include <limits>

#include "mln/checks.h"
#include "mln/typing.h"

namespace sherlog {

namespace {

std::uint64_t hash_text(std::string_view text) { return std::hash<std::string_view>{}(text); }

std::uint64_t mixed(std::uint64_t hash, std::uint64_t value) {
  constexpr std::uint64_t kOdd = 0x9E3779B97F4A7C15u;  // 2^64 divided by the golden ratio
  hash = (hash ^ value) * kOdd;
  return hash ^ (hash >> 29);
}

std::string kind_text(EvidenceKind kind, double degree) {
  switch (kind) {
    case EvidenceKind::kFalse:
      return "false";
    case EvidenceKind::kTrue:
      return "true";
    case EvidenceKind::kUnknown:
      return "unknown";
    case EvidenceKind::kSoft:
      break;
  }
  return fmt::format("true to degree {}", degree);
}

}  // namespace

std::string_view shortened(std::string_view name) {
  constexpr std::size_t kMost = 80;
  if (name.size() <= kMost) return name;
  std::size_t end = kMost;
  while (end > 0 && (static_cast<unsigned char>(name[end]) & 0xC0u) == 0x80u) --end;  // not inside a code point
  return name.substr(0, end);
}

EvidenceContext::EvidenceContext(const Model& model, Diagnostics& diagnostics, const EvidenceOptions& options)
    : model_(model),
      diagnostics_(diagnostics),
      options_(options),
      constants_(model.domains().size()),
      constants_ready_(model.domains().size(), false),
      compared_(compared_domains(model)) {
  for (std::uint32_t i = 0; i < model.predicates().size(); ++i) {
    predicates_.insert(hash_text(model.predicates()[i].name), i);
  }
}

std::optional<PredicateId> EvidenceContext::find_predicate(std::string_view name) const {
  const std::uint32_t position =
      predicates_.find(hash_text(name), [&](std::uint32_t i) { return model_.predicates()[i].name == name; });
  if (position == FlatIndex::kNone) return std::nullopt;
  return PredicateId(position);
}

ConstantIndex EvidenceContext::find_constant(DomainId domain, std::string_view name, std::uint64_t hash) {
  FlatIndex& table = constants_[domain.index()];
  const std::vector<std::string>& constants = model_.domain(domain).constants;
  if (!constants_ready_[domain.index()]) {
    for (std::uint32_t i = 0; i < constants.size(); ++i) table.insert(hash_text(constants[i]), i);
    constants_ready_[domain.index()] = true;
  }
  return table.find(hash, [&](std::uint32_t i) { return constants[i] == name; });
}

void EvidenceContext::check_new_constant(DomainId id, std::string_view name, const Place& place) {
  const Domain& domain = model_.domain(id);
  const std::optional<Place>& compared = compared_[id.index()];
  const bool wrong = compared && !numeric_value(name);
  if (!wrong && !domain.declared) return;
  if (!said_.insert(fmt::format("{}\n{}", domain.name, name)).second) return;
  if (wrong) {
    std::vector<Note> notes;
    if (&model_.sources() == &diagnostics_.sources()) notes.push_back({*compared, "they are compared here"});
    diagnostics_.error("not-numeric", place,
                       fmt::format("'{}' is no number, and formulas compare the constants of domain '{}'",
                                   shortened(name), domain.name),
                       std::move(notes));
    return;
  }
  // A suggestion costs a comparison with every constant: not for messages that nobody sees.
  const bool shown = diagnostics_.warning_count() < Diagnostics::kMaxShown && shortened(name).size() == name.size();
  diagnostics_.warning("widened-domain", place,
                       fmt::format("'{}' is not among the declared constants of domain '{}' and is added{}",
                                   shortened(name), domain.name, shown ? suggestion(name, domain.constants) : ""),
                       declaration_note(model_, diagnostics_, domain.place, domain.name));
}

std::string EvidenceContext::predicate_suggestion(std::string_view name) const {
  if (shortened(name).size() < name.size() || diagnostics_.error_count() >= Diagnostics::kMaxShown) return "";
  std::vector<std::string> names;
  for (const Predicate& predicate : model_.predicates()) names.push_back(predicate.name);
  return suggestion(name, names);
}

std::string EvidenceContext::domain_suggestion(std::string_view name) const {
  if (shortened(name).size() < name.size() || diagnostics_.error_count() >= Diagnostics::kMaxShown) return "";
  std::vector<std::string> names;
  for (const Domain& domain : model_.domains()) names.push_back(domain.name);
  return suggestion(name, names);
}

EvidenceBuilder::EvidenceBuilder(EvidenceContext& context)
    : context_(&context),
      evidence_(context.model()),
      atoms_(context.model().predicates().size()),
      added_(context.model().domains().size()) {}

ConstantIndex EvidenceBuilder::constant(DomainId domain, std::string_view name, bool& is_new) {
  const std::uint64_t hash = hash_text(name);
  const ConstantIndex known = context_->find_constant(domain, name, hash);
  if (known != FlatIndex::kNone) return known;
  std::vector<std::string>& names = evidence_.added_[domain.index()];
  FlatIndex& table = added_[domain.index()];
  const auto base = static_cast<ConstantIndex>(context_->model().domain(domain).constants.size());
  const std::uint32_t position = table.find(hash, [&](std::uint32_t i) { return names[i] == name; });
  if (position != FlatIndex::kNone) return base + position;
  const auto added = static_cast<std::uint32_t>(names.size());
  names.emplace_back(name);
  table.insert(hash, added);
  evidence_.added_index_[domain.index()].emplace(names.back(), base + added);
  is_new = true;
  return base + added;
}

void EvidenceBuilder::state(PredicateId id, std::span<const ConstantIndex> arguments, EvidenceKind kind, double degree,
                            const Place& place) {
  PredicateEvidence& atoms = evidence_.predicates_[id.index()];
  FlatIndex& table = atoms_[id.index()];
  std::uint64_t hash = arguments.size();
  for (const ConstantIndex argument : arguments) hash = mixed(hash, argument);
  const std::size_t arity = arguments.size();
  const std::uint32_t before = table.find(hash, [&](std::uint32_t atom) {
    return std::equal(arguments.begin(), arguments.end(), atoms.arguments.data() + atom * arity);
  });
  if (before != FlatIndex::kNone) {
    const bool same =
        atoms.kinds[before] == kind && !(atoms.degrees[before] < degree) && !(atoms.degrees[before] > degree);
    if (!same) report_contradiction(id, before, kind, degree, place);
    return;
  }
  table.insert(hash, static_cast<std::uint32_t>(atoms.size()));
  atoms.arguments.insert(atoms.arguments.end(), arguments.begin(), arguments.end());
  atoms.kinds.push_back(kind);
  atoms.degrees.push_back(degree);
  atoms.places.push_back(place);
}

void EvidenceBuilder::report_contradiction(PredicateId id, std::uint32_t before, EvidenceKind kind, double degree,
                                           const Place& place) {
  const PredicateEvidence& atoms = evidence_.predicates_[id.index()];
  const std::string earlier = kind_text(atoms.kinds[before], atoms.degrees[before]);
  context_->diagnostics().error(
      "contradiction", place,
      fmt::format("'{}' is stated {} here, but {} elsewhere", text_of(id, before), kind_text(kind, degree), earlier),
      {{atoms.places[before], fmt::format("it is stated {} here", earlier)}});
}

std::span<const ConstantIndex> EvidenceBuilder::arguments_of(PredicateId id, std::uint32_t atom) const {
  const std::size_t arity = context_->model().predicate(id).arity();
  return std::span(evidence_.predicates_[id.index()].arguments).subspan(atom * arity, arity);
}

std::string EvidenceBuilder::text_of(PredicateId id, std::uint32_t atom) const {
  return std::string(shortened(atom_text(context_->model(), evidence_, id, arguments_of(id, atom))));
}

// What is stated about the atoms that share their unmarked arguments.
struct EvidenceBuilder::Block {
  std::uint32_t first = 0;  // any of its atoms
  std::uint32_t true_atom = FlatIndex::kNone;
  std::uint32_t first_denied = FlatIndex::kNone;
  std::uint32_t last_denied = FlatIndex::kNone;
  std::size_t denied = 0;
};

void EvidenceBuilder::block_error(PredicateId id, std::uint32_t atom, std::string text, std::uint32_t other,
                                  std::string other_text) {
  const Predicate& predicate = context_->model().predicate(id);
  const std::vector<Place>& places = evidence_.predicates_[id.index()].places;
  std::vector<Note> notes = {{places[other], std::move(other_text)}};
  for (Note& note : declaration_note(context_->model(), context_->diagnostics(), predicate.place, predicate.name)) {
    notes.push_back(std::move(note));
  }
  context_->diagnostics().error("block", places[atom], std::move(text), std::move(notes));
}

void EvidenceBuilder::check_blocks(PredicateId id) {
  const Predicate& predicate = context_->model().predicate(id);
  const PredicateEvidence& atoms = evidence_.predicates_[id.index()];
  std::vector<Block> blocks;
  FlatIndex table;
  for (std::uint32_t atom = 0; atom < atoms.size(); ++atom) {
    const std::span<const ConstantIndex> arguments = arguments_of(id, atom);
    std::uint64_t hash = 0;
    for (std::size_t i = 0; i < arguments.size(); ++i) {
      if (!predicate.marked[i]) hash = mixed(hash, arguments[i]);
    }
    std::uint32_t position = table.find(hash, [&](std::uint32_t block) {
      const std::span<const ConstantIndex> others = arguments_of(id, blocks[block].first);
      for (std::size_t i = 0; i < arguments.size(); ++i) {
        if (!predicate.marked[i] && arguments[i] != others[i]) return false;
      }
      return true;
    });
    if (position == FlatIndex::kNone) {
      position = static_cast<std::uint32_t>(blocks.size());
      blocks.emplace_back().first = atom;
      table.insert(hash, position);
    }
    Block& block = blocks[position];
    if (atoms.kinds[atom] == EvidenceKind::kFalse) {
      if (block.denied++ == 0) block.first_denied = atom;
      block.last_denied = atom;
    } else if (atoms.kinds[atom] == EvidenceKind::kTrue) {
      if (block.true_atom == FlatIndex::kNone) {
        block.true_atom = atom;
        continue;
      }
      const std::string other = text_of(id, block.true_atom);
      block_error(id, atom,
                  fmt::format("'{}' and '{}' are both stated true, but {} of them can be", text_of(id, atom), other,
                              predicate.block == BlockKind::kExactlyOne ? "exactly one" : "at most one"),
                  block.true_atom, fmt::format("'{}' is stated true here", other));
    }
  }
  if (predicate.block != BlockKind::kExactlyOne) return;
  std::size_t values = 1;
  for (std::size_t i = 0; i < predicate.arity(); ++i) {
    if (!predicate.marked[i]) continue;
    const std::size_t size = evidence_.domain_size(context_->model(), predicate.domains[i]);
    if (size > 0 && values > std::numeric_limits<std::size_t>::max() / size) return;
    values *= size;
  }
  for (const Block& block : blocks) check_all_denied(id, block, values);
}

void EvidenceBuilder::check_all_denied(PredicateId id, const Block& block, std::size_t values) {
  if (block.denied == 0 || block.denied < values) return;
  const Predicate& predicate = context_->model().predicate(id);
  std::string name = predicate.name + "(";
  const std::span<const ConstantIndex> arguments = arguments_of(id, block.first);
  for (std::size_t i = 0; i < arguments.size(); ++i) {
    if (i > 0) name += ',';
    name += predicate.marked[i]
                ? "_"
                : quoted_constant(evidence_.constant_name(context_->model(), predicate.domains[i], arguments[i]));
  }
  name += ")";
  block_error(id, block.last_denied,
              fmt::format("every value of '{}' is denied, but exactly one must be true", shortened(name)),
              block.first_denied, "the first is denied here");
}

Evidence EvidenceBuilder::finish() && {
  for (std::size_t i = 0; i < context_->model().predicates().size(); ++i) {
    if (context_->model().predicates()[i].block != BlockKind::kNone) check_blocks(PredicateId(i));
  }
  evidence_.sources_ = context_->diagnostics().shared_sources();
  return std::move(evidence_);
}

}  // namespace sherlog
