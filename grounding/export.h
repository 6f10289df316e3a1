// A ground network in the file formats of other programs.
//
// WCNF      weighted partial MaxSAT ("p wcnf VARIABLES CLAUSES TOP"): a solver's optimum is the most probable world.
//           Variable a + 1 is atom a, atom_count + g + 1 is gate g; comments name the atoms. Gates are defined by hard
//           clauses in both directions (Tseitin), a block by "at most one" for each pair and, where it has no "none", "at
//           least one"; constraints are hard units. A feature of weight w > 0 on a literal is the soft unit clause of the
//           literal with round(w * scale), one of w < 0 the soft clause of its negation with round(-w * scale).
//           Two comments state how to read the optimum's cost:  log score = offset - cost / scale.
// UAI       a Markov network ("MARKOV"): one variable for each variable of the network with the same values, then one binary
//           auxiliary variable (0 = false, 1 = true) for each gate that needs one. One table for each feature (exp(weight)
//           where its literal is true, else 1; weights beyond 500 are spread over several tables) and for each constraint
//           (1 or 0); one for each auxiliary variable (1 where it equals its gate). A literal over few variables gets
//           its table directly, others go through auxiliary variables. The last variable of a scope runs fastest.
//           The constant score and the atoms that nothing mentions are a table as well, of one number over the first variable
//           (over none in a network without variables): the file's partition function is the model's.
// GraphML, DOT  the factor graph: variables, features and constraints are nodes, an edge says "mentions".
//
// Errors    a sentence where the weights do not fit into the format; nothing is written then.
// Requires  Jeffrey evidence (soft_targets) is a demand on the answer, not a factor: it is in none of these formats.
// Cost      linear in the network but for blocks (pairs of their atoms) and direct tables (at most 2^10 entries).
#pragma once

#include <iosfwd>
#include <optional>
#include <string>

#include "grounding/network.h"

namespace sherlog {

std::optional<std::string> export_wcnf(const GroundNetwork& network, std::ostream& out);
std::optional<std::string> export_uai(const GroundNetwork& network, std::ostream& out);
void export_graphml(const GroundNetwork& network, std::ostream& out);
void export_dot(const GroundNetwork& network, std::ostream& out);

}  // namespace sherlog
