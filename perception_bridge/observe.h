// Scenes to evidence: what the annotators said, as ground atoms of a model.
//
// Idea      scene --observe--> Evidence. A mapping (evidence_mapping.h) says which annotation is which atom. The result is first a
//           list of atoms with degrees, which can be looked at; then the text of a .db file, or Evidence against a model.
//           An atom that two annotators report is stated once, with the larger degree.
// Input     one scene: its clusters are c0, c1, ... in their order; or what was seen before and a new scene: O0, ... and N0, ...
// Output    degrees of pairs lie in [1e-9, 1 - 1e-9]: no measurement is a certainty, and a certainty can contradict the rules
// Cost      linear in the annotations; quadratic in the clusters for pairs
#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "mln/evidence.h"
#include "perception_bridge/evidence_mapping.h"
#include "perception_bridge/scene.h"

namespace sherlog {

struct ObservedAtom {
  std::string predicate;
  std::vector<std::string> arguments;
  double degree = 1;
  bool soft = false;  // false: a fact, whatever its degree was
};

struct SceneObservation {
  std::vector<std::pair<std::string, std::vector<std::string>>> domains;  // so that clusters without an atom exist too
  std::vector<ObservedAtom> atoms;
  std::vector<std::string> notes;  // what was left out, and why
};

struct ObserveOptions {
  bool labels = false;        // rules marked "training" as well
  std::optional<bool> fuzzy;  // RoboSherlock's word: all degrees soft, or none; without: as each rule says
};

SceneObservation observe(const EvidenceMapping& mapping, const Scene& scene, const ObserveOptions& options = {});

// Old clusters against the clusters of a new scene: each pair by the mapping's pair rules; out of view where the scene's view
// does not have the old position. An old cluster without a position counts as in view.
SceneObservation observe_change(const EvidenceMapping& mapping, std::span<const Cluster> old_clusters,
                                const Scene& now);

// Without control characters: each row of them is one blank, and none at the ends. Evidence and its comments are written in
// lines, and a constant with a line break in it (text that was read off a label) could not be read back.
std::string on_one_line(std::string_view text);

// One database of a .db file.
std::string evidence_text(const SceneObservation& observation);
// Errors (a predicate that the model does not declare, ...) go to `diagnostics`.
std::optional<Evidence> to_evidence(const SceneObservation& observation, const Model& model, Diagnostics& diagnostics,
                                    const EvidenceOptions& options = {});

// RoboSherlock's rs.annotation.MLNAtoms of one cluster: its atoms as texts.
Annotation mln_atoms(const SceneObservation& observation, const std::string& cluster);

}  // namespace sherlog
