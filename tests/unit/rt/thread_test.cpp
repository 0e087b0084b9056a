#include "rtpm/rt/thread.hpp"

#include <gtest/gtest.h>

#include <atomic>
#include <string>
#include <thread>
#include <vector>

#include "rtpm/test/os.hpp"
#include "rtpm/test/text.hpp"
#include "seen.hpp"

namespace rtpm::rt {
namespace {

using test::expect_text;
using test::kTimeShared;

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
