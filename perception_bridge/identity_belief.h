// What is believed about one step of identity resolution, and the one explanation of the scene that follows from it.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "mln/monitor.h"
#include "perception_bridge/four_tables.h"

namespace sherlog {

// Probabilities. What is missing to 1 in a row or column is that of the cluster being alone: appeared; disappeared or hidden. Where
// a model says itself what has appeared, disappeared or is hidden, that counts.
class IdentityBelief {
 public:
  IdentityBelief() = default;
  IdentityBelief(std::size_t old_clusters, std::size_t new_clusters)
      : old_(old_clusters), new_(new_clusters), pairs_(old_clusters * new_clusters) {}

  std::size_t old_clusters() const { return old_; }
  std::size_t new_clusters() const { return new_; }
  // Of kStay, kMove, kNewview, in this order: they are the same object, and this has happened to it.
  std::array<double, 3>& pair(std::size_t o, std::size_t n) { return pairs_[o * new_ + n]; }
  const std::array<double, 3>& pair(std::size_t o, std::size_t n) const { return pairs_[o * new_ + n]; }
  double same(std::size_t o, std::size_t n) const { return pair(o, n)[0] + pair(o, n)[1] + pair(o, n)[2]; }
  double appeared(std::size_t n) const;
  void set_appeared(std::size_t n, double probability) { alone_at(appeared_, new_, n) = probability; }
  void set_disappeared(std::size_t o, double probability) { alone_at(disappeared_, old_, o) = probability; }
  void set_hidden(std::size_t o, double probability) { alone_at(hidden_, old_, o) = probability; }
  // What an old cluster that is none of the new ones is: the more probable of the two, the view decides where they are equal.
  ClusterExplanation unseen(std::size_t o, bool out_of_view) const;

 private:
  static double& alone_at(std::vector<double>& of, std::size_t count, std::size_t i) {
    if (of.empty()) of.assign(count, -1);
    return of[i];
  }

  std::size_t old_ = 0, new_ = 0;
  std::vector<std::array<double, 3>> pairs_;
  std::vector<double> appeared_, disappeared_, hidden_;  // empty, or negative: not stated
};

// The matching with the largest expected number of new clusters that it associates rightly, and the most probable explanation
// of each of its pairs. `out_of_view` by old cluster.
Resolution decide(const IdentityBelief& belief, const std::vector<bool>& out_of_view);
Resolution decide(const IdentityBelief& belief, const FourTablesTrial& trial);

// A way to tell who is who in one trial. It reads the observations and the view of a trial, never its truth or actions.
struct MatcherAnswer {
  Resolution resolution;
  Termination termination = Termination::kCompleted;
  std::string message;   // where not completed
  double seconds = 0.0;  // from observations to belief
};

class Matcher {
 public:
  virtual ~Matcher() = default;
  virtual std::string name() const = 0;
  // Called from several threads at a time.
  virtual MatcherAnswer resolve(const FourTablesTrial& trial) const = 0;
};

}  // namespace sherlog
