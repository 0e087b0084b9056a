#include "laboratory/plan.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

// The order in which a laboratory's programs start.
namespace rtpm::laboratory {
namespace {

using Indices = std::vector<std::size_t>;

std::vector<ProgramPlan> programs_after(const std::vector<Indices>& after) {
  std::vector<ProgramPlan> programs(after.size());
  for (std::size_t i = 0; i < after.size(); ++i)
    programs[i].after = after[i];
  return programs;
}

Indices order_of(const std::vector<Indices>& after) {
  Indices cycle;
  return start_order(programs_after(after), cycle);
}

TEST(Order, IsTheFilesUnlessAProgramComesAfterALaterOne) {
  EXPECT_EQ(order_of({{}, {}, {}}), (Indices{0, 1, 2}));
  EXPECT_EQ(order_of({{2}, {}, {}}), (Indices{1, 2, 0}));
  EXPECT_EQ(order_of({{1}, {2}, {}}), (Indices{2, 1, 0}));
  EXPECT_EQ(order_of({}), Indices{});
}

TEST(Order, NamesTheProgramsOfACycleOnly) {
  Indices cycle;
  EXPECT_TRUE(start_order(programs_after({{1}, {2}, {1}, {}}), cycle).empty());
  std::ranges::sort(cycle);
  EXPECT_EQ(cycle, (Indices{1, 2}));
}

TEST(Order, PutsEveryProgramBehindThoseItComesAfter) {
  std::mt19937 random(1);
  for (int turn = 0; turn < 200; ++turn) {
    // Each program depends on later programs only, so that there is no cycle.
    std::vector<Indices> after(8);
    for (std::size_t i = 0; i < after.size(); ++i) {
      for (std::size_t other = i + 1; other < after.size(); ++other) {
        if (random() % 3 == 0) after[i].push_back(other);
      }
    }
    const Indices order = order_of(after);
    ASSERT_EQ(order.size(), after.size());
    for (std::size_t i = 0; i < after.size(); ++i) {
      for (const std::size_t other : after[i])
        EXPECT_LT(std::ranges::find(order, other), std::ranges::find(order, i));
    }
  }
}

TEST(Order, IsKnownThroughOtherPrograms) {
  const auto programs = programs_after({{}, {0}, {1}, {}});
  EXPECT_TRUE(comes_after(programs, 2, 0));
  EXPECT_FALSE(comes_after(programs, 0, 2));
  EXPECT_FALSE(comes_after(programs, 3, 0));
}

}  // namespace
}  // namespace rtpm::laboratory
