// One database in the making: stated atoms without duplicates, added constants, and the rules that they must keep.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <unordered_set>
#include <utility>
#include <vector>

#include "mln/evidence.h"
#include "mln/flat_index.h"

namespace sherlog {

// What the databases of one call share: the model's names in fast tables, and what has been said already.
class EvidenceContext {
 public:
  EvidenceContext(const Model& model, Diagnostics& diagnostics, const EvidenceOptions& options);

  const Model& model() const { return model_; }
  Diagnostics& diagnostics() { return diagnostics_; }
  const EvidenceOptions& options() const { return options_; }

  std::optional<PredicateId> find_predicate(std::string_view name) const;
  // The position in the model's domain, or FlatIndex::kNone. The table of a domain is made on first use.
  ConstantIndex find_constant(DomainId domain, std::string_view name, std::uint64_t hash);
  // What there is to say about a constant that the model does not know, once for each: that a domain declared with values is
  // widened (a warning), or that formulas compare the domain's constants and this one is no number (an error).
  void check_new_constant(DomainId domain, std::string_view name, const Place& place);
  std::string predicate_suggestion(std::string_view name) const;
  std::string domain_suggestion(std::string_view name) const;

 private:
  const Model& model_;
  Diagnostics& diagnostics_;
  EvidenceOptions options_;
  FlatIndex predicates_;
  std::vector<FlatIndex> constants_;
  std::vector<bool> constants_ready_;
  std::unordered_set<std::string> said_;        // "domain\nconstant"
  std::vector<std::optional<Place>> compared_;  // by domain: where a formula compares its constants
};

// Copyable: databases that share a beginning are copies of it.
class EvidenceBuilder {
 public:
  explicit EvidenceBuilder(EvidenceContext& context);

  // The constant's index, added to the domain if it `is_new`.
  ConstantIndex constant(DomainId domain, std::string_view name, bool& is_new);
  // States an atom. A repetition is ignored, a contradiction reported.
  void state(PredicateId predicate, std::span<const ConstantIndex> arguments, EvidenceKind kind, double degree,
             const Place& place);
  // Checks the block rules against the complete domains.
  Evidence finish() &&;

 private:
  struct Block;

  void block_error(PredicateId id, std::uint32_t atom, std::string text, std::uint32_t other, std::string other_text);
  void check_blocks(PredicateId id);
  void check_all_denied(PredicateId id, const Block& block, std::size_t values);
  void report_contradiction(PredicateId id, std::uint32_t before, EvidenceKind kind, double degree, const Place& place);
  std::span<const ConstantIndex> arguments_of(PredicateId id, std::uint32_t atom) const;
  std::string text_of(PredicateId id, std::uint32_t atom) const;

  EvidenceContext* context_;
  Evidence evidence_;
  std::vector<FlatIndex> atoms_;  // one for each predicate
  std::vector<FlatIndex> added_;  // one for each domain
};

// A name in a message: cut where it is absurdly long.
std::string_view shortened(std::string_view name);

}  // namespace sherlog
