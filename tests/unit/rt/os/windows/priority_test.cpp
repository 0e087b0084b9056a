#include "rtpm/rt/priority.hpp"

#include <gtest/gtest.h>

#include <windows.h>

#include <array>
#include <string>

#include "notes.hpp"
#include "seen.hpp"

// Windows has fewer levels than RTPM. Whether MMCSS really raises a thread can't be seen from here.
namespace rtpm::rt {
namespace {

TEST(Priorities, AreRangesOfTheSystems) {
  EXPECT_EQ(seen_by({.name = "lowest", .priority = 0}).scheduling,
            test::Scheduling{THREAD_PRIORITY_ABOVE_NORMAL});
  EXPECT_EQ(seen_by({.name = "low", .priority = 8'191}).scheduling,
            test::Scheduling{THREAD_PRIORITY_ABOVE_NORMAL});
  EXPECT_EQ(seen_by({.name = "middle", .priority = 8'192}).scheduling,
            test::Scheduling{THREAD_PRIORITY_HIGHEST});
  EXPECT_EQ(seen_by({.name = "high", .priority = 16'383}).scheduling,
            test::Scheduling{THREAD_PRIORITY_HIGHEST});
  EXPECT_EQ(note_of("thread 'high'")->text, "HIGHEST (base priority 10)");
  EXPECT_EQ(grant_of("thread 'high'"), Grant::kGranted);
}

TEST(Priorities, JoinTheMultimediaClassFrom16384On) {
  struct Case {
    int priority;
    const char* name;
  };
  for (const Case& each : {Case{16'384, "low"}, Case{20'480, "normal"}, Case{24'576, "high"},
                           Case{28'672, "critical"}, Case{32'767, "critical"}}) {
    const Seen seen = seen_by({.name = "urgent", .priority = each.priority});
    EXPECT_EQ(seen.priority, Priority{each.priority});
    const auto note = note_of("thread 'urgent'");
    ASSERT_TRUE(note);
    if (note->grant == Grant::kPartly) GTEST_SKIP() << "MMCSS does not run here: " << note->text;
    EXPECT_EQ(note->text, std::string("MMCSS Pro Audio, ") + each.name);
  }
}

// Joining takes a call to a service, which a thread makes once, when it is set up.
TEST(Priorities, RaiseALaterUrgentThreadWithoutTheService) {
  on_a_thread([] {
    ASSERT_TRUE(set_current_priority(100));
    EXPECT_EQ(test::scheduling_of_this_thread(), test::Scheduling{THREAD_PRIORITY_ABOVE_NORMAL});
    adopt_priority(30'000);
    EXPECT_EQ(test::scheduling_of_this_thread(), test::Scheduling{THREAD_PRIORITY_TIME_CRITICAL});
    adopt_priority(9'000);
    EXPECT_EQ(test::scheduling_of_this_thread(), test::Scheduling{THREAD_PRIORITY_HIGHEST});
  });
}

TEST(Priorities, AreKeptFromATimeSharedThread) {
  on_a_thread([] {
    adopt_priority(30'000);
    EXPECT_EQ(current_priority(), Priority{30'000});
    EXPECT_EQ(test::scheduling_of_this_thread(), test::kTimeShared);
  });
  EXPECT_EQ(seen_by({.name = "off", .priority = 20'000, .realtime = RealtimeMode::kOff}).scheduling,
            test::kTimeShared);
}

}  // namespace
}  // namespace rtpm::rt
