#include "perception_bridge/concepts.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace sherlog {
namespace {

using testing::ElementsAre;

TEST(Concepts, NamesStandBelowOthersAndCirclesAreHarmless) {
  std::string problem;
  const auto concepts = parse_concepts(
      R"({"concepts":{"Milk":["Weihenstephan"],"drink":["milk","Tea"],"tea":["drink"]},"belongs":{"milk":"fridge"}})",
      problem);
  ASSERT_TRUE(concepts) << problem;
  EXPECT_THAT(names_of(*concepts, "drink"), ElementsAre("drink", "milk", "Tea", "Weihenstephan"));
  EXPECT_THAT(names_of(*concepts, "cup"), ElementsAre("cup"));
  EXPECT_EQ(place_for(*concepts, "weihenstephan"), "fridge");
  EXPECT_EQ(place_for(*concepts, "Tea"), std::nullopt);
  for (const char* bad :
       {"[]", R"({"concepts":[]})", R"({"concepts":{"a":[1]}})", R"({"belongs":{"a":1}})", R"({"x":1})", "{"}) {
    EXPECT_FALSE(parse_concepts(bad, problem)) << bad;
    EXPECT_NE(problem, "");
  }
}

}  // namespace
}  // namespace sherlog
