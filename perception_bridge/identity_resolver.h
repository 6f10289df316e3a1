// Object identity resolution by a Markov logic model: observations to evidence, the engine's answer to a belief.
//
// Idea      Each pair of an old and a new cluster gets a grade of how similar they look and one of how close their places are;
//           the model says what follows from them. With Grading::kPaper the grades are the paper's similarity g of the
//           distances. With kOdds a grade is s / (1 - s) = (likelihood of the two measurements if they are of the same thing) /
//           (likelihood if of any two): Gaussian differences with the sensor's sigma against a uniform density. Then a
//           model with weights for what can happen computes the posterior of a calibrated sensor.
// Model     declares similar(old, new), proximity(old, new), outOfView(old) and is(old, new, explanations!), appear(new),
//           disappear(old), hidden(old), as Table 1 has them; further predicates are open. Where it declares
//           seesPlace(old), that is graded too: whether the old place, which is known with an error, lies in the view.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "inference/inference.h"
#include "mln/model.h"
#include "perception_bridge/identity_belief.h"

namespace sherlog {

struct Grading {
  enum class Kind : std::uint8_t { kPaper, kGaussian, kOdds };
  Kind kind = Kind::kPaper;
  double sigma_color = 0.25;     // of g (kPaper, kGaussian), or of the sensor (kOdds)
  double sigma_position = 0.25;  // metres
};
std::string validate(const Grading& grading);

struct PairGrade {
  double similar = 0.5, proximity = 0.5;  // within [1e-9, 1 - 1e-9]: the model's rules cannot be broken by evidence
};
PairGrade grade_pair(const Observation& old, const Observation& now, const FourTablesTrial& trial,
                     const Grading& grading);
// Probability that the place of an old cluster lies in the view.
double sees_place(const Observation& old, const View& view, const FourTablesConfig& config, double sigma);

// The database of one step: clusters are O1, O2, ... and N1, N2, ...
std::string identity_evidence(const FourTablesTrial& trial, const Grading& grading, bool with_sees_place);

class IdentityResolver : public Matcher {
 public:
  // Nothing, and a sentence in `problem`, where the model lacks what it must declare. `name`: for reports.
  static std::unique_ptr<IdentityResolver> make(std::string name, Model model, const Grading& grading,
                                                InferenceOptions options, std::string& problem);
  ~IdentityResolver() override;

  std::string name() const override;
  MatcherAnswer resolve(const FourTablesTrial& trial) const override;

  struct Belief {
    IdentityBelief belief;
    Termination termination = Termination::kCompleted;
    std::string message;
    std::string method;
    double evidence_seconds = 0, ground_seconds = 0, infer_seconds = 0;
  };
  Belief believe(const FourTablesTrial& trial) const;
  // Old x new, row by row, as the evidence has them.
  std::vector<PairGrade> grades(const FourTablesTrial& trial) const;

 private:
  struct Parts;
  explicit IdentityResolver(std::unique_ptr<Parts> parts);
  std::unique_ptr<Parts> parts_;
};

}  // namespace sherlog
