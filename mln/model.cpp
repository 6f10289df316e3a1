// Look-ups in a finished model. It is made by resolve.cpp.
#include "mln/model.h"

namespace sherlog {

std::optional<ConstantIndex> Domain::find(std::string_view constant) const {
  const auto entry = index.find(std::string(constant));
  if (entry == index.end()) return std::nullopt;
  return entry->second;
}

std::optional<PredicateId> Model::find_predicate(std::string_view name) const {
  const auto entry = predicate_index_.find(std::string(name));
  if (entry == predicate_index_.end()) return std::nullopt;
  return entry->second;
}

std::optional<DomainId> Model::find_domain(std::string_view name) const {
  const auto entry = domain_index_.find(std::string(name));
  if (entry == domain_index_.end()) return std::nullopt;
  return entry->second;
}

}  // namespace sherlog
