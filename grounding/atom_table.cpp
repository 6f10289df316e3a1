#include "grounding/atom_table.h"

#include <cmath>
#include <numeric>

namespace sherlog {
namespace {

// Where much of a predicate will be used, it has a cell for each atom up to so many times the usual limit.
constexpr double kDenseFactor = 32;
constexpr std::size_t kMaxAtoms = std::size_t{1} << 29;

// Calls visit(arguments) for every choice of constants at `positions`; the other arguments stay as they are.
template <class Visit>
void for_each_choice(std::vector<ConstantIndex>& arguments, const std::vector<std::uint32_t>& positions,
                     const std::vector<std::uint32_t>& sizes, Visit visit, std::size_t depth = 0) {
  if (depth == positions.size()) {
    visit(arguments);
    return;
  }
  for (ConstantIndex c = 0; c < sizes[positions[depth]]; ++c) {
    arguments[positions[depth]] = c;
    for_each_choice(arguments, positions, sizes, visit, depth + 1);
  }
}

double product(const std::vector<std::uint32_t>& sizes, const std::vector<std::uint32_t>& positions) {
  double result = 1;
  for (std::uint32_t position : positions) result *= sizes[position];
  return result;
}

std::span<const ConstantIndex> stated_arguments(const PredicateEvidence& stated, std::size_t i, std::size_t arity) {
  return {stated.arguments.data() + i * arity, arity};
}

}  // namespace

std::pair<std::uint32_t, std::uint32_t> AtomIndex::find(std::span<const ConstantIndex> key) const {
  std::uint64_t group = 0;
  if (dense) {
    for (std::size_t i = 0; i < key.size(); ++i) group += key_strides[i] * key[i];
  } else {
    const std::uint32_t found = keys.find(key);
    if (found == TupleTable::kNone) return {0, 0};
    group = found;
  }
  return {start[group], start[group + 1]};
}

AtomTable::AtomTable(const Model& model, const Evidence& evidence, std::vector<bool> open, NetworkBuilder& builder,
                     double dense_atoms)
    : model_(model), evidence_(evidence), builder_(builder), open_(std::move(open)), dense_atoms_(dense_atoms) {
  for (std::size_t d = 0; d < model.domains().size(); ++d) {
    domain_sizes_.push_back(static_cast<std::uint32_t>(evidence.domain_size(model, DomainId(d))));
  }
  states_.resize(model.predicates().size());
  std::size_t largest_arity = 0;
  for (const Predicate& predicate : model.predicates()) largest_arity = std::max(largest_arity, predicate.arity());
  scratch_.resize(largest_arity + 1);
  for (std::size_t p = 0; p < states_.size(); ++p) set_up(PredicateId(p));
}

void AtomTable::set_up(PredicateId id) {
  const Predicate& predicate = model_.predicate(id);
  const PredicateEvidence& stated = evidence_.of(id);
  State& state = states_[id.index()];
  state.arity = predicate.arity();
  state.block = predicate.block;
  state.starts_open = open_[id.index()] || predicate.block == BlockKind::kExactlyOne;
  for (std::size_t i = 0; i < state.arity; ++i) {
    state.sizes.push_back(domain_sizes_[predicate.domains[i].index()]);
    state.total *= state.sizes.back();
    const bool marked = predicate.block != BlockKind::kNone && predicate.marked[i];
    (marked ? state.marked : state.unmarked).push_back(static_cast<std::uint32_t>(i));
  }
  const double values = values_of_block(state);
  if (state.block == BlockKind::kExactlyOne && values == 0 && product(state.sizes, state.unmarked) > 0) {
    if (!empty_block_) empty_block_ = EmptyBlock{id, {}};
    return;
  }
  state.default_code = !state.starts_open                                     ? atom_code::kFalse
                       : state.block == BlockKind::kExactlyOne && values == 1 ? atom_code::kTrue
                                                                              : atom_code::kOpen;
  allocate(state, stated.size());
  state_atoms(stated, state);
  if (state.block == BlockKind::kNone) {
    list_atoms(stated, state);
  } else {
    decide_blocks(id, stated, state);
  }
  state.has_open = std::ranges::any_of(state.unmade, [](const auto& entry) { return entry.second > 0; });
}

double AtomTable::values_of_block(const State& state) const { return product(state.sizes, state.marked); }

void AtomTable::allocate(State& state, std::size_t stated) {
  const bool much_used = state.starts_open || static_cast<double>(stated) * 8 >= state.total;
  state.dense = state.total <= dense_atoms_ * (much_used ? kDenseFactor : 1);
  state.strides.assign(state.arity, 0);
  if (!state.dense) {
    state.stored = TupleTable(state.arity);
    return;
  }
  std::uint64_t stride = 1;
  for (std::size_t i = state.arity; i-- > 0;) {
    state.strides[i] = stride;
    stride *= state.sizes[i];
  }
  state.cells.assign(static_cast<std::size_t>(state.total), state.default_code);
}

void AtomTable::state_atoms(const PredicateEvidence& stated, State& state) {
  for (std::size_t i = 0; i < stated.size(); ++i) {
    const EvidenceKind kind = stated.kinds[i];
    set(state, stated_arguments(stated, i, state.arity),
        kind == EvidenceKind::kFalse  ? atom_code::kFalse
        : kind == EvidenceKind::kTrue ? atom_code::kTrue
                                      : atom_code::kOpen);
  }
}

// Predicates without blocks: what is open, and the list.
void AtomTable::list_atoms(const PredicateEvidence& stated, State& state) {
  double decided = 0;
  for (EvidenceKind kind : stated.kinds) decided += kind == EvidenceKind::kTrue || kind == EvidenceKind::kFalse ? 1 : 0;
  state.unmade[1] = state.starts_open ? state.total - decided : static_cast<double>(stated.size()) - decided;
  if (state.starts_open) return;
  state.listable = true;
  for (std::size_t i = 0; i < stated.size(); ++i) {
    if (stated.kinds[i] == EvidenceKind::kFalse) continue;
    const auto arguments = stated_arguments(stated, i, state.arity);
    state.listed.insert(state.listed.end(), arguments.begin(), arguments.end());
    state.listed_decided.push_back(stated.kinds[i] == EvidenceKind::kTrue ? 1 : 0);
  }
}

void AtomTable::decide_blocks(PredicateId id, const PredicateEvidence& stated, State& state) {
  constexpr std::uint32_t kNone = TupleTable::kNone;
  state.touched = TupleTable(state.unmarked.size());
  std::vector<std::uint32_t> truth, any, block_of(stated.size());
  std::vector<bool> worth_a_look;  // a closed '?' block without a truth has candidates only where some are stated open
  for (std::size_t i = 0; i < stated.size(); ++i) {
    const std::uint32_t block = state.touched.insert(block_key(state, stated_arguments(stated, i, state.arity)));
    block_of[i] = block;
    if (block == truth.size()) {
      truth.push_back(kNone);
      any.push_back(static_cast<std::uint32_t>(i));
      worth_a_look.push_back(state.starts_open);
    }
    if (stated.kinds[i] == EvidenceKind::kTrue) truth[block] = static_cast<std::uint32_t>(i);
    if (stated.kinds[i] != EvidenceKind::kFalse) worth_a_look[block] = true;
  }
  state.touched_has_true.assign(truth.size(), false);
  for (std::uint32_t block = 0; block < truth.size(); ++block) state.touched_has_true[block] = truth[block] != kNone;
  for (std::size_t i = 0; i < stated.size(); ++i) {
    if (truth[block_of[i]] != kNone && truth[block_of[i]] != i) {
      set(state, stated_arguments(stated, i, state.arity), atom_code::kFalse);
    }
  }
  for (std::uint32_t block = 0; block < truth.size(); ++block) {
    if (worth_a_look[block]) decide_block(id, block, truth[block], any[block], state);
  }
  const double blocks = product(state.sizes, state.unmarked);
  const double values = values_of_block(state);
  const double untouched = blocks - static_cast<double>(truth.size());
  if (state.default_code == atom_code::kOpen && untouched > 0 && values > 0) {
    state.unmade[values] += untouched;
  }
  state.listable = !state.starts_open || untouched == 0;
}

// `truth`: the stated atom that is true, or kNone; `any`: some stated atom of the block.
void AtomTable::decide_block(PredicateId id, std::uint32_t block, std::uint32_t truth, std::uint32_t any,
                             State& state) {
  const PredicateEvidence& stated = evidence_.of(id);
  const auto sample = stated_arguments(stated, truth != TupleTable::kNone ? truth : any, state.arity);
  std::vector<ConstantIndex> arguments(sample.begin(), sample.end());
  const auto list = [&](std::span<const ConstantIndex> atoms, bool decided) {
    state.listed.insert(state.listed.end(), atoms.begin(), atoms.end());
    state.listed_decided.insert(state.listed_decided.end(), atoms.size() / state.arity, decided ? 1 : 0);
  };
  if (truth != TupleTable::kNone) {
    if (state.dense) {
      for_each_choice(arguments, state.marked, state.sizes,
                      [&](const auto& a) { state.cells[address(state, a)] = atom_code::kFalse; });
      state.cells[address(state, sample)] = atom_code::kTrue;
    }
    list(sample, true);
    return;
  }
  const std::vector<ConstantIndex> candidates = open_candidates(state, sample);
  const std::size_t count = candidates.size() / state.arity;
  if (state.block == BlockKind::kExactlyOne && count == 0) {
    if (!empty_block_) empty_block_ = EmptyBlock{id, arguments};
  } else if (state.block == BlockKind::kExactlyOne && count == 1) {
    set(state, candidates, atom_code::kTrue);
    state.touched_has_true[block] = true;
    list(candidates, true);
  } else if (count > 0) {
    state.unmade[static_cast<double>(count)] += 1;
    list(candidates, false);
  }
}

AtomPattern AtomTable::pattern(PredicateId predicate, std::vector<Term> terms) const {
  const State& state = states_[predicate.index()];
  AtomPattern result;
  result.predicate = predicate.value;
  for (std::size_t i = 0; i < terms.size() && state.dense; ++i) {
    const std::uint64_t stride = state.strides.empty() ? 0 : state.strides[i];
    if (!terms[i].is_variable) {
      result.base += stride * terms[i].index;
      continue;
    }
    const auto same = std::ranges::find(result.parts, terms[i].index, &AtomPattern::Part::variable);
    if (same != result.parts.end()) {
      same->stride += stride;
    } else {
      result.parts.push_back({terms[i].index, stride});
    }
  }
  result.terms = std::move(terms);
  return result;
}

std::uint64_t AtomTable::address(const State& state, std::span<const ConstantIndex> arguments) const {
  std::uint64_t result = 0;
  for (std::size_t i = 0; i < arguments.size(); ++i) result += state.strides[i] * arguments[i];
  return result;
}

void AtomTable::set(State& state, std::span<const ConstantIndex> arguments, std::uint32_t code) {
  if (state.dense) {
    state.cells[address(state, arguments)] = code;
    return;
  }
  const std::uint32_t entry = state.stored.insert(arguments);
  if (entry == state.stored_codes.size()) state.stored_codes.push_back(code);
  state.stored_codes[entry] = code;
}

std::uint32_t AtomTable::code(PredicateId predicate, std::span<const ConstantIndex> arguments) const {
  const State& state = states_[predicate.index()];
  return state.dense ? state.cells[address(state, arguments)] : sparse_code(state, arguments);
}

std::uint32_t AtomTable::sparse_code(const AtomPattern& atom, const ConstantIndex* values) const {
  for (std::size_t i = 0; i < atom.terms.size(); ++i) {
    scratch_[i] = atom.terms[i].is_variable ? values[atom.terms[i].index] : atom.terms[i].index;
  }
  return sparse_code(states_[atom.predicate], {scratch_.data(), atom.terms.size()});
}

std::uint32_t AtomTable::sparse_code(const State& state, std::span<const ConstantIndex> arguments) const {
  const std::uint32_t entry = state.stored.find(arguments);
  if (entry != TupleTable::kNone) return state.stored_codes[entry];
  if (state.block != BlockKind::kNone && state.touched.size() > 0) {
    block_scratch_.clear();
    for (std::uint32_t position : state.unmarked) block_scratch_.push_back(arguments[position]);
    const std::uint32_t block = state.touched.find(block_scratch_);
    if (block != TupleTable::kNone && state.touched_has_true[block]) return atom_code::kFalse;
  }
  return state.default_code;
}

std::vector<ConstantIndex> AtomTable::block_key(const State& state, std::span<const ConstantIndex> arguments) const {
  std::vector<ConstantIndex> key;
  key.reserve(state.unmarked.size());
  for (std::uint32_t position : state.unmarked) key.push_back(arguments[position]);
  return key;
}

std::vector<ConstantIndex> AtomTable::open_candidates(const State& state,
                                                      std::span<const ConstantIndex> arguments) const {
  std::vector<ConstantIndex> atom(arguments.begin(), arguments.end()), result;
  for_each_choice(atom, state.marked, state.sizes, [&](const auto& a) {
    const std::uint32_t code = state.dense ? state.cells[address(state, a)] : sparse_code(state, a);
    if (code == atom_code::kOpen) result.insert(result.end(), a.begin(), a.end());
  });
  return result;
}

std::uint32_t AtomTable::materialised_code(const AtomPattern& atom, const ConstantIndex* values) {
  const std::uint32_t known = code(atom, values);
  if (known != atom_code::kOpen) return known;
  std::vector<ConstantIndex> arguments;
  arguments.reserve(atom.terms.size());
  for (const Term& term : atom.terms) arguments.push_back(term.is_variable ? values[term.index] : term.index);
  return materialised_code(PredicateId(atom.predicate), arguments);
}

std::uint32_t AtomTable::materialised_code(PredicateId predicate, std::span<const ConstantIndex> arguments) {
  const std::uint32_t known = code(predicate, arguments);
  if (known != atom_code::kOpen) return known;
  State& state = states_[predicate.index()];
  std::vector<ConstantIndex> block;
  std::uint32_t count = 1;
  std::span<const ConstantIndex> atoms = arguments;
  if (state.block != BlockKind::kNone) {
    block = open_candidates(state, arguments);
    atoms = block;
    count = static_cast<std::uint32_t>(block.size() / state.arity);
  }
  if (builder_.atom_count() + count > kMaxAtoms) {
    overflowed_ = true;
    return atom_code::kFalse;
  }
  const VariableId variable = builder_.add_variable(predicate, atoms, count, state.block != BlockKind::kExactlyOne);
  state.unmade[count] -= 1;
  for (std::uint32_t i = 0; i < count; ++i) {
    set(state, atoms.subspan(i * state.arity, state.arity),
        atom_code::kFirst + builder_.first_atom(variable).value + i);
  }
  return code(predicate, arguments);
}

const AtomIndex& AtomTable::index(PredicateId predicate, const std::vector<std::uint32_t>& key_positions) {
  State& state = states_[predicate.index()];
  auto& made = state.indexes[key_positions];
  if (made) return *made;
  made = std::make_unique<AtomIndex>();
  AtomIndex& index = *made;
  index.key_positions = key_positions;
  const std::size_t rows = state.listed_decided.size();
  const double range = product(state.sizes, key_positions);
  index.dense = range <= std::max(1024.0, 16.0 * static_cast<double>(rows));
  index.keys = TupleTable(key_positions.size());
  std::uint64_t stride = 1;
  index.key_strides.assign(key_positions.size(), 0);
  for (std::size_t i = key_positions.size(); i-- > 0; stride *= state.sizes[key_positions[i]])
    index.key_strides[i] = stride;

  std::vector<std::uint32_t> group(rows);
  std::vector<ConstantIndex> key(key_positions.size());
  for (std::size_t row = 0; row < rows; ++row) {
    std::uint64_t dense_group = 0;
    for (std::size_t i = 0; i < key.size(); ++i) {
      key[i] = state.listed[row * state.arity + key_positions[i]];
      dense_group += index.key_strides[i] * key[i];
    }
    group[row] = index.dense ? static_cast<std::uint32_t>(dense_group) : index.keys.insert(key);
  }
  index.start.assign((index.dense ? static_cast<std::size_t>(range) : index.keys.size()) + 1, 0);
  for (std::uint32_t g : group) ++index.start[g + 1];
  index.groups = static_cast<std::size_t>(std::ranges::count_if(index.start, [](std::uint32_t n) { return n > 0; }));
  std::partial_sum(index.start.begin(), index.start.end(), index.start.begin());
  std::vector<std::uint32_t> next(index.start.begin(), index.start.end() - 1);
  index.rows.resize(rows * state.arity);
  index.decided.resize(rows);
  for (std::size_t row = 0; row < rows; ++row) {
    const std::uint32_t to = next[group[row]]++;
    std::copy_n(state.listed.begin() + static_cast<std::ptrdiff_t>(row * state.arity), state.arity,
                index.rows.begin() + static_cast<std::ptrdiff_t>(to * state.arity));
    index.decided[to] = state.listed_decided[row];
  }
  return index;
}

double AtomTable::free_log_count() const {
  double result = 0;
  for (const State& state : states_) {
    const double none = state.block == BlockKind::kExactlyOne ? 0 : 1;
    for (const auto& [candidates, count] : state.unmade) {
      if (count > 0) result += count * std::log(candidates + none);
    }
  }
  return result;
}

std::size_t AtomTable::memory_bytes() const {
  std::size_t bytes = 0;
  for (const State& state : states_) {
    bytes += (state.cells.capacity() + state.stored_codes.capacity() + state.listed.capacity()) * 4;
    bytes += state.stored.memory_bytes() + state.touched.memory_bytes();
    for (const auto& [mask, index] : state.indexes)
      bytes += (index->rows.size() + index->start.size()) * 4 + index->decided.size();
  }
  return bytes;
}

}  // namespace sherlog
