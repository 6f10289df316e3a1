// What tests of ground networks keep saying.
#pragma once

#include <vector>

#include "grounding/network.h"

namespace sherlog {

inline std::vector<ComponentId> all_components(const GroundNetwork& network) {
  std::vector<ComponentId> all;
  for (std::size_t c = 0; c < network.component_count(); ++c) all.push_back(ComponentId(c));
  return all;
}

// A new open ground atom.
inline Literal boolean(NetworkBuilder& builder) { return Literal::atom(builder.first_atom(builder.add_boolean())); }

}  // namespace sherlog
