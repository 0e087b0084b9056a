#include "rtpm/rt/priority.hpp"

#include <gtest/gtest.h>

#include <optional>
#include <string>

#include "rtpm/test/child.hpp"
#include "rtpm/test/os.hpp"
#include "seen.hpp"

namespace rtpm::rt {
namespace {

using test::fifo;
using test::kTimeShared;
using test::scheduling_of_this_thread;

TEST(CurrentPriority, SetsTheThreadsFifoLevelIfAllowed) {
  if (!test::has_realtime_right()) GTEST_SKIP() << test::kNoRealtimeRight;
  on_a_thread([] {
    for (const int priority : {0, 20'000, 32'767, 20'000, 0}) {
      EXPECT_TRUE(set_current_priority(priority));
      EXPECT_EQ(scheduling_of_this_thread(), fifo(to_native(priority)));
    }
  });
}

TEST(CurrentPriority, IsKeptForCallsIfTheSystemRefuses) {
  const test::ChildResult child = test::run_in_child([]() -> std::string {
    test::drop_realtime_rights();
    if (set_current_priority(20'000)) return "the system is said to have allowed it";
    if (current_priority() != Priority{20'000}) return "the priority is lost";
    if (scheduling_of_this_thread() != kTimeShared) return "the thread is not time-shared";
    return "";
  });
  EXPECT_EQ(child.said, "");
  EXPECT_EQ(child.status, 0);
  EXPECT_EQ(child.errors, "") << "the answer says it";
}

TEST(AdoptPriority, MovesAFifoThread) {
  if (!test::has_realtime_right()) GTEST_SKIP() << test::kNoRealtimeRight;
  on_a_thread([] {
    ASSERT_TRUE(set_current_priority(10'000));
    adopt_priority(30'000);
    EXPECT_EQ(current_priority(), Priority{30'000});
    EXPECT_EQ(scheduling_of_this_thread(), fifo(to_native(30'000)));
  });
}

TEST(AdoptPriority, LeavesATimeSharedThreadTimeShared) {
  on_a_thread([] {
    adopt_priority(30'000);
    EXPECT_EQ(current_priority(), Priority{30'000});
    EXPECT_EQ(scheduling_of_this_thread(), kTimeShared);
  });
}

TEST(PriorityMapping, SetsTheLevelsOfItsReplacement) {
  if (!test::has_realtime_right()) GTEST_SKIP() << test::kNoRealtimeRight;
  ASSERT_TRUE(set_priority_mapping([](Priority) { return 30; }));
  on_a_thread([] {
    EXPECT_TRUE(set_current_priority(11'000));
    EXPECT_EQ(scheduling_of_this_thread(), fifo(30));
  });
  ASSERT_TRUE(set_priority_mapping(nullptr));
}

}  // namespace
}  // namespace rtpm::rt
