#include "inference/defined_atoms.h"

#include <cmath>

namespace sherlog {

void DefinedAtoms::collapse(WorldIndex& index, std::span<const VariableId> variables) {
  const GroundNetwork& network = index.network();
  collapsed_.resize(network.variable_count(), false);
  std::vector<bool> consumed(network.gate_count(), false);
  for (VariableId v : variables) {
    const AtomId atom = network.first_atom(v);
    if (network.candidate_count(v) != 1 || !network.has_none(v)) continue;
    if (index.weight(atom.value) != 0.0 || index.demand(atom.value) != 0 || index.uses(atom.value).size() != 1)
      continue;
    const std::uint32_t gate = index.uses(atom.value).front().gate;
    const std::uint32_t node = index.gate_node(gate);
    if (consumed[gate] || network.gate_kind(GateId(gate)) != GateKind::kIff || !index.uses(node).empty()) continue;
    if (index.demand(node) == WorldIndex::kImpossibleDemand) continue;
    const auto inputs = network.gate_inputs(GateId(gate));
    const Literal self = Literal::atom(atom);
    Literal meaning = inputs[0] == self ? inputs[1] : inputs[0];
    double probability = 1.0;
    if (index.demand(node) == 0) {
      probability = 1.0 / (1.0 + std::exp(-index.weight(node)));
    } else if (index.demand(node) < 0) {
      meaning = ~meaning;
    }
    definitions_.push_back({v, meaning, probability});
    collapsed_[v.index()] = true;
    consumed[gate] = true;
    index.release(node);
  }
  index.sort_uses();
}

void DefinedAtoms::draw(World& world, Rng& rng) const {
  for (const Definition& d : definitions_) {
    const bool truth = world.is_true(d.meaning) == (d.probability >= 1.0 || rng.uniform() < d.probability);
    world.set(d.variable, truth ? 0 : 1);
  }
}

}  // namespace sherlog
