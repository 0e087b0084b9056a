#include "rtpm/rt/thread.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <string>
#include <thread>
#include <vector>

#include "rtpm/rt/priority.hpp"
#include "rtpm/test/child.hpp"
#include "rtpm/test/os.hpp"
#include "rtpm/test/text.hpp"

namespace rtpm::rt {
namespace {

using test::expect_text;
using test::fifo;
using test::kTimeShared;
using test::scheduling_of_this_thread;

/// A thread's own state at the beginning of its body.
struct Seen {
  std::string name;
  test::Scheduling scheduling{};
  std::vector<int> cpus;
  std::optional<Priority> priority;
};

Seen state_of_this_thread() {
  return {test::name_of_this_thread(), scheduling_of_this_thread(), test::cpus_of_this_thread(),
          current_priority()};
}

/// Starts a thread with `config` and returns what its body saw; fails the test if it did not start.
Seen seen_by(const ThreadConfig& config) {
  Seen seen;
  auto thread = Thread::start(config, [&] { seen = state_of_this_thread(); });
  EXPECT_TRUE(thread) << thread.error().text();
  if (thread) thread->join();
  return seen;
}

TEST(Thread, RunsItsBodyOnceAndJoins) {
  std::atomic<int> run_count{0};
  auto thread = Thread::start({.name = "once"}, [&] { ++run_count; });
  ASSERT_TRUE(thread);
  EXPECT_TRUE(thread->is_running());
  thread->join();
  EXPECT_EQ(run_count, 1);
  EXPECT_FALSE(thread->is_running());
  thread->join();
}

TEST(Thread, JoinsWhenItEndsAndWhenItIsReplaced) {
  std::atomic<int> run_count{0};
  {
    auto first = Thread::start({.name = "first"}, [&] { ++run_count; });
    auto second = Thread::start({.name = "second"}, [&] { ++run_count; });
    ASSERT_TRUE(first);
    ASSERT_TRUE(second);
    *first = std::move(*second);
    EXPECT_GE(run_count, 1);
    EXPECT_FALSE(second->is_running());
  }
  EXPECT_EQ(run_count, 2);
}

TEST(Thread, HasItsNameWhenItsBodyBegins) {
  EXPECT_EQ(seen_by({.name = "lane-20000"}).name, "lane-20000");
  EXPECT_EQ(seen_by({.name = "a-name-of-more-than-15-bytes"}).name, "a-name-of-more-");
}

TEST(Thread, RunsTimeSharedWithoutAPriority) {
  const Seen seen = seen_by({.name = "plain", .realtime = RealtimeMode::kRequire});
  EXPECT_EQ(seen.scheduling, kTimeShared);
  EXPECT_EQ(seen.priority, std::nullopt);
}

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

TEST(Thread, IsConfinedToItsCpus) {
  for (const int cpu : test::cpus_of_this_thread()) {
    EXPECT_EQ(seen_by({.name = "confined", .cpus = {cpu}}).cpus, std::vector<int>{cpu});
  }
  EXPECT_EQ(seen_by({.name = "free"}).cpus, test::cpus_of_this_thread()) << "its starter's";
}

TEST(Thread, IsNotStartedOnAbsentCpus) {
  const int here = test::cpus_of_this_thread().front();
  for (const std::vector<int>& cpus :
       {std::vector<int>{1000}, {-1}, {1'000'000}, {here, 1000}, {here, -1}, {here, 1'000'000}}) {
    bool has_run = false;
    const auto thread = Thread::start({.name = "nowhere", .cpus = cpus}, [&] { has_run = true; });
    EXPECT_FALSE(thread) << "with " << cpus.back();
    EXPECT_FALSE(has_run);
    if (!thread)
      expect_text(thread.error().text(), {"'nowhere'", std::to_string(cpus.back()), "Remedy"});
  }
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

TEST(ThisThread, CanBeConfigured) {
  std::thread([] {
    const int cpu = test::cpus_of_this_thread().front();
    ASSERT_TRUE(configure_this_thread(
        {.name = "main-loop", .priority = 20'000, .cpus = {cpu}, .realtime = RealtimeMode::kOff}));
    const Seen seen = state_of_this_thread();
    EXPECT_EQ(seen.name, "main-loop");
    EXPECT_EQ(seen.cpus, std::vector<int>{cpu});
    EXPECT_EQ(seen.priority, Priority{20'000});
    EXPECT_EQ(seen.scheduling, kTimeShared);
  }).join();
}

}  // namespace
}  // namespace rtpm::rt
