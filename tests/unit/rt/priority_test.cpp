#include "rtpm/rt/priority.hpp"

#include <gtest/gtest.h>

#include <optional>
#include <string>
#include <utility>

#include "seen.hpp"

namespace rtpm::rt {
namespace {

TEST(PriorityMapping, IsLinearFrom1To89RoundedDown) {
  for (const auto& [priority, level] : {std::pair{0, 1},
                                        {1, 1},
                                        {372, 1},
                                        {373, 2},
                                        {16383, 44},
                                        {16384, 45},
                                        {32394, 87},
                                        {32395, 88},
                                        {32766, 88},
                                        {32767, 89}}) {
    EXPECT_EQ(to_native(priority), level) << priority;
  }
}

TEST(PriorityMapping, IsMonotonicAndLeavesTheTopLevelsToTheKernel) {
  int previous = to_native(0);
  for (int priority = 0; priority <= Priority::kHighest; ++priority) {
    const int level = to_native(priority);
    ASSERT_GE(level, previous);
    ASSERT_LE(level - previous, 1) << "no level is left out, at " << priority;
    ASSERT_GE(level, 1);
    ASSERT_LE(level, 89);
    previous = level;
  }
}

TEST(CurrentPriority, IsAbsentUntilItIsSet) {
  on_a_thread([] {
    EXPECT_EQ(current_priority(), std::nullopt);
    static_cast<void>(set_current_priority(100));
    EXPECT_EQ(current_priority(), Priority{100});
  });
  on_a_thread([] { EXPECT_EQ(current_priority(), std::nullopt) << "each thread has its own"; });
}

TEST(PriorityMapping, CanBeReplaced) {
  EXPECT_EQ(level_of(32'767), to_native(32'767));
  const auto three_levels = [](Priority priority) { return 10 + priority.value() / 10'923 * 20; };
  ASSERT_TRUE(set_priority_mapping(three_levels));
  EXPECT_EQ(level_of(0), 10);
  EXPECT_EQ(level_of(11'000), 30);
  EXPECT_EQ(level_of(32'767), 50);
  ASSERT_TRUE(set_priority_mapping(nullptr));
  EXPECT_EQ(level_of(11'000), to_native(11'000));
}

TEST(PriorityMapping, IsRefusedIfALevelIsInvalid) {
  const auto text_of = [](PriorityMapping mapping) {
    const auto set = set_priority_mapping(mapping);
    return set ? std::string() : set.error().text();
  };
  EXPECT_NE(text_of([](Priority) { return 99; }).find("priority 0 level 99"), std::string::npos);
  EXPECT_NE(text_of([](Priority) { return 0; }).find("level 0"), std::string::npos);
  const std::string falls =
      text_of([](Priority priority) { return priority.value() < 7 ? 50 : 49; });
  EXPECT_NE(falls.find("priority 7 level 49"), std::string::npos) << falls;
  EXPECT_NE(falls.find("Remedy"), std::string::npos);
  EXPECT_EQ(level_of(7), to_native(7)) << "as it was";
}

}  // namespace
}  // namespace rtpm::rt
