// Distinct types for the things that are numbered, so that one cannot be passed for another.
#pragma once

#include <compare>
#include <cstddef>
#include <cstdint>
#include <functional>

namespace sherlog {

// A dense index from 0; `Tag` only keeps the types apart.
template <class Tag>
struct Id {
  std::uint32_t value = 0;

  constexpr Id() = default;
  constexpr explicit Id(std::size_t v) : value(static_cast<std::uint32_t>(v)) {}
  constexpr auto operator<=>(const Id&) const = default;
  constexpr std::size_t index() const { return value; }
};

using DomainId = Id<struct DomainTag>;  // a named set of constants
using PredicateId = Id<struct PredicateTag>;
using FormulaId = Id<struct FormulaTag>;      // a formula of the model, templates not expanded
using AtomId = Id<struct AtomTag>;            // an open ground atom of a GroundNetwork
using VariableId = Id<struct VariableTag>;    // a random variable of it: one atom, or a block of atoms
using GateId = Id<struct GateTag>;            // an inner node of its ground formulas
using WeightId = Id<struct WeightTag>;        // one weight: a formula after expansion of its templates
using ComponentId = Id<struct ComponentTag>;  // a connected component of it

// A constant is known by its position in its domain: first those of the model (declared, then met in formulas),
// then those that the evidence adds.
using ConstantIndex = std::uint32_t;
// In the constants of a ground formula: this variable is not bound, the formula speaks of all its values at once.
inline constexpr ConstantIndex kEveryConstant = 0xffffffffu;

}  // namespace sherlog

template <class Tag>
struct std::hash<sherlog::Id<Tag>> {
  std::size_t operator()(sherlog::Id<Tag> id) const noexcept { return std::hash<std::uint32_t>{}(id.value); }
};
