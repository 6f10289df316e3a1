// How often each formula would be true if one variable had another value: all that pseudo-likelihood asks of the data.
//
// Idea      For a variable x with values v, observed at v*, and everything else as observed, let n(v) be the vector of
//           true groundings by weight. Only differences between the values of one variable matter, so each row is taken
//           relative to "none" (all its atoms false), which leaves most entries zero. Variables whose rows agree are one
//           group with a multiplicity: large databases have few distinct ones.
// Shapes    Rows are sparse (column = weight); the rows of a group are consecutive. Values whose row is all zero are only
//           counted. A value that a hard formula forbids has no row.
// Term      of a group, in nats:  multiplicity * (s(v*) - log(zero_values + sum over rows of exp(s)))  with s = row . w,
//           and s = 0 for the zero rows.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace sherlog {

struct ObservedNetwork;

class ConditionalCounts {
 public:
  static constexpr std::uint32_t kZeroRow = 0xffffffffu;

  struct Group {
    std::uint32_t first_row = 0, row_count = 0;
    std::uint32_t observed = kZeroRow;  // row, counted from first_row
    std::uint32_t zero_values = 0;      // values with a zero row, the observed one included where it is one
    double multiplicity = 1.0;
  };

  std::span<const Group> groups() const { return groups_; }
  std::size_t row_count() const { return row_start_.size() - 1; }
  std::span<const std::uint32_t> columns(std::size_t row) const {
    return {column_.data() + row_start_[row], column_.data() + row_start_[row + 1]};
  }
  std::span<const double> counts(std::size_t row) const {
    return {count_.data() + row_start_[row], count_.data() + row_start_[row + 1]};
  }
  std::size_t entry_count() const { return column_.size(); }
  // Sum of -log(values) over the variables that no count depends on.
  double constant() const { return constant_; }
  double variable_count() const { return variables_; }

  // A group is made row by row: columns ascending, counts not zero.
  void begin_group();
  void add_row(std::span<const std::uint32_t> columns, std::span<const double> counts, bool observed);
  void end_group(double multiplicity = 1.0);
  // Variables with `values` values each that nothing depends on.
  void add_free(double variables, double log_values);
  // Takes over all groups of another.
  void merge(const ConditionalCounts& other);
  std::size_t memory_bytes() const;

 private:
  bool same(const Group& a, const Group& b) const;
  std::uint64_t hash(const Group& group) const;
  void grow_table();

  std::vector<std::uint64_t> row_start_{0};
  std::vector<std::uint32_t> column_;
  std::vector<double> count_;
  std::vector<Group> groups_;
  std::vector<std::uint64_t> group_hash_;
  std::vector<std::uint32_t> table_;  // open addressing: group + 1, or 0
  Group open_;                        // the group in the making
  double constant_ = 0.0, variables_ = 0.0;
};

// Adds the variables of one network. `blocks`: variables that are one joint variable (each with two or more; none twice);
// all others stand alone. `weight_count`: columns. False where a block has more than `max_joint` joint values.
// Cost: O(values x features touched).
bool add_conditional_counts(const ObservedNetwork& observed, std::size_t weight_count,
                            const std::vector<std::vector<std::uint32_t>>& blocks, ConditionalCounts& counts,
                            double max_joint = 1 << 16);

}  // namespace sherlog
