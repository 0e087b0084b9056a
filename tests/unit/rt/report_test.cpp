#include "rtpm/rt/report.hpp"

#include <gtest/gtest.h>

#include <algorithm>

#include "notes.hpp"
#include "rtpm/rt/thread.hpp"

namespace rtpm::rt {
namespace {

void start(const ThreadConfig& config) {
  const auto thread = Thread::start(config, [] {});
  EXPECT_TRUE(thread) << thread.error().text();
}

TEST(SetupReport, ReportsHowEachThreadRuns) {
  start({.name = "shy", .priority = 7, .realtime = RealtimeMode::kOff});
  EXPECT_EQ(grant_of("thread 'shy'"), Grant::kNotAsked);
  start({.name = "low", .priority = 7, .schedule = Schedule::kTimeShared});
  EXPECT_EQ(grant_of("thread 'low'"), Grant::kGranted) << "it is what was asked for";
  EXPECT_EQ(note_of("thread 'low'")->text, "time-shared");
}

TEST(SetupReport, KeepsTheLastNoteOfEachSubject) {
  note_setup({"a thing", Grant::kRefused, "no", "ask again"});
  note_setup({"a thing", Grant::kGranted, "yes", ""});
  const auto report = setup_report();
  EXPECT_EQ(std::ranges::count(report, "a thing", &SetupNote::subject), 1);
  EXPECT_EQ(grant_of("a thing"), Grant::kGranted);
}

TEST(Spinning, IsAllowedOutsideRealtimeLevels) {
  EXPECT_TRUE(check_spinning({.name = "free",
                              .priority = 5,
                              .realtime = RealtimeMode::kRequire,
                              .schedule = Schedule::kTimeShared}));
  EXPECT_TRUE(check_spinning({.name = "free", .realtime = RealtimeMode::kRequire}));
  EXPECT_TRUE(check_spinning({.name = "free", .priority = 5, .realtime = RealtimeMode::kOff}));
  EXPECT_FALSE(note_of("spin of 'free'"));
}

}  // namespace
}  // namespace rtpm::rt
