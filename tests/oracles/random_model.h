// Small random models, databases and queries as text: everything that the languages can say, in odd combinations.
#pragma once

#include <random>
#include <string>
#include <vector>

namespace sherlog::oracle {

struct RandomModel {
  std::string model;
  std::string evidence;
  std::vector<std::string> queries;     // as after -q
  std::vector<std::string> open_world;  // predicate names
  bool open_world_all = false;
};

// The same seed gives the same texts.
RandomModel random_model(std::mt19937_64& random);

}  // namespace sherlog::oracle
