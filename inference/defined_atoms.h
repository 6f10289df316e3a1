// Atoms that only say what something else is: `a <=> f`, and a occurs nowhere else.
//
// Idea      Given the rest, such an atom equals f with probability 1 / (1 + exp(-w)), w the weight of the equivalence (1 where it is
//           hard), and summing it out leaves the constant 1 + exp(w), whatever f is. So the samplers forget atom and
//           equivalence while they move the rest, and draw the atom afterwards: collapsed sampling at no cost. Left in, a soft
//           equivalence of weight 4 holds f in place 50 sweeps out of 51.
// Source    Liu, JASA 89, 1994.
#pragma once

#include <span>
#include <vector>

#include "inference/rng.h"
#include "inference/world.h"

namespace sherlog {

class DefinedAtoms {
 public:
  // Finds them among the variables and releases their equivalences from the index.
  void collapse(WorldIndex& index, std::span<const VariableId> variables);

  bool contains(VariableId v) const { return !collapsed_.empty() && collapsed_[v.index()]; }
  // Draws all of them, given the rest.
  void draw(World& world, Rng& rng) const;

 private:
  struct Definition {
    VariableId variable;
    Literal meaning;     // what it says, most of the time
    double probability;  // that it does
  };
  std::vector<Definition> definitions_;
  std::vector<bool> collapsed_;  // by variable
};

}  // namespace sherlog
