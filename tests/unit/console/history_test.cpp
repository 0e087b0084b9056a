#include "history/history.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>
#include <vector>

namespace rtpm::console {
namespace {

constexpr std::int64_t kSecond = 1'000'000'000;
constexpr std::int64_t kBegin = 1'800'000'000 * kSecond;
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

HistoryTopic topic(const std::string& name, std::size_t field_count) {
  HistoryTopic made{.name = name, .device = name};
  for (std::size_t i = 0; i < field_count; ++i)
    made.fields.push_back({"value[" + std::to_string(i) + "]", "V"});
  return made;
}

/// Puts sin(t) at `rate` per second from `begin` for `seconds`, like a console that runs so long.
void feed(History& history, const std::string& name, std::int64_t begin, double seconds,
          double rate) {
  const auto count = static_cast<int>(seconds * rate);
  for (int i = 0; i < count; ++i) {
    const auto time = begin + static_cast<std::int64_t>(i / rate * 1e9);
    history.set_now(time);
    const double value = std::sin(i / rate);
    ASSERT_TRUE(history.put(name, time, {&value, 1}));
  }
}

HistoryColumn read(History& history, const std::string& path, std::int64_t begin, std::int64_t end,
                   std::size_t points = 1500) {
  auto column = history.read(path, begin, end, points);
  EXPECT_TRUE(column) << path;
  return column.value_or(HistoryColumn{});
}

TEST(Histories, KeepTheLowestAndHighestOfEachStep) {
  History history;
  history.set_now(kBegin);
  ASSERT_TRUE(history.add(topic("lab/a/sampled", 1)));
  for (const double value : {3.0, -1.0, 2.0})
    ASSERT_TRUE(history.put("lab/a/sampled", kBegin, {&value, 1}));
  const double next = 7;
  ASSERT_TRUE(history.put("lab/a/sampled", kBegin + kSecond / 5, {&next, 1}));
  const HistoryColumn column =
      read(history, "lab/a/sampled.value[0]", kBegin - kSecond, kBegin + kSecond);
  ASSERT_EQ(column.times_ns, (std::vector{kBegin, kBegin + kSecond / 5}));
  EXPECT_EQ(column.spans[0].low, -1);
  EXPECT_EQ(column.spans[0].high, 3);
  EXPECT_EQ(column.spans[1].low, 7);
}

TEST(Histories, ReachFourHoursBackInCoarserSteps) {
  History history;
  history.set_now(kBegin);
  ASSERT_TRUE(history.add(topic("lab/a/sampled", 1)));
  constexpr std::int64_t kHours = 5 * 3600;
  feed(history, "lab/a/sampled", kBegin, kHours, 1);
  const std::int64_t end = kBegin + kHours * kSecond;
  const std::string path = "lab/a/sampled.value[0]";
  EXPECT_EQ(read(history, path, end - 60 * kSecond, end).step_ns, kSecond / 10);
  EXPECT_EQ(read(history, path, end - 600 * kSecond, end).step_ns, kSecond);
  const HistoryColumn all = read(history, path, end - 4 * 3600 * kSecond, end);
  EXPECT_EQ(all.step_ns, 10 * kSecond);
  EXPECT_GE(all.times_ns.size(), 1439u);
  // Ten seconds of a sine of 6.3 s reach both ends.
  EXPECT_LT(all.spans[700].low, -0.8F);
  EXPECT_GT(all.spans[700].high, 0.8F);
  const HistoryColumn few = read(history, path, end - 4 * 3600 * kSecond, end, 100);
  EXPECT_LE(few.times_ns.size(), 101u);
  EXPECT_GE(few.times_ns.size(), 95u);
}

TEST(Histories, LeaveGapsWhereNothingCame) {
  History history;
  history.set_now(kBegin);
  ASSERT_TRUE(history.add(topic("lab/a/sampled", 1)));
  feed(history, "lab/a/sampled", kBegin, 2, 50);
  feed(history, "lab/a/sampled", kBegin + 30 * kSecond, 2, 50);
  history.set_now(kBegin + 32 * kSecond);
  ASSERT_TRUE(history.put("lab/a/sampled", kBegin + 32 * kSecond, {&kNan, 1}));
  const HistoryColumn column =
      read(history, "lab/a/sampled.value[0]", kBegin, kBegin + 40 * kSecond);
  ASSERT_EQ(column.times_ns.size(), 40u);
  EXPECT_EQ(column.times_ns[19], kBegin + 19 * kSecond / 10);
  EXPECT_EQ(column.times_ns[20], kBegin + 30 * kSecond);
}

TEST(Histories, ForgetTheFutureWhenTheClockIsSetBack) {
  History history;
  history.set_now(kBegin);
  ASSERT_TRUE(history.add(topic("lab/a/sampled", 1)));
  feed(history, "lab/a/sampled", kBegin, 20, 50);
  // Ten seconds back: what was recorded after that has no place on the new clock.
  history.set_now(kBegin + 10 * kSecond);
  feed(history, "lab/a/sampled", kBegin + 10 * kSecond, 1, 50);
  const HistoryColumn column =
      read(history, "lab/a/sampled.value[0]", kBegin, kBegin + 60 * kSecond);
  EXPECT_LT(column.times_ns.back(), kBegin + 11 * kSecond);
  EXPECT_NEAR(column.spans.back().high, std::sin(1.0), 0.02);
}

TEST(Histories, KeepThePastWhenTheClockJumpsForward) {
  History history;
  history.set_now(kBegin);
  ASSERT_TRUE(history.add(topic("lab/a/sampled", 1)));
  feed(history, "lab/a/sampled", kBegin, 60, 10);
  const std::int64_t later = kBegin + 365 * 86400 * kSecond;
  feed(history, "lab/a/sampled", later, 20, 10);
  history.set_now(kBegin + 60 * kSecond);  // It was an error of the time server.
  const HistoryColumn column =
      read(history, "lab/a/sampled.value[0]", kBegin, kBegin + 60 * kSecond);
  EXPECT_GE(column.times_ns.size(), 580u);
}

TEST(Histories, RefuseTimesInTheFuture) {
  History history;
  history.set_now(kBegin);
  ASSERT_TRUE(history.add(topic("lab/a/sampled", 1)));
  const double value = 1;
  ASSERT_TRUE(history.put("lab/a/sampled", kBegin + 3600 * kSecond, {&value, 1}));
  EXPECT_EQ(history.future_count(), 1u);
  EXPECT_TRUE(
      read(history, "lab/a/sampled.value[0]", kBegin, kBegin + 7200 * kSecond).times_ns.empty());
}

// A tenth of 50 devices in a tenth of the memory.
TEST(Histories, HoldFiftyDevicesInTheirMemory) {
  History history({.byte_max = History::Limits().byte_max / 10});
  history.set_now(kBegin);
  constexpr std::size_t kFieldCount = 30;
  constexpr int kDeviceCount = 5;
  for (int device = 0; device < kDeviceCount; ++device)
    ASSERT_TRUE(history.add(topic("lab/d" + std::to_string(device) + "/sampled", kFieldCount)));
  std::vector<double> values(kFieldCount);
  std::int64_t time = kBegin;
  // As many values as fill each tier.
  for (const HistoryTier& tier : {kHistoryTiers[2], kHistoryTiers[1], kHistoryTiers[0]}) {
    for (std::size_t i = 0; i < tier.step_count + FieldHistory::kChunkSize; ++i) {
      time += tier.step_ns;
      history.set_now(time);
      for (std::size_t field = 0; field < kFieldCount; ++field)
        values[field] = static_cast<double>((i + field) % 7);
      for (int device = 0; device < kDeviceCount; ++device)
        ASSERT_TRUE(history.put("lab/d" + std::to_string(device) + "/sampled", time, values));
    }
  }
  EXPECT_LE(history.byte_count(), history.byte_max());
  EXPECT_EQ(history.field_count(), kFieldCount * kDeviceCount);
  EXPECT_EQ(history.dropped_count(), 0u) << history.byte_count();
  const HistoryColumn column =
      read(history, "lab/d4/sampled.value[29]", time - 3600 * kSecond * 4, time);
  EXPECT_GE(column.times_ns.size(), 1430u);
}

TEST(Histories, DropTheFieldsThatNobodyAsksForFirst) {
  History history({.byte_max = 200'000});
  history.set_now(kBegin);
  ASSERT_TRUE(history.add(topic("lab/asked/sampled", 1)));
  ASSERT_TRUE(history.add(topic("lab/other/sampled", 20)));
  EXPECT_TRUE(history.read("lab/asked/sampled.value[0]", kBegin, kBegin + 1, 10));
  std::vector<double> values(20);
  for (int i = 0; i < 3600; ++i) {
    const std::int64_t time = kBegin + i * kSecond;
    history.set_now(time);
    for (std::size_t field = 0; field < 20; ++field)
      values[field] = i % 7;
    ASSERT_TRUE(history.put("lab/asked/sampled", time, std::span(values).first(1)));
    ASSERT_TRUE(history.put("lab/other/sampled", time, values));
    ASSERT_LE(history.byte_count(), history.byte_max());
  }
  const std::int64_t end = kBegin + 3600 * kSecond;
  EXPECT_GT(history.dropped_count(), 0u);
  EXPECT_EQ(read(history, "lab/asked/sampled.value[0]", kBegin, end).times_ns.size(), 360u);
  // One that was dropped is recorded again as soon as it is asked for.
  const std::size_t dropped_count = history.dropped_count();
  EXPECT_TRUE(read(history, "lab/other/sampled.value[0]", kBegin, end).times_ns.empty());
  EXPECT_EQ(history.dropped_count(), dropped_count - 1);
}

TEST(Histories, GiveThePlaceOfSilentTopicsToNewOnes) {
  History history({.topic_max = 2});
  history.set_now(kBegin);
  ASSERT_TRUE(history.add(topic("lab/a/sampled", 1)));
  ASSERT_TRUE(history.add(topic("lab/b/sampled", 1)));
  EXPECT_FALSE(history.add(topic("lab/c/sampled", 1)));
  EXPECT_EQ(history.refused_count(), 1u);
  feed(history, "lab/b/sampled", kBegin, 70, 1);
  EXPECT_TRUE(history.add(topic("lab/c/sampled", 1)));
  EXPECT_FALSE(history.read("lab/a/sampled.value[0]", kBegin, kBegin + kSecond, 10));
  EXPECT_TRUE(history.read("lab/b/sampled.value[0]", kBegin, kBegin + kSecond, 10));
}

TEST(Histories, KeepThePastOfFieldsThatStay) {
  History history;
  history.set_now(kBegin);
  ASSERT_TRUE(history.add(topic("lab/a/config", 1)));
  feed(history, "lab/a/config", kBegin, 10, 1);
  ASSERT_TRUE(history.add(topic("lab/a/config", 2)));
  const double one = 1;
  EXPECT_FALSE(history.put("lab/a/config", kBegin, {&one, 1}));
  EXPECT_EQ(read(history, "lab/a/config.value[0]", kBegin, kBegin + 10 * kSecond).times_ns.size(),
            10u);
  EXPECT_EQ(history.field_count(), 2u);
}

TEST(Histories, FindFieldsByWords) {
  History history;
  ASSERT_TRUE(history.add({"lab/arm0/sampled", "lab/arm0", {{"position_m.x", "m"}}}));
  ASSERT_TRUE(history.add({"lab/arm1/sampled", "lab/arm1", {{"position_m.x", "m"}}}));
  const History::Search search = history.find("  Position ARM1", 10);
  ASSERT_EQ(search.fields.size(), 1u);
  EXPECT_EQ(search.fields[0].path, "lab/arm1/sampled.position_m.x");
  EXPECT_EQ(search.fields[0].unit, "m");
  EXPECT_EQ(search.fields[0].device, "lab/arm1");
  EXPECT_EQ(history.find("", 1).fields.size(), 1u);
  EXPECT_EQ(history.find("", 1).total_count, 2u);
  EXPECT_EQ(history.find("nothing", 10).total_count, 0u);
}

}  // namespace
}  // namespace rtpm::console
