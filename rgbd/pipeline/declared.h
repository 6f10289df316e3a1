// What most annotators have: a name, what they read and write, how long they take; and how their annotations are made.
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "rgbd/pipeline/flow.h"

namespace sherlog::rgbd {

// To so many parts of one: 0.9059 and not 0.90590000000000004.
inline double rounded(double value, double parts) { return std::round(value * parts) / parts; }

inline Value rounded_numbers(const Eigen::Ref<const Eigen::VectorXd>& values, double parts = 1e6) {
  std::vector<double> numbers(static_cast<std::size_t>(values.size()));
  for (Eigen::Index i = 0; i < values.size(); ++i) numbers[static_cast<std::size_t>(i)] = rounded(values[i], parts);
  return number_list(numbers);
}

class Declared : public Annotator {
 public:
  using Names = std::vector<std::string>;

  Declared(std::string name, Names reads, Names writes, double cost)
      : name_(std::move(name)), reads_(std::move(reads)), writes_(std::move(writes)), cost_(cost) {}
  std::string name() const override { return name_; }
  Names reads() const override { return reads_; }
  Names writes() const override { return writes_; }
  double cost() const override { return cost_; }
  Names written_values(const std::string& type) const override { return find_or_none(written_values_, type); }

 protected:
  // The texts of a type that it writes, when it can say them.
  void set_written_values(const std::string& type, Names values) { written_values_[type] = std::move(values); }
  static Names find_or_none(const std::map<std::string, Names>& values, const std::string& type) {
    const auto found = values.find(type);
    return found == values.end() ? Names() : found->second;
  }

  Annotation make(const char* type, Value::Object fields, std::optional<double> confidence = {}) const {
    if (confidence) confidence = rounded(*confidence, 1e4);
    return make_annotation(type, name_, std::move(fields), confidence);
  }

 private:
  std::string name_;
  Names reads_, writes_;
  std::map<std::string, Names> written_values_;
  double cost_;
};

}  // namespace sherlog::rgbd
