#include "rtpm/rt/report.hpp"

#include <gtest/gtest.h>

#include "notes.hpp"
#include "rtpm/rt/budget.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/cpu_latency.hpp"
#include "rtpm/rt/memory.hpp"
#include "rtpm/rt/thread.hpp"
#include "rtpm/test/child.hpp"
#include "rtpm/test/os.hpp"

namespace rtpm::rt {
namespace {

TEST(SetupReport, NamesTheLevelOfEachThread) {
  if (!test::has_realtime_right()) GTEST_SKIP() << test::kNoRealtimeRight;
  const auto thread =
      Thread::start({.name = "high", .priority = Priority{Priority::kHighest}, .cpus = {0}}, [] {});
  EXPECT_TRUE(thread) << thread.error().text();
  EXPECT_EQ(grant_of("thread 'high'"), Grant::kGranted);
  EXPECT_EQ(note_of("thread 'high'")->text, "SCHED_FIFO 89, on CPU 0");
}

TEST(SetupReport, ReportsRefusalsWithTheRemedy) {
  if (test::kHasSanitizer) GTEST_SKIP() << test::kSanitizersLockNothing;
  const auto child = test::run_in_child([] {
    test::drop_realtime_rights();
    const auto thread = Thread::start({.name = "timed", .priority = 9}, [] {});
    const auto latency = CpuLatencyRequest::open(Duration{0}, RealtimeMode::kPrefer);
    const auto locked = lock_memory(RealtimeMode::kPrefer);
    if (!thread || !latency || !locked) return std::string("what is preferred can't fail");
    return to_text(setup_report());
  });
  for (const char* part : {"thread 'timed'", "refused", "time-shared", "rtprio 90", "CPU latency",
                           "/dev/cpu_dma_latency", "memory lock", "RLIMIT_MEMLOCK"}) {
    EXPECT_NE(child.said.find(part), child.said.npos) << part << " is not in:\n" << child.said;
  }
}

TEST(SetupReport, StaysBounded) {
  const auto child = test::run_in_child([] {
    for (std::size_t i = 0; i < 2 * kSetupNoteCountMax; ++i)
      note_setup({"thing " + std::to_string(i), Grant::kGranted, "", ""});
    return std::to_string(setup_report().size());
  });
  EXPECT_EQ(child.said, std::to_string(kSetupNoteCountMax));
}

TEST(Spinning, IsRefusedOrPartialAtARealtimeLevel) {
  if (!realtime_limit().is_limited()) GTEST_SKIP() << "nothing limits real-time threads here";
  ThreadConfig config{.name = "spinner", .priority = 5, .realtime = RealtimeMode::kRequire};
  const auto refused = check_spinning(config);
  ASSERT_FALSE(refused);
  for (const char* part : {"spinner", "Remedy", "sched_rt_runtime_us", "periodic"})
    EXPECT_NE(refused.error().text().find(part), std::string::npos) << refused.error().text();
  config.realtime = RealtimeMode::kPrefer;
  EXPECT_TRUE(check_spinning(config));
  EXPECT_EQ(grant_of("spin of 'spinner'"), Grant::kPartly);
}

TEST(CpuLatency, IsHeldAsLongAsTheRequest) {
  const auto none = CpuLatencyRequest::open(Duration{0}, RealtimeMode::kOff);
  ASSERT_TRUE(none);
  EXPECT_FALSE(none->is_granted());
  auto request = CpuLatencyRequest::open(std::chrono::microseconds{3}, RealtimeMode::kRequire);
  if (!request) GTEST_SKIP() << request.error().text();
  EXPECT_TRUE(request->is_granted());
  const CpuLatencyRequest moved = std::move(*request);
  EXPECT_TRUE(moved.is_granted());
  EXPECT_EQ(grant_of("CPU latency"), Grant::kGranted);
}

TEST(CpuLatency, FailsIfRequiredAndRefused) {
  const auto child = test::run_in_child([] {
    test::drop_realtime_rights();
    const auto request = CpuLatencyRequest::open(Duration{0}, RealtimeMode::kRequire);
    return request ? std::string("granted") : request.error().text();
  });
  EXPECT_NE(child.said.find("Remedy: give the user write access"), child.said.npos) << child.said;
}

TEST(RepeatedWarning, IsPrintedAtOnceAndThenAtIntervals) {
  const rtpm::test::ChildResult child = rtpm::test::run_in_child([]() -> std::string {
    RepeatedWarning warning;
    const MonotonicTime begin = now();
    for (const int second : {0, 1, 9, 10, 11})
      warning.say("it rains", begin + std::chrono::seconds{second});
    return "";
  });
  EXPECT_EQ(child.errors,
            "rtpm: warning: it rains\nrtpm: warning: it rains (And 2 times before.)\n");
}

}  // namespace
}  // namespace rtpm::rt
