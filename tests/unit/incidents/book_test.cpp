#include "rtpm/incidents/book.hpp"

#include <gtest/gtest.h>

#include <chrono>
#include <string>
#include <vector>

namespace rtpm::incidents {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr std::uint64_t kUtcNs = 1'700'000'000'000'000'000;

Moment at(Duration time) {
  return {MonotonicTime{} + std::chrono::hours{1} + time,
          kUtcNs + static_cast<std::uint64_t>(time.count())};
}

const Cause kLost{.who = "lab/arm0", .what = "lost", .severity = Severity::kAlarm};
const Cause kDropped{.who = "recorder", .what = "dropped", .severity = Severity::kWarning};

class Book : public ::testing::Test {
 protected:
  void observe(const std::vector<Cause>& causes, Duration time) { book_.observe(causes, at(time)); }
  [[nodiscard]] const Incident& newest() const { return book_.all().rbegin()->second; }
  IncidentBook book_{};
};

TEST_F(Book, OpensOnceWhileACauseLastsAndClosesWithIt) {
  for (int tick = 0; tick < 100; ++tick)
    observe({kLost}, tick * milliseconds{250});
  ASSERT_EQ(book_.all().size(), 1U);
  EXPECT_TRUE(newest().is_open());
  EXPECT_EQ(newest().since_ns, kUtcNs);
  EXPECT_EQ(newest().count, 1U);
  EXPECT_EQ(book_.take_changed().size(), 1U);
  observe({}, seconds{25});
  EXPECT_EQ(newest().until_ns, kUtcNs + 25'000'000'000);
  EXPECT_EQ(book_.open_count(), 0U);
}

TEST_F(Book, ContinuesWhenTheCauseReturnsWithinASecond) {
  for (int tick = 0; tick < 10; ++tick) {
    observe({kLost}, tick * milliseconds{500});
    observe({}, tick * milliseconds{500} + milliseconds{250});
  }
  ASSERT_EQ(book_.all().size(), 1U);
  EXPECT_EQ(newest().count, 10U);
  observe({kLost}, seconds{8});
  EXPECT_EQ(book_.all().size(), 2U);
}

TEST_F(Book, CountsEventsOfOneSecondTogether) {
  book_.happen(kDropped, at(Duration{0}));
  book_.happen(kDropped, at(milliseconds{900}));
  ASSERT_EQ(book_.all().size(), 1U);
  EXPECT_EQ(newest().count, 2U);
  EXPECT_FALSE(newest().is_open());
  book_.happen(kDropped, at(seconds{2}));
  EXPECT_EQ(book_.all().size(), 2U);
}

TEST_F(Book, KeepsEventsApartThatSaySomethingElse) {
  book_.happen({.who = "lab/arm0", .what = "lease", .why = "free → Anna"}, at(Duration{0}));
  book_.happen({.who = "lab/arm0", .what = "lease", .why = "Anna → Ben"}, at(milliseconds{250}));
  EXPECT_EQ(book_.all().size(), 2U);
  book_.happen({.who = "a.mcap", .what = "dropped", .why = "7", .is_sum = true}, at(seconds{2}));
  book_.happen({.who = "a.mcap", .what = "dropped", .why = "9", .is_sum = true}, at(seconds{2}));
  EXPECT_EQ(book_.all().size(), 3U);
  EXPECT_EQ(newest().why, "9");
}

TEST_F(Book, IsAcknowledgedOnceByAPerson) {
  observe({kLost}, Duration{0});
  const std::uint64_t id = newest().id;
  EXPECT_EQ(book_.newest_unseen_alarm(), id);
  EXPECT_EQ(book_.unseen_count(), 1U);
  EXPECT_TRUE(book_.acknowledge(id, "Anna\n", kUtcNs));
  EXPECT_EQ(newest().acknowledged_by, "Anna\\n");
  EXPECT_FALSE(book_.acknowledge(id, "Ben", kUtcNs + 1));
  EXPECT_FALSE(book_.acknowledge(id + 1, "Ben", kUtcNs + 1));
  EXPECT_EQ(book_.unseen_count(), 0U);
  EXPECT_EQ(book_.newest_unseen_alarm(), 0U);
  // It still lasts.
  EXPECT_EQ(book_.open_count(), 1U);
}

TEST_F(Book, DropsTheOldestAcknowledgedOneBeyondTheLimit) {
  for (std::size_t i = 0; i < IncidentBook::kCountMax; ++i)
    book_.happen({.who = "lab/arm" + std::to_string(i), .what = "late"}, at(Duration{0}));
  EXPECT_TRUE(book_.acknowledge(7, "Anna", kUtcNs));
  observe({kLost}, seconds{5});
  EXPECT_EQ(book_.all().size(), IncidentBook::kCountMax);
  EXPECT_FALSE(book_.all().contains(7));
  EXPECT_TRUE(book_.all().contains(1));
  EXPECT_EQ(book_.dropped_count(), 1U);
  book_.happen(kDropped, at(seconds{6}));
  EXPECT_FALSE(book_.all().contains(1));
  EXPECT_EQ(book_.open_count(), 1U);
}

TEST_F(Book, ContinuesOpenIncidentsOfAnEarlierRun) {
  book_.restore({.id = 41, .who = "lab/arm0", .what = "lost", .since_ns = 5});
  book_.restore({.id = 42, .who = "lab/arm1", .what = "lost", .since_ns = 6});
  // The console has not yet found the devices.
  observe({}, Duration{0});
  EXPECT_EQ(book_.open_count(), 2U);
  observe({kLost}, seconds{4});
  observe({kLost}, seconds{5});
  EXPECT_TRUE(book_.all().at(41).is_open());
  EXPECT_EQ(book_.all().at(41).since_ns, 5U);
  EXPECT_FALSE(book_.all().at(42).is_open());
  book_.happen(kDropped, at(seconds{6}));
  EXPECT_EQ(newest().id, 43U);
}

TEST_F(Book, EndsAfterItBeganAlsoWhereTheWallClockIsSetBack) {
  observe({kLost}, Duration{0});
  Moment later = at(seconds{3});
  later.utc_ns = kUtcNs - 3'600'000'000'000;
  book_.observe({}, later);
  EXPECT_FALSE(newest().is_open());
  EXPECT_GT(newest().until_ns, newest().since_ns);
}

}  // namespace
}  // namespace rtpm::incidents
