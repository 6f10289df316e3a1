// A small concept file: which names mean a thing of a kind, and where things of a kind belong.
//
// Idea      A robot is asked for milk and has seen a "Weihenstephan_Milk" on "counter_top_island_link". The file says which
//           words stand below which; that is all that is needed to answer "is there milk on the table?".
//             {"concepts": {"milk": ["Weihenstephan_Milk"], "drink": ["milk", "Cup"], "table": ["counter_top_island_link"]},
//              "belongs": {"milk": "fridge"}}
// Input     JSON; upper and lower case are one. A word may stand below several, and below itself: that is harmless.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace sherlog {

struct Concepts {
  std::map<std::string, std::vector<std::string>> members;  // by the name in lower case; as written
  std::map<std::string, std::string> belongs;
};

std::optional<Concepts> parse_concepts(std::string_view text, std::string& problem);

// The name itself, then everything below it, each once.
std::vector<std::string> names_of(const Concepts& concepts, std::string_view name);

// Where a thing of that name belongs: said of it or of the nearest concept above it.
std::optional<std::string> place_for(const Concepts& concepts, std::string_view name);

}  // namespace sherlog
