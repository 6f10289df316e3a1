#include "learning/conditional_counts.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "inference/world.h"
#include "learning/observed_network.h"

namespace sherlog {
namespace {

std::uint64_t mix(std::uint64_t h, std::uint64_t value) {
  h = (h ^ value) * 0x9e3779b97f4a7c15ULL;
  return h ^ (h >> 29);
}

// The observed world with atoms flipped one at a time: which counts change, and how many demands are broken.
class Flipper {
 public:
  Flipper(const ObservedNetwork& observed, std::size_t weight_count)
      : network_(observed.network), index_(observed.network), delta_(weight_count, 0.0), seen_(weight_count, 0) {
    list_features(observed);
    list_truth(observed);
  }

  // Changes the atom's truth and adds the change of every count to the row in the making.
  void flip(std::uint32_t atom) { flip_node(atom); }
  bool allowed() const { return broken_ == 0; }

  // The row in the making: the counts as they are now minus the counts when it was last cleared.
  void take_row(std::vector<std::uint32_t>& columns, std::vector<double>& counts) {
    columns.clear();
    counts.clear();
    std::ranges::sort(touched_);
    for (const std::uint32_t weight : touched_) {
      if (delta_[weight] == 0.0) continue;
      columns.push_back(weight);
      counts.push_back(delta_[weight]);
    }
  }
  void clear_row() {
    for (const std::uint32_t weight : touched_) delta_[weight] = 0.0, seen_[weight] = 0;
    touched_.clear();
  }

 private:
  struct NodeFeature {
    std::uint32_t weight;
    double count;  // negative where the ground formula is the negation of the node
  };

  void list_features(const ObservedNetwork& observed) {
    feature_start_.assign(index_.node_count() + 1, 0);
    for (const Feature& feature : network_.features()) {
      if (feature.weight_id != kVirtualEvidence) ++feature_start_[index_.node(feature.literal) + 1];
    }
    for (std::size_t n = 0; n < index_.node_count(); ++n) feature_start_[n + 1] += feature_start_[n];
    features_.resize(feature_start_.back());
    std::vector<std::uint32_t> next(feature_start_.begin(), feature_start_.end() - 1);
    for (const Feature& feature : network_.features()) {
      if (feature.weight_id == kVirtualEvidence) continue;
      const double sign = feature.turned ? -1.0 : 1.0;
      features_[next[index_.node(feature.literal)]++] = {observed.weight_of[feature.weight_id.index()],
                                                         sign * feature.count};
    }
  }

  void list_truth(const ObservedNetwork& observed) {
    truth_.assign(index_.node_count(), 0);
    true_inputs_.assign(network_.gate_count(), 0);
    for (std::size_t v = 0; v < observed.values.size(); ++v) {
      if (observed.values[v] < network_.candidate_count(VariableId(v))) {
        truth_[network_.first_atom(VariableId(v)).index() + observed.values[v]] = 1;
      }
    }
    for (std::uint32_t g = 0; g < network_.gate_count(); ++g) {
      for (const Literal input : network_.gate_inputs(GateId(g))) {
        true_inputs_[g] += (truth_[index_.node(input)] != 0) != input.negated() ? 1u : 0u;
      }
      truth_[index_.gate_node(g)] = gate_truth(network_.gate_kind(GateId(g)), true_inputs_[g]) ? 1 : 0;
    }
  }

  bool met(std::uint32_t node) const {
    const std::int8_t demand = index_.demand(node);
    if (demand == 0) return true;
    return demand != WorldIndex::kImpossibleDemand && (demand > 0) == (truth_[node] != 0);
  }

  void flip_node(std::uint32_t node) {
    const bool was_met = met(node);
    truth_[node] ^= 1;
    const bool now = truth_[node] != 0;
    if (met(node) != was_met) broken_ += was_met ? 1 : -1;
    for (std::uint32_t f = feature_start_[node]; f < feature_start_[node + 1]; ++f) {
      const NodeFeature& feature = features_[f];
      if (seen_[feature.weight] == 0) {
        seen_[feature.weight] = 1;
        touched_.push_back(feature.weight);
      }
      delta_[feature.weight] += now ? feature.count : -feature.count;
    }
    for (const WorldIndex::Use& use : index_.uses(node)) {
      true_inputs_[use.gate] += now != use.negated ? 1u : ~0u;
      const std::uint32_t above = index_.gate_node(use.gate);
      const bool truth = gate_truth(network_.gate_kind(GateId(use.gate)), true_inputs_[use.gate]);
      if (truth != (truth_[above] != 0)) flip_node(above);
    }
  }

  const GroundNetwork& network_;
  WorldIndex index_;
  std::vector<std::uint32_t> feature_start_;
  std::vector<NodeFeature> features_;
  std::vector<std::uint8_t> truth_;         // by node
  std::vector<std::uint32_t> true_inputs_;  // by gate
  std::int64_t broken_ = 0;                 // demands; the observed world breaks none
  std::vector<double> delta_;               // by weight
  std::vector<std::uint8_t> seen_;
  std::vector<std::uint32_t> touched_;
};

class Extraction {
 public:
  Extraction(const ObservedNetwork& observed, std::size_t weight_count, ConditionalCounts& counts)
      : observed_(observed), network_(observed.network), flipper_(observed, weight_count), counts_(counts) {}

  void add(std::span<const std::uint32_t> variables) {
    std::vector<std::uint32_t> values(variables.size(), 0), start;
    for (const std::uint32_t v : variables) {
      start.push_back(observed_.values[v]);
      flip(v, observed_.values[v]);
    }
    flipper_.clear_row();
    counts_.begin_group();
    add_values(variables, 0, values, start);
    counts_.end_group();
    flipper_.clear_row();
    for (const std::uint32_t v : variables) flip(v, observed_.values[v]);
    flipper_.clear_row();
  }

 private:
  // All joint values, the counts kept as differences to "every one of them none".
  void add_values(std::span<const std::uint32_t> variables, std::size_t depth, std::vector<std::uint32_t>& values,
                  const std::vector<std::uint32_t>& observed) {
    if (depth == variables.size()) {
      if (!flipper_.allowed()) return;
      flipper_.take_row(columns_, row_);
      counts_.add_row(columns_, row_, values == observed);
      return;
    }
    const std::uint32_t v = variables[depth];
    for (std::uint32_t value = 0; value < network_.value_count(VariableId(v)); ++value) {
      values[depth] = value;
      flip(v, value);
      add_values(variables, depth + 1, values, observed);
      flip(v, value);
      if (variables.size() == 1) flipper_.clear_row();
    }
  }

  // Turns the value's atom on or off; "none" has no atom.
  void flip(std::uint32_t variable, std::uint32_t value) {
    if (value < network_.candidate_count(VariableId(variable))) {
      flipper_.flip(network_.first_atom(VariableId(variable)).value + value);
    }
  }

  const ObservedNetwork& observed_;
  const GroundNetwork& network_;
  Flipper flipper_;
  ConditionalCounts& counts_;
  std::vector<std::uint32_t> columns_;
  std::vector<double> row_;
};

}  // namespace

void ConditionalCounts::begin_group() {
  open_ = Group{};
  open_.first_row = static_cast<std::uint32_t>(row_count());
}

void ConditionalCounts::add_row(std::span<const std::uint32_t> columns, std::span<const double> counts, bool observed) {
  if (columns.empty()) {
    ++open_.zero_values;
    return;
  }
  if (observed) open_.observed = open_.row_count;
  ++open_.row_count;
  column_.insert(column_.end(), columns.begin(), columns.end());
  count_.insert(count_.end(), counts.begin(), counts.end());
  row_start_.push_back(column_.size());
}

void ConditionalCounts::end_group(double multiplicity) {
  variables_ += multiplicity;
  open_.multiplicity = multiplicity;
  if (open_.row_count == 0) {
    constant_ -= multiplicity * std::log(std::max(1u, open_.zero_values));
    return;
  }
  if ((groups_.size() + 1) * 2 > table_.size()) grow_table();
  const std::uint64_t h = hash(open_);
  const std::size_t mask = table_.size() - 1;
  std::size_t slot = h & mask;
  for (; table_[slot] != 0; slot = (slot + 1) & mask) {
    const std::uint32_t other = table_[slot] - 1;
    if (group_hash_[other] != h || !same(groups_[other], open_)) continue;
    groups_[other].multiplicity += multiplicity;
    row_start_.resize(open_.first_row + 1);
    column_.resize(row_start_.back());
    count_.resize(row_start_.back());
    return;
  }
  groups_.push_back(open_);
  group_hash_.push_back(h);
  table_[slot] = static_cast<std::uint32_t>(groups_.size());
}

void ConditionalCounts::add_free(double variables, double log_values) {
  variables_ += variables;
  constant_ -= log_values;
}

void ConditionalCounts::merge(const ConditionalCounts& other) {
  for (const Group& group : other.groups_) {
    begin_group();
    open_.zero_values = group.zero_values;
    for (std::uint32_t r = 0; r < group.row_count; ++r) {
      add_row(other.columns(group.first_row + r), other.counts(group.first_row + r), r == group.observed);
    }
    end_group(group.multiplicity);
    variables_ -= group.multiplicity;  // counted below, with the free ones
  }
  variables_ += other.variables_;
  constant_ += other.constant_;
}

std::size_t ConditionalCounts::memory_bytes() const {
  return row_start_.capacity() * 8 + column_.capacity() * 4 + count_.capacity() * 8 +
         groups_.capacity() * sizeof(Group) + group_hash_.capacity() * 8 + table_.capacity() * 4;
}

bool ConditionalCounts::same(const Group& a, const Group& b) const {
  if (a.row_count != b.row_count || a.observed != b.observed || a.zero_values != b.zero_values) return false;
  for (std::uint32_t r = 0; r < a.row_count; ++r) {
    if (!std::ranges::equal(columns(a.first_row + r), columns(b.first_row + r)) ||
        !std::ranges::equal(counts(a.first_row + r), counts(b.first_row + r))) {
      return false;
    }
  }
  return true;
}

std::uint64_t ConditionalCounts::hash(const Group& group) const {
  std::uint64_t h = mix(mix(group.row_count, group.observed), group.zero_values);
  for (std::uint32_t r = 0; r < group.row_count; ++r) {
    const auto row = columns(group.first_row + r);
    const auto values = counts(group.first_row + r);
    h = mix(h, row.size());
    for (std::size_t i = 0; i < row.size(); ++i) h = mix(mix(h, row[i]), std::bit_cast<std::uint64_t>(values[i]));
  }
  return h;
}

void ConditionalCounts::grow_table() {
  table_.assign(std::max<std::size_t>(64, table_.size() * 2), 0);
  const std::size_t mask = table_.size() - 1;
  for (std::size_t g = 0; g < groups_.size(); ++g) {
    std::size_t slot = group_hash_[g] & mask;
    while (table_[slot] != 0) slot = (slot + 1) & mask;
    table_[slot] = static_cast<std::uint32_t>(g + 1);
  }
}

bool add_conditional_counts(const ObservedNetwork& observed, std::size_t weight_count,
                            const std::vector<std::vector<std::uint32_t>>& blocks, ConditionalCounts& counts,
                            double max_joint) {
  const GroundNetwork& network = observed.network;
  Extraction extraction(observed, weight_count, counts);
  std::vector<bool> done(network.variable_count(), false);
  for (const auto& block : blocks) {
    double joint = 1.0;
    for (const std::uint32_t v : block) {
      joint *= network.value_count(VariableId(v));
      done[v] = true;
    }
    if (joint > max_joint) return false;
    extraction.add(block);
  }
  for (std::uint32_t v = 0; v < network.variable_count(); ++v) {
    if (!done[v]) extraction.add({&v, 1});
  }
  return true;
}

}  // namespace sherlog
