// What is known of every ground atom: false, true, open, or already an atom of the network; and the joins' view of it.
//
// Idea      An atom's address is its arguments read as digits of a mixed-radix number. Predicates with a moderate
//           number of atoms have one 32-bit cell for each (its code); the others keep only the atoms that differ from
//           the default in a hash table. The rules of blocks are applied once, to the blocks that the evidence touches:
//           a stated value denies its siblings, a single value left of a '!' block is true. An open atom becomes an
//           atom of the network when it is first asked for, and its block with it; all others are only counted. Where
//           the atoms of a predicate that are not false can be listed (closed predicates; '!' predicates all of whose
//           blocks the evidence decides), the list can be read through an index on any set of arguments: that is what
//           makes grounding a join and not a product of domains.
// Cost      set-up linear in the evidence, plus 4 bytes a cell; an index is built on first use, linear in its list.
#pragma once

#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "grounding/network.h"
#include "grounding/tuple_table.h"
#include "mln/evidence.h"
#include "mln/model.h"

namespace sherlog {

// What is known of an atom. From kFirst on: the atom of the network with the number code - kFirst.
namespace atom_code {
inline constexpr std::uint32_t kFalse = 1, kTrue = 2, kOpen = 3, kFirst = 4;
}

// An atom with variables: P(x, A, y). The address is base + sum of stride * value.
struct AtomPattern {
  std::uint32_t predicate = 0;
  std::vector<Term> terms;
  std::uint64_t base = 0;
  struct Part {
    std::uint32_t variable;
    std::uint64_t stride;
  };
  std::vector<Part> parts;
};

// The listed atoms of a predicate, grouped by the constants at some of its positions (the key).
struct AtomIndex {
  std::vector<std::uint32_t> key_positions;
  std::vector<std::uint64_t> key_strides;  // mixed radix where `dense`
  bool dense = false;
  TupleTable keys;                    // the groups' numbers where not `dense`
  std::vector<std::uint32_t> start;   // group g holds the rows start[g] .. start[g + 1]
  std::vector<ConstantIndex> rows;    // arity constants each
  std::vector<std::uint8_t> decided;  // by row: true rather than open
  std::size_t groups = 0;             // that are not empty

  std::pair<std::uint32_t, std::uint32_t> find(std::span<const ConstantIndex> key) const;
};

class AtomTable {
 public:
  // A '!' block that evidence leaves without a value. `arguments`: those of one of its atoms; empty where it has no atoms
  // because the domain of its values has no constants.
  struct EmptyBlock {
    PredicateId predicate;
    std::vector<ConstantIndex> arguments;
  };

  // `open`: by predicate. `builder` receives the atoms and must outlive this. `dense_atoms`: up to this many atoms a
  // predicate has a cell for each, whatever is known of them.
  AtomTable(const Model& model, const Evidence& evidence, std::vector<bool> open, NetworkBuilder& builder,
            double dense_atoms = 1 << 20);

  const std::optional<EmptyBlock>& empty_block() const { return empty_block_; }
  bool is_open(PredicateId p) const { return open_[p.index()]; }
  std::uint32_t domain_size(DomainId d) const { return domain_sizes_[d.index()]; }

  AtomPattern pattern(PredicateId predicate, std::vector<Term> terms) const;

  // The code of the atom under these values of the variables.
  std::uint32_t code(const AtomPattern& atom, const ConstantIndex* values) const {
    const State& state = states_[atom.predicate];
    if (state.dense) {
      std::uint64_t address = atom.base;
      for (const auto& part : atom.parts) address += part.stride * values[part.variable];
      return state.cells[address];
    }
    return sparse_code(atom, values);
  }
  std::uint32_t code(PredicateId predicate, std::span<const ConstantIndex> arguments) const;
  // The same, but an open atom is made an atom of the network first. Never kOpen.
  std::uint32_t materialised_code(const AtomPattern& atom, const ConstantIndex* values);
  std::uint32_t materialised_code(PredicateId predicate, std::span<const ConstantIndex> arguments);

  // Whether the atoms that are not false can be listed.
  bool listable(PredicateId p) const { return states_[p.index()].listable; }
  const AtomIndex& index(PredicateId p, const std::vector<std::uint32_t>& key_positions);

  // Whether some of the predicate's atoms are open.
  bool has_open_atoms(PredicateId p) const { return states_[p.index()].has_open; }
  // log of the number of worlds of the variables that were never materialised.
  double free_log_count() const;
  // More atoms were asked for than a network can hold.
  bool overflowed() const { return overflowed_; }
  std::size_t memory_bytes() const;

 private:
  struct State {
    std::size_t arity = 0;
    std::vector<std::uint32_t> sizes;
    std::vector<std::uint64_t> strides;
    double total = 1;
    bool dense = true;
    std::vector<std::uint32_t> cells;  // dense
    TupleTable stored;                 // else: those that differ from the default
    std::vector<std::uint32_t> stored_codes;
    std::uint32_t default_code = atom_code::kFalse;
    BlockKind block = BlockKind::kNone;
    bool starts_open = false;                     // an unstated atom is open unless its block decides it
    std::vector<std::uint32_t> unmarked, marked;  // positions
    TupleTable touched;  // blocks that the evidence says something about, by unmarked constants
    std::vector<bool> touched_has_true;
    bool has_open = false;
    bool listable = false;
    std::vector<ConstantIndex> listed;  // arity constants each
    std::vector<std::uint8_t> listed_decided;
    std::map<std::vector<std::uint32_t>, std::unique_ptr<AtomIndex>> indexes;  // by key positions
    std::map<double, double> unmade;  // number of candidates -> open variables not materialised
  };

  void set_up(PredicateId predicate);
  void allocate(State& state, std::size_t stated);
  void state_atoms(const PredicateEvidence& stated, State& state);
  void decide_blocks(PredicateId predicate, const PredicateEvidence& stated, State& state);
  void decide_block(PredicateId predicate, std::uint32_t block, std::uint32_t truth, std::uint32_t any, State& state);
  void list_atoms(const PredicateEvidence& stated, State& state);

  void set(State& state, std::span<const ConstantIndex> arguments, std::uint32_t code);
  std::uint64_t address(const State& state, std::span<const ConstantIndex> arguments) const;
  std::uint32_t sparse_code(const AtomPattern& atom, const ConstantIndex* values) const;
  std::uint32_t sparse_code(const State& state, std::span<const ConstantIndex> arguments) const;
  std::vector<ConstantIndex> block_key(const State& state, std::span<const ConstantIndex> arguments) const;
  // Arguments of all atoms of the block that are not decided, one after the other.
  std::vector<ConstantIndex> open_candidates(const State& state, std::span<const ConstantIndex> arguments) const;
  double values_of_block(const State& state) const;

  const Model& model_;
  const Evidence& evidence_;
  NetworkBuilder& builder_;
  std::vector<bool> open_;
  double dense_atoms_;
  std::vector<std::uint32_t> domain_sizes_;
  std::vector<State> states_;
  std::optional<EmptyBlock> empty_block_;
  mutable std::vector<ConstantIndex> scratch_, block_scratch_;  // for one look-up
  bool overflowed_ = false;
};

}  // namespace sherlog
