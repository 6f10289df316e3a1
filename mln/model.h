// A Markov logic network: domains, predicates and weighted formulas, checked and typed. Immutable once made.
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

#include "mln/formula.h"
#include "mln/syntax.h"

namespace sherlog {

struct Domain {
  std::string name;
  std::vector<std::string> constants;  // declared ones first, then those met in formulas
  std::unordered_map<std::string, ConstantIndex> index;
  std::size_t declared_count = 0;  // how many of `constants` the declaration lists
  bool declared = false;           // has a declaration with values
  Place place;                     // of its declaration, or of the first predicate that uses it

  std::optional<ConstantIndex> find(std::string_view constant) const;
};

enum class BlockKind : std::uint8_t {
  kNone,        // every ground atom is a variable of its own
  kExactlyOne,  // '!': for each binding of the unmarked arguments exactly one binding of the marked ones is true
  kAtMostOne,   // '?': at most one
};

struct Predicate {
  std::string name;
  std::vector<DomainId> domains;  // one for each argument
  std::vector<bool> marked;       // which arguments carry the mark; all false where block is kNone
  BlockKind block = BlockKind::kNone;
  bool closed = false;  // declared *P: stays closed under --open-world without a value
  Place place;

  std::size_t arity() const { return domains.size(); }
};

class Evidence;

class Model {
 public:
  const std::vector<Domain>& domains() const { return domains_; }
  const std::vector<Predicate>& predicates() const { return predicates_; }
  const std::vector<Formula>& formulas() const { return formulas_; }
  const Domain& domain(DomainId id) const { return domains_[id.index()]; }
  const Predicate& predicate(PredicateId id) const { return predicates_[id.index()]; }
  const Formula& formula(FormulaId id) const { return formulas_[id.index()]; }
  std::optional<PredicateId> find_predicate(std::string_view name) const;
  std::optional<DomainId> find_domain(std::string_view name) const;
  const Sources& sources() const { return *sources_; }

 private:
  friend class ModelBuilder;
  friend Model with_shared_constants(const Model&, std::span<const Evidence>, const std::vector<bool>&);
  std::vector<Domain> domains_;
  std::vector<Predicate> predicates_;
  std::vector<Formula> formulas_;  // *P atoms are expanded, + templates are not
  std::unordered_map<std::string, PredicateId> predicate_index_;
  std::unordered_map<std::string, DomainId> domain_index_;
  std::shared_ptr<const Sources> sources_ = std::make_shared<const Sources>();
};

// Reads, parses, types and checks a model. Several files make one model, in order. `name` "-" reads standard input.
// Errors: all go to `diagnostics`, then nothing is returned. Warnings go there too.
std::optional<Model> parse_model_file(const std::string& path, Diagnostics& diagnostics);
std::optional<Model> parse_model_files(const std::vector<std::string>& paths, Diagnostics& diagnostics);
// `name` stands in messages; includes are relative to the folder of `name`.
std::optional<Model> parse_model(std::string_view text, const std::string& name, Diagnostics& diagnostics);
// The second half of the above: types and checks what the parser found.
std::optional<Model> resolve(const syntax::Model& parsed, Diagnostics& diagnostics);

}  // namespace sherlog
