#include "rtpm/rt/thread.hpp"

#include <gtest/gtest.h>

#include <string>
#include <thread>

#include "rtpm/rt/priority.hpp"
#include "rtpm/test/child.hpp"
#include "rtpm/test/os.hpp"
#include "rtpm/test/text.hpp"
#include "seen.hpp"

namespace rtpm::rt {
namespace {

using test::expect_text;
using test::fifo;
using test::kTimeShared;
using test::scheduling_of_this_thread;

TEST(Thread, RunsAtItsFifoLevelWhenItsBodyBegins) {
  if (!test::has_realtime_right()) GTEST_SKIP() << test::kNoRealtimeRight;
  for (const RealtimeMode mode : {RealtimeMode::kPrefer, RealtimeMode::kRequire}) {
    for (const int priority : {0, 16'000, 32'767}) {
      const Seen seen = seen_by({.name = "fifo", .priority = priority, .realtime = mode});
      EXPECT_EQ(seen.scheduling, fifo(to_native(priority)));
      EXPECT_EQ(seen.priority, Priority{priority});
    }
  }
}

TEST(Thread, DoesNotInheritItsStartersRealTimeLevel) {
  if (!test::has_realtime_right()) GTEST_SKIP() << test::kNoRealtimeRight;
  std::thread([] {
    ASSERT_TRUE(set_current_priority(20'000));
    EXPECT_EQ(seen_by({.name = "plain"}).scheduling, kTimeShared);
    EXPECT_EQ(seen_by({.name = "off", .priority = 100, .realtime = RealtimeMode::kOff}).scheduling,
              kTimeShared);
    EXPECT_EQ(scheduling_of_this_thread(), fifo(to_native(20'000)));
  }).join();
}

// The result for users without real-time rights. A separate process drops them.
TEST(ThreadWithoutTheRight, IsTimeSharedAndWarnsOnceWhenRealTimeIsPreferred) {
  const test::ChildResult child = test::run_in_child([]() -> std::string {
    test::drop_realtime_rights();
    for (int i = 0; i < 3; ++i) {
      Seen seen;
      auto thread = Thread::start({.name = "urgent", .priority = 20'000},
                                  [&] { seen = state_of_this_thread(); });
      if (!thread) return "not started: " + thread.error().text();
      thread->join();
      if (seen.scheduling != kTimeShared) return "not time-shared";
      if (seen.priority != Priority{20'000}) return "without its priority";
    }
    return "";
  });
  EXPECT_EQ(child.said, "");
  EXPECT_EQ(child.status, 0);
  EXPECT_EQ(child.errors.find("warning"), child.errors.rfind("warning")) << child.errors;
  expect_text(child.errors,
              {"warning", "'urgent'", "SCHED_FIFO 54", "Operation not permitted", "limit is 0",
               "Remedy", "limits.conf", "LimitRTPRIO", "CAP_SYS_NICE", "--realtime off"});
}

TEST(ThreadWithoutTheRight, IsNotStartedWhenRealTimeIsRequired) {
  const test::ChildResult child = test::run_in_child([]() -> std::string {
    test::drop_realtime_rights();
    bool has_run = false;
    const auto thread =
        Thread::start({.name = "strict", .priority = 32'767, .realtime = RealtimeMode::kRequire},
                      [&] { has_run = true; });
    if (thread) return "started";
    return has_run ? "run" : thread.error().text();
  });
  EXPECT_EQ(child.status, 0);
  EXPECT_EQ(child.errors, "") << "the error says it";
  expect_text(child.said, {"'strict'", "SCHED_FIFO 89", "Remedy", "LimitRTPRIO"});
}

TEST(ThreadWithoutTheRight, IsQuietWhenRealTimeIsOff) {
  const test::ChildResult child = test::run_in_child([]() -> std::string {
    test::drop_realtime_rights();
    const auto thread =
        Thread::start({.name = "off", .priority = 20'000, .realtime = RealtimeMode::kOff}, [] {});
    return thread ? "" : thread.error().text();
  });
  EXPECT_EQ(child.said, "");
  EXPECT_EQ(child.errors, "");
  EXPECT_EQ(child.status, 0);
}

}  // namespace
}  // namespace rtpm::rt
