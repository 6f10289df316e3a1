// The symbolic half of variable elimination: which table goes where, and how to walk through it.
//
// Idea      Every variable has a bucket. A table goes to the bucket of whichever of its variables is eliminated first.
//           The bucket joins its tables and the messages it got, removes its variable and sends what is left to the
//           bucket of the next variable in there. All of this depends on shapes alone and is laid out once.
// Source    Dechter, Artificial Intelligence 113, 1999.
// Cost      O(sum of the joined tables' variables x inputs); numbers are up to elimination.h and elimination_plan.h.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace sherlog {

class BucketTree {
 public:
  static constexpr double kMaxJoinedLog2 = 31.0;

  // How a smaller table is walked while a joined table is walked in order: nested loops, outermost first, neighbours
  // fused.
  struct Loop {
    std::uint32_t count = 1;
    std::uint32_t stride = 0;
  };
  struct Coordinate {
    std::uint32_t variable;
    std::uint32_t stride;
  };
  struct Input {
    bool is_message = false;
    std::uint32_t index = 0;  // of the table, or of the bucket that sends
    std::uint32_t loop_begin = 0, loop_end = 0;
    std::uint32_t own_stride = 0;                            // of the bucket's variable
    std::uint32_t coordinate_begin = 0, coordinate_end = 0;  // of the other variables
  };
  struct Bucket {
    std::uint32_t variable = 0;
    std::uint32_t cardinality = 1;
    std::uint32_t input_begin = 0, input_end = 0;
    std::uint64_t message_size = 1;  // joined table: message_size * cardinality, the bucket's variable runs fastest
  };

  BucketTree() = default;
  // Tables are dense, the last variable of a scope runs fastest. No scope is empty. `order` holds every
  // variable once. Joined tables must have fewer than 2^kMaxJoinedLog2 entries.
  BucketTree(std::span<const std::uint32_t> cardinalities, std::span<const std::vector<std::uint32_t>> scopes,
             std::span<const std::uint32_t> order);

  std::size_t variable_count() const { return cardinalities_.size(); }
  std::uint32_t cardinality(std::uint32_t variable) const { return cardinalities_[variable]; }
  std::span<const Bucket> buckets() const { return buckets_; }
  std::span<const Input> inputs(const Bucket& b) const {
    return {inputs_.data() + b.input_begin, b.input_end - b.input_begin};
  }
  std::span<const Loop> loops(const Input& i) const {
    return {loops_.data() + i.loop_begin, i.loop_end - i.loop_begin};
  }
  std::span<const Coordinate> coordinates(const Input& i) const {
    return {coordinates_.data() + i.coordinate_begin, i.coordinate_end - i.coordinate_begin};
  }
  std::span<const std::uint64_t> table_sizes() const { return table_sizes_; }
  std::uint64_t largest_joined() const { return largest_joined_; }
  std::uint64_t total_joined() const { return total_joined_; }      // entries of all joined tables
  std::uint64_t total_messages() const { return total_messages_; }  // entries of all messages

 private:
  void place_input(Bucket& bucket, const std::vector<std::uint32_t>& joined, std::span<const std::uint32_t> scope,
                   bool is_message, std::uint32_t index);

  std::vector<std::uint32_t> cardinalities_;
  std::vector<Bucket> buckets_;  // in elimination order
  std::vector<Input> inputs_;
  std::vector<Loop> loops_;
  std::vector<Coordinate> coordinates_;
  std::vector<std::uint64_t> table_sizes_;
  std::vector<std::uint32_t> stride_of_;  // scratch, by variable
  std::uint64_t largest_joined_ = 1, total_joined_ = 0, total_messages_ = 0;
};

}  // namespace sherlog
