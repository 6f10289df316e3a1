// What a database says about ground atoms, against one model: true, false, unknown, or a degree.
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

#include "mln/model.h"

namespace sherlog {

enum class EvidenceKind : std::uint8_t {
  kFalse,
  kTrue,
  kUnknown,  // ?P(A): open even where its predicate is closed
  kSoft,     // 0.7 P(A), 0 < degree < 1; degrees of 0 and 1 become kFalse and kTrue
};

// The stated atoms of one predicate, without duplicates, in the order of the text.
struct PredicateEvidence {
  std::vector<ConstantIndex> arguments;  // arity() for each atom, one after the other
  std::vector<EvidenceKind> kinds;
  std::vector<double> degrees;  // kSoft: in (0, 1); else 0
  std::vector<Place> places;

  std::size_t size() const { return kinds.size(); }
};

// Immutable once made. Constants that the model does not know are appended to its domains here and nowhere else.
class Evidence {
 public:
  // Evidence that states nothing.
  explicit Evidence(const Model& model);

  const PredicateEvidence& of(PredicateId predicate) const { return predicates_[predicate.index()]; }
  // Constants added to the domain, in order of appearance; their indices follow those of the model.
  const std::vector<std::string>& added_constants(DomainId domain) const { return added_[domain.index()]; }
  std::size_t domain_size(const Model& model, DomainId domain) const {
    return model.domain(domain).constants.size() + added_[domain.index()].size();
  }
  const std::string& constant_name(const Model& model, DomainId domain, ConstantIndex constant) const;
  std::optional<ConstantIndex> find_constant(const Model& model, DomainId domain, std::string_view name) const;
  const Sources& sources() const { return *sources_; }

 private:
  friend class EvidenceBuilder;
  friend Model with_shared_constants(const Model&, std::span<const Evidence>, const std::vector<bool>&);
  friend Evidence renumbered(const Evidence&, const Model&, const Model&);
  friend Evidence without(const Evidence&, const std::vector<bool>&);
  std::vector<PredicateEvidence> predicates_;
  std::vector<std::vector<std::string>> added_;
  std::vector<std::unordered_map<std::string, ConstantIndex>> added_index_;
  std::shared_ptr<const Sources> sources_;
};

struct EvidenceOptions {
  bool ignore_unknown_predicates = false;
};

// One Evidence for each database of the text (`---` between them); an empty text is one database that states nothing.
// Errors (unknown predicate, arity, contradiction, block rules, ...) go to `diagnostics`, then nothing is returned.
std::optional<std::vector<Evidence>> parse_evidence(const Model& model, std::string_view text, const std::string& name,
                                                    Diagnostics& diagnostics, const EvidenceOptions& options = {});
// Several files of one database each are read as one database; where a file has several, the others must have one each,
// which is added to every one of them. "-" reads standard input.
std::optional<std::vector<Evidence>> parse_evidence_files(const Model& model, const std::vector<std::string>& paths,
                                                          Diagnostics& diagnostics,
                                                          const EvidenceOptions& options = {});

// Writes a constant as the languages want it: quoted where it needs quotes.
std::string quoted_constant(std::string_view constant);
// "Pred(A,B)", no spaces, constants quoted only where they need it.
std::string atom_text(const Model& model, const Evidence& evidence, PredicateId predicate,
                      std::span<const ConstantIndex> arguments);

}  // namespace sherlog
