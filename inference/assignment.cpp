#include "inference/assignment.h"

#include <algorithm>
#include <limits>

namespace sherlog {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr std::size_t kNobody = static_cast<std::size_t>(-1);

// Columns 0..columns-1 are real, columns + r is row r's own.
class ShortestPaths {
 public:
  ShortestPaths(std::span<const double> gains, std::size_t rows, std::size_t columns)
      : gains_(gains),
        rows_(rows),
        columns_(columns),
        row_potential_(rows, 0.0),
        column_potential_(columns + rows, 0.0),
        row_of_(columns + rows, kNobody) {}

  Assignment run() {
    for (std::size_t row = 0; row < rows_; ++row) add(row);
    Assignment out;
    out.column_of.resize(rows_);
    for (std::size_t c = 0; c < columns_; ++c) {
      if (row_of_[c] == kNobody) continue;
      out.column_of[row_of_[c]] = static_cast<std::uint32_t>(c);
      out.gain += gains_[row_of_[c] * columns_ + c];
    }
    // Here costs are minus the gains: row + column potential <= cost. Column potentials are at most 0, and so are those of
    // rows, since each row's own column costs nothing.
    for (double p : row_potential_) out.row_potential.push_back(std::max(0.0, -p));
    for (std::size_t c = 0; c < columns_; ++c) out.column_potential.push_back(std::max(0.0, -column_potential_[c]));
    return out;
  }

 private:
  double cost(std::size_t row, std::size_t column) const {
    if (column < columns_) return -gains_[row * columns_ + column];
    return column - columns_ == row ? 0.0 : kInfinity;
  }

  void add(std::size_t first_row) {
    const std::size_t all = columns_ + rows_;
    std::vector<double> distance(all, kInfinity);
    std::vector<std::size_t> before(all, kNobody);  // the column before on the path; kNobody: the new row itself
    std::vector<bool> done(all, false);
    std::vector<std::size_t> order;  // columns done, each with a row
    std::size_t row = first_row, via = kNobody, end = kNobody;
    double so_far = 0;
    while (end == kNobody) {
      std::size_t nearest = kNobody;
      for (std::size_t c = 0; c < all; ++c) {
        if (done[c]) continue;
        const double through = so_far + cost(row, c) - row_potential_[row] - column_potential_[c];
        if (through < distance[c]) {
          distance[c] = through;
          before[c] = via;
        }
        if (nearest == kNobody || distance[c] < distance[nearest]) nearest = c;
      }
      done[nearest] = true;
      so_far = distance[nearest];
      if (row_of_[nearest] == kNobody) {
        end = nearest;
      } else {
        order.push_back(nearest);
        row = row_of_[nearest];
        via = nearest;
      }
    }
    row_potential_[first_row] += so_far;
    for (std::size_t c : order) {
      row_potential_[row_of_[c]] += so_far - distance[c];
      column_potential_[c] -= so_far - distance[c];
    }
    for (std::size_t c = end;;) {
      const std::size_t previous = before[c];
      if (previous == kNobody) {
        row_of_[c] = first_row;
        break;
      }
      row_of_[c] = row_of_[previous];
      c = previous;
    }
  }

  std::span<const double> gains_;
  std::size_t rows_, columns_;
  std::vector<double> row_potential_, column_potential_;
  std::vector<std::size_t> row_of_;  // by column
};

}  // namespace

Assignment best_assignment(std::span<const double> gains, std::size_t rows, std::size_t columns) {
  return ShortestPaths(gains, rows, columns).run();
}

}  // namespace sherlog
