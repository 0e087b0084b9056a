#include <gtest/gtest.h>

#include "table.hpp"

namespace rtpm::events::test {
namespace {

using namespace std::chrono_literals;

TEST(Delivery, EveryNthBeginsWithTheFirst) {
  Table table(of_type(kPose), {.every_nth = 3});
  for (int i = 0; i < 7; ++i)
    table.push(kPose);
  EXPECT_EQ(table.got(), "5.0#1 5.0#4 5.0#7");
  EXPECT_EQ(table.exchange.counters(table.number).omitted_count, 4U);
}

TEST(Delivery, IntervalDeliversOneEventAtATime) {
  Table table(of_type(kPose), {.interval = 10ms, .is_trailing = false});
  for (int ms = 0; ms < 40; ++ms)
    table.push_at(ms, kPose);
  EXPECT_EQ(table.got(), "5.0#1 5.0#11 5.0#21 5.0#31");
}

TEST(Delivery, IntervalDeliversTheLastAtItsEnd) {
  Table table(of_type(kPose), {.interval = 10ms});
  table.push_at(0, kPose);
  table.push_at(1, kPose);
  table.push_at(2, kPose);
  EXPECT_EQ(table.got(), "5.0#1");
  table.advance(9.9);
  EXPECT_EQ(table.got(), "");
  table.advance(10);
  EXPECT_EQ(table.got(), "5.0#3");
  table.advance(100);
  EXPECT_EQ(table.got(), "");
  EXPECT_EQ(table.exchange.counters(table.number).omitted_count, 1U);
}

TEST(Delivery, IntervalMayApplyPerSource) {
  Table table(of_type(kPose),
              {.interval = 10ms, .queue_capacity = 64, .is_interval_per_source = true});
  for (int ms = 0; ms < 15; ++ms) {
    table.push_at(ms, kPose, 1);
    if (ms >= 3 && ms < 6) table.push_at(ms, kPose, 2);
  }
  // The last event of source 2 comes at the end of its own interval.
  table.advance(30);
  EXPECT_EQ(table.got(), "5.1#1 5.2#1 5.1#10 5.2#3 5.1#15");
}

TEST(Delivery, SourcesBeyondTheLimitShareAnInterval) {
  constexpr int kCount = static_cast<int>(kIntervalSourceMax) + 10;
  Table table(of_type(kPose), {.interval = 10ms,
                               .is_trailing = false,
                               .queue_capacity = 4096,
                               .is_interval_per_source = true});
  for (int source = 1; source <= kCount; ++source)
    table.push_at(0, kPose, static_cast<SourceId>(source));
  EXPECT_EQ(table.exchange.counters(table.number).omitted_count, 9u);
  // Sources whose interval is over free their slots.
  for (int source = kCount; source > 10; --source)
    table.push_at(10, kPose, static_cast<SourceId>(source));
  EXPECT_EQ(table.exchange.counters(table.number).omitted_count, 9u);
}

TEST(Delivery, DeadbandOmitsSmallChanges) {
  Table table(of_type(kPose), {.deadbands = {{kPose, "x", 0.5}}});
  for (const double x : {0.0, 0.4, -0.4, 0.5, 0.6, 0.0})
    table.push(kPose, 0, {.x = x});
  EXPECT_EQ(table.got(), "5.0#1 5.0#4 5.0#6");
}

TEST(Delivery, DeadbandsApplyPerSourceAndAnyChangeDelivers) {
  Table table(everything(), {.deadbands = {{kPose, "x", 1}, {kPose, "step", 2}}});
  table.push(kPose, 1);
  table.push(kPose, 2);
  table.push(kPose, 1, {.x = 0.5, .step = 2});
  table.push(kPose, 2, {.x = 0.5, .step = 1});
  table.push(kButton);
  EXPECT_EQ(table.got(), "5.1#1 5.2#1 5.1#2 6.0#1");
}

TEST(Delivery, FullQueueDropsTheOldestAndCounts) {
  Table table(everything(), {.queue_capacity = 2});
  for (int i = 0; i < 5; ++i)
    table.push(kPose);
  EXPECT_EQ(table.got(), "5.0#4 5.0#5");
  EXPECT_EQ(table.exchange.losses(table.number).overflow_count, 3U);
}

TEST(Delivery, GroupIsDroppedWhole) {
  Table table(any_of({of_type(kGaze), correlate({of_type(kPose), of_type(kButton)})}),
              {.queue_capacity = 2});
  table.push(kPose);
  table.push(kButton);
  table.push(kGaze);
  EXPECT_EQ(table.got(), "7.0#1");
  EXPECT_EQ(table.exchange.losses(table.number).overflow_count, 2U);
}

TEST(Delivery, KeepLatestHasTheNewestOfEachTypeAndSource) {
  Table table(everything(), {.when_full = QueuePolicy::kKeepLatest, .queue_capacity = 2});
  table.push(kPose, 1);
  table.push(kPose, 2);
  table.push(kPose, 1);
  EXPECT_EQ(table.got(), "5.1#2 5.2#1");
  EXPECT_EQ(table.exchange.losses(table.number).replaced_count, 1U);
  table.push(kPose, 1);
  table.push(kPose, 2);
  table.push(kPose, 3);
  EXPECT_EQ(table.got(), "5.2#2 5.3#1");
  EXPECT_EQ(table.exchange.losses(table.number).overflow_count, 1U);
}

TEST(Delivery, DisconnectFailsWhenTheQueueIsFull) {
  Table table(everything(), {.when_full = QueuePolicy::kDisconnect, .queue_capacity = 2});
  table.push(kPose);
  table.push(kPose);
  EXPECT_FALSE(table.exchange.has_failed(table.number));
  table.push(kPose);
  EXPECT_TRUE(table.exchange.has_failed(table.number));
  EXPECT_EQ(table.exchange.take_ready(), table.number);
}

TEST(Delivery, SuspendedSubscriptionCountsWhatItMisses) {
  Table table(of_type(kPose));
  table.exchange.set_suspended(table.number, true);
  table.push(kPose);
  table.push(kButton);
  table.exchange.set_suspended(table.number, false);
  table.push(kPose);
  EXPECT_EQ(table.got(), "5.0#2");
  EXPECT_EQ(table.exchange.losses(table.number).suspended_count, 1U);
}

TEST(Delivery, ChangeLosesNothing) {
  Table table(of_type(kPose));
  table.push(kPose);
  table.push(kButton);
  auto other = Exchange::prepare(of_type(kButton), {}, table.catalog);
  ASSERT_TRUE(other);
  ASSERT_TRUE(table.exchange.change(table.number, *other, table.now));
  table.push(kPose);
  table.push(kButton);
  EXPECT_EQ(table.got(), "5.0#1 6.0#2");
  EXPECT_EQ(table.exchange.losses(table.number), Losses{});
}

TEST(Delivery, ReplaysTheLatestEventsInTheirOrder) {
  Table table(of_type(kButton), {}, {.history_depth = 4});
  for (int i = 0; i < 6; ++i) {
    table.push(kPose, 1);
    table.push(kPose, 2);
  }
  const auto late = table.subscribe(of_type(kPose), {.replay = 2});
  EXPECT_EQ(table.got(late), "~5.1#5 ~5.2#5 ~5.1#6 ~5.2#6");
  table.push(kPose, 1);
  EXPECT_EQ(table.got(late), "5.1#7");
  EXPECT_EQ(table.got(table.subscribe(of_type(kPose, 1), {.replay = 64})),
            "~5.1#4 ~5.1#5 ~5.1#6 ~5.1#7");
}

}  // namespace
}  // namespace rtpm::events::test
