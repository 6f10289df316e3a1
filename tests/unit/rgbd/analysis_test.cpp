// The structure that annotators share.
#include <gtest/gtest.h>

#include <atomic>
#include <map>
#include <numeric>
#include <thread>

#include "rgbd/pipeline/declared.h"
#include "rgbd/pipeline/run.h"

namespace sherlog::rgbd {
namespace {

using Names = std::vector<std::string>;

TEST(Analysis, GivesATypeWithThoseBelowItAndNothingElse) {
  Analysis analysis;
  for (const char* type :
       {"rs.annotation.Shape", "rs.annotation.ColorHistogram", "rs.annotation.HueSaturationHistogram"}) {
    analysis.annotate(1, make_annotation(type, type, {}));
  }
  EXPECT_EQ(analysis.annotations_of(1, "rs.annotation.ColorHistogram").size(), 2U);
  EXPECT_EQ(analysis.annotations_of(1, "rs.annotation.HueSaturationHistogram").size(), 1U);
  EXPECT_EQ(analysis.annotations_of(1, "rs.annotation.Shape").size(), 1U);
  EXPECT_TRUE(analysis.annotations_of(0, "rs.annotation.Shape").empty());
  EXPECT_EQ(analysis.clusters(), 2U);
}

TEST(Analysis, ViewsAreFoundUnderTheirTypeOnly) {
  Analysis analysis;
  analysis.set("number", 5);
  ASSERT_NE(analysis.view<int>("number"), nullptr);
  EXPECT_EQ(*analysis.view<int>("number"), 5);
  EXPECT_EQ(analysis.view<double>("number"), nullptr);
  EXPECT_THROW(analysis.need<int>("other"), std::runtime_error);
}

// Of which thread, and its how-manieth annotation (D1).
Annotation numbered(const char* type, std::size_t thread, std::size_t number) {
  return make_annotation(type, std::to_string(thread), {{"number", Value(static_cast<std::int64_t>(number))}});
}

// The numbers of each thread, in the order in which they are there.
std::map<std::string, std::vector<std::size_t>> numbers_by_thread(const std::vector<const Annotation*>& annotations) {
  std::map<std::string, std::vector<std::size_t>> numbers;
  for (const Annotation* annotation : annotations) {
    numbers[*annotation->source].push_back(static_cast<std::size_t>(*find(annotation->fields, "number")->number()));
  }
  return numbers;
}

std::vector<std::size_t> count_to(std::size_t end) {
  std::vector<std::size_t> numbers(end);
  std::iota(numbers.begin(), numbers.end(), std::size_t{0});
  return numbers;
}

TEST(Analysis, LosesNothingThatThreadsAddAtOnce) {
  constexpr std::size_t kThreads = 4, kEach = 25'000, kClusters = 10;
  Analysis analysis;
  std::atomic<std::size_t> adding = kThreads;
  {
    std::vector<std::jthread> threads;
    for (std::size_t thread = 0; thread < kThreads; ++thread) {
      threads.emplace_back([&, thread] {
        const char* type = thread % 2 == 0 ? "rs.annotation.Shape" : "rs.annotation.SemanticColor";
        for (std::size_t number = 0; number < kEach; ++number) {
          analysis.annotate(number % kClusters, numbered(type, thread, number / kClusters));
          if (number % 1000 == 0) analysis.set(std::to_string(thread) + " at " + std::to_string(number), number);
        }
        --adding;
      });
    }
    // Whoever reads meanwhile sees a part, and what is there stays.
    std::size_t before = 0;
    while (adding > 0) {
      const std::size_t now = analysis.annotations_of(0, "rs.annotation.Shape").size();
      EXPECT_GE(now, before);
      before = now;
      EXPECT_LE(Analysis(analysis).clusters(), kClusters);
    }
  }
  ASSERT_EQ(analysis.clusters(), kClusters);
  for (std::size_t cluster = 0; cluster < kClusters; ++cluster) {
    const auto all = numbers_by_thread(analysis.annotations(cluster));
    EXPECT_EQ(all.size(), kThreads);
    for (const auto& [thread, numbers] : all) EXPECT_EQ(numbers, count_to(kEach / kClusters)) << "thread " << thread;
    const auto shapes = numbers_by_thread(analysis.annotations_of(cluster, "rs.annotation.Shape"));
    EXPECT_EQ(shapes.size(), kThreads / 2);
    for (const auto& [thread, numbers] : shapes) EXPECT_EQ(numbers.size(), kEach / kClusters);
  }
  for (std::size_t thread = 0; thread < kThreads; ++thread) {
    for (std::size_t number = 0; number < kEach; number += 1000) {
      const auto* value = analysis.view<std::size_t>(std::to_string(thread) + " at " + std::to_string(number));
      ASSERT_NE(value, nullptr);
      EXPECT_EQ(*value, number);
    }
  }
}

// Shares out its work among threads of its own.
class ManyHands : public Declared {
 public:
  ManyHands(const char* type, std::size_t first_thread, std::size_t each)
      : Declared(type, {"depth"}, {type}, 1), type_(type), first_thread_(first_thread), each_(each) {}
  void process(const Analysis&, Analysis& out) override {
    std::vector<std::jthread> threads;
    for (std::size_t thread = first_thread_; thread < first_thread_ + kThreads; ++thread) {
      threads.emplace_back([&, thread] {
        for (std::size_t number = 0; number < each_; ++number) out.annotate(0, numbered(type_, thread, number));
      });
    }
  }
  static constexpr std::size_t kThreads = 2;

 private:
  const char* type_;
  std::size_t first_thread_, each_;
};

TEST(Analysis, LosesNothingOfTwoAnnotatorsThatRunAtOnce) {
  constexpr std::size_t kEach = 25'000;
  const char* objects = "rs.annotation.Shape";
  const char* people = "sherlog.annotation.Person";
  Annotators annotators;
  annotators.push_back(std::make_unique<ManyHands>(objects, 0, kEach));
  annotators.push_back(std::make_unique<ManyHands>(people, ManyHands::kThreads, kEach));
  std::string problem;
  const auto flow = plan_flow(annotators, Names{"depth"}, std::vector<Wanted>{{{objects}}, {{people}}}, problem);
  ASSERT_TRUE(flow) << problem;
  Analysis analysis;
  analysis.set("depth", 1);
  for (const AnnotatorRun& run : run_flow(annotators, *flow, analysis, 2)) EXPECT_EQ(run.problem, "");
  const auto all = numbers_by_thread(analysis.annotations(0));
  EXPECT_EQ(all.size(), 2 * ManyHands::kThreads);
  for (const auto& [thread, numbers] : all) EXPECT_EQ(numbers, count_to(kEach)) << "thread " << thread;
  EXPECT_EQ(analysis.annotations_of(0, objects).size(), ManyHands::kThreads * kEach);
  EXPECT_EQ(analysis.annotations_of(0, people).size(), ManyHands::kThreads * kEach);
}

}  // namespace
}  // namespace sherlog::rgbd
