// Pictures of one step of identity resolution: what was measured, what is believed, and the one explanation of the scene.
//
// Idea      Matrices with the new clusters on top and the old ones on the left, the darker the nearer to 1: first each grade
//           (similar, proximity), then the marginals of is(...) summed over stay, move and newview, with those of having
//           appeared below and of being gone on the right, and last the explanation: S, M, V in the cell of a pair, A below a
//           new cluster without a partner, D or H beside an old one. Where the truth is known, what differs from it is framed.
// Source    Beetz et al., RoboSherlock, ICRA 2015, Fig. 11
// Output    SVG, or a page with several of them; the same bytes for the same step
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "perception_bridge/evidence_mapping.h"
#include "perception_bridge/identity_belief.h"
#include "perception_bridge/observe.h"

namespace sherlog {

struct StepPicture {
  struct Grades {
    std::string name;            // of the predicate
    std::vector<double> values;  // old x new, row by row
  };
  std::string title;
  std::vector<std::string> old_names, new_names;
  std::vector<bool> out_of_view;  // by old cluster
  std::vector<Grades> grades;
  IdentityBelief belief;
  Resolution resolution;
  std::optional<Resolution> truth;
};

// The grades of the pairs as the evidence has them, by predicate.
std::vector<StepPicture::Grades> grades_of(const SceneObservation& observation, const EvidenceMapping& mapping,
                                           std::size_t olds, std::size_t news);

// Two scenes as they are believed to belong together.
StepPicture picture_of(const Scene& before, const Scene& now, const EvidenceMapping& mapping,
                       const IdentityBelief& belief);

// S, M or V; nothing where they are no pair.
std::optional<char> pair_mark(const Resolution& resolution, std::size_t o, std::size_t n);
// H or D; nothing where it has a partner.
std::optional<char> old_mark(const Resolution& resolution, std::size_t o);

std::string step_svg(const StepPicture& step);
std::string step_html(std::span<const StepPicture> steps);

}  // namespace sherlog
