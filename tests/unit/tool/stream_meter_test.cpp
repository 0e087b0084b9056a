#include "events/stream_meter.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

// The report of `rtpm hz` on a stream with known rate, losses and jitter.
namespace rtpm::tool {
namespace {

using namespace std::chrono_literals;

constexpr Duration kPeriod = 100us;  // 10 kHz

struct Event {
  std::uint64_t sequence = 0;
  MonotonicTime origin{};
};

/// `count` events; every second one is late by `shift`.
std::vector<Event> stream(std::uint64_t count, Duration shift = 0ns, std::uint64_t first = 1) {
  std::vector<Event> events;
  for (std::uint64_t i = 0; i < count; ++i) {
    const Duration time = kPeriod * static_cast<std::int64_t>(i) + (i % 2 == 1 ? shift : 0ns);
    events.push_back({first + i, time_from_ns(1'000'000'000) + time});
  }
  return events;
}

StreamMeter measured(const std::vector<Event>& events) {
  StreamMeter meter;
  for (const Event& event : events)
    meter.add(event.sequence, event.origin, 50us);
  return meter;
}

TEST(StreamMeter, MeasuresTheRateOfAPerfectStream) {
  const StreamMeter meter = measured(stream(100'001));
  EXPECT_EQ(meter.count(), 100'001u);
  EXPECT_DOUBLE_EQ(meter.rate_hz(), 10'000.0);
  EXPECT_EQ(meter.lost_count(), 0u);
  ASSERT_TRUE(meter.jitter());
  EXPECT_EQ(meter.jitter()->mean, kPeriod);
  EXPECT_EQ(meter.jitter()->max, 0ns);
  EXPECT_EQ(meter.jitter()->rms_ns, 0.0);
  EXPECT_EQ(meter.latency().max(), 50us);
}

TEST(StreamMeter, CountsLossesExactlyAndMeasuresTheSentRate) {
  std::mt19937 random(7);
  const std::vector<Event> all = stream(100'001);
  std::vector<Event> arrived;
  std::uint64_t lost_count = 0;
  for (const Event& event : all) {
    const bool is_end = event.sequence == 1 || event.sequence == all.size();
    if (!is_end && random() % 10 == 0) {
      ++lost_count;
    } else {
      arrived.push_back(event);
    }
  }
  const StreamMeter meter = measured(arrived);
  EXPECT_EQ(meter.lost_count(), lost_count);
  EXPECT_GT(lost_count, 9'000u);
  EXPECT_EQ(meter.count(), 100'001u - lost_count);
  EXPECT_DOUBLE_EQ(meter.rate_hz(), 10'000.0);
  EXPECT_EQ(meter.jitter()->max, 0ns) << "a gap is no jitter";
}

TEST(StreamMeter, MeasuresJitterExactly) {
  // Intervals alternate between 110 us and 90 us.
  const StreamMeter meter = measured(stream(100'001, 10us));
  EXPECT_EQ(meter.jitter()->mean, kPeriod);
  EXPECT_EQ(meter.jitter()->max, 10us);
  EXPECT_NEAR(meter.jitter()->rms_ns, 10'000.0, 1e-6);
}

TEST(StreamMeter, CountsDuplicatesAndReorderedEventsButNoLosses) {
  std::vector<Event> events = stream(1'000);
  events.insert(events.begin() + 500, events[499]);  // A duplicate.
  events.insert(events.begin() + 500, events[10]);   // An old event.
  std::swap(events[700], events[705]);               // One arrives too early, one late.
  const StreamMeter meter = measured(events);
  EXPECT_EQ(meter.count(), 1'000u);
  EXPECT_EQ(meter.lost_count(), 0u);
  EXPECT_EQ(meter.duplicate_count(), 2u);
  EXPECT_EQ(meter.late_count(), 5u);
  EXPECT_EQ(meter.restart_count(), 0u);
}

TEST(StreamMeter, DetectsARestartOfTheSource) {
  std::vector<Event> events = stream(1'000, 0ns, 500);
  for (Event event : stream(2'000)) {
    event.origin += 10s;
    events.push_back(event);
  }
  const StreamMeter meter = measured(events);
  EXPECT_EQ(meter.restart_count(), 1u);
  EXPECT_EQ(meter.count(), 3'000u);
  EXPECT_EQ(meter.lost_count(), 0u);
  EXPECT_DOUBLE_EQ(meter.rate_hz(), 10'000.0) << "the pause between the lives counts";
}

TEST(StreamMeter, DetectsAClockThatJumpsBack) {
  std::vector<Event> events = stream(1'000);
  for (std::size_t i = 400; i < events.size(); ++i)
    events[i].origin -= 500ms;
  const StreamMeter meter = measured(events);
  EXPECT_EQ(meter.clock_jump_count(), 1u);
  EXPECT_DOUBLE_EQ(meter.rate_hz(), 10'000.0);
  EXPECT_EQ(meter.jitter()->max, 0ns);
}

TEST(StreamMeter, ReportsNothingForFewerThanTwoEvents) {
  EXPECT_EQ(StreamMeter().rate_hz(), 0.0);
  EXPECT_FALSE(StreamMeter().jitter());
  const StreamMeter one = measured(stream(1, 0ns, 77));
  EXPECT_EQ(one.count(), 1u);
  EXPECT_EQ(one.lost_count(), 0u) << "what came before it was listened to is not lost";
  EXPECT_EQ(one.rate_hz(), 0.0);
}

TEST(StreamMeter, CountsAHugeGap) {
  std::vector<Event> events = stream(2);
  events[1].sequence = 1'000'000'000'000;
  const StreamMeter meter = measured(events);
  EXPECT_EQ(meter.lost_count(), 999'999'999'998u);
}

}  // namespace
}  // namespace rtpm::tool
