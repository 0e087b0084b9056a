#include <gtest/gtest.h>

#include "hub/quota_meter.hpp"
#include "rtpm/rt/memory.hpp"
#include "rtpm/test/alloc_guard.hpp"
#include "table.hpp"

namespace rtpm::events::test {
namespace {

using namespace std::chrono_literals;

TEST(Exchange, OffersAndTimeoutsAllocateNothing) {
  if (!rtpm::test::is_alloc_guard_active()) GTEST_SKIP() << rtpm::test::kAllocGuardInactive;
  Table table(any_of({where(kPose, "x", Comparison::kLess, Scalar::of(1)),
                      correlate({of_type(kPose), of_type(kButton)}, 5ms), every(1ms), once(3ms)}),
              {.interval = 100us, .deadbands = {{kPose, "x", 0.1}}, .queue_capacity = 8});
  const auto latest =
      table.subscribe(everything(), {.when_full = QueuePolicy::kKeepLatest, .queue_capacity = 4});
  const PosePayload payload{};
  const auto bytes = std::as_bytes(std::span<const PosePayload, 1>(&payload, 1));
  {
    const rt::NoAllocationScope no_allocation;
    for (int i = 0; i < 100; ++i) {
      const MonotonicTime now = at(0.3 * i);
      const EventType type = i % 2 == 0 ? kPose : kButton;
      EXPECT_TRUE(table.exchange.offer({{.type = type, .origin = now}, bytes}, now));
      table.exchange.on_time(now);
      while (const auto ready = table.exchange.take_ready()) {
        if (!table.exchange.queue(*ready).empty()) table.exchange.queue(*ready).pop();
      }
    }
  }
  EXPECT_GT(table.exchange.counters(latest).delivered_count, 0U);
}

TEST(Exchange, RefusesReservedTypesAndTooLargeEvents) {
  Table table(everything(), {}, {.store = {{{64, 4}}}});
  EXPECT_EQ(table.exchange.offer({{.type = 0}, {}}, {}).error(), OfferError::kBadType);
  EXPECT_EQ(table.exchange.offer({{.type = kTimeoutType}, {}}, {}).error(), OfferError::kBadType);
  const std::vector<std::byte> large(65);
  EXPECT_EQ(table.exchange.offer({{.type = kPose}, large}, {}).error(), OfferError::kTooLarge);
  EXPECT_EQ(table.got(), "");
}

TEST(Exchange, OnlyTheSlowSubscriptionLosesEvents) {
  Table table(of_type(kPose), {.queue_capacity = 1000},
              {.history_depth = 0, .store = {{{64, 32}}}});
  const auto quick = table.subscribe(everything(), {.queue_capacity = 1000});
  for (int i = 0; i < 100; ++i) {
    table.push(kPose);
    EXPECT_EQ(table.got(quick), "5.0#" + std::to_string(i + 1));
  }
  EXPECT_EQ(table.exchange.losses(quick), Losses{});
  const std::size_t waiting = table.exchange.queue(table.number).size();
  EXPECT_GT(waiting, 10U);
  EXPECT_EQ(table.exchange.losses(table.number).memory_count, 100 - waiting);
}

TEST(Exchange, EvictsHistoryBeforeASubscriptionLosesEvents) {
  Table table(of_type(kPose), {.queue_capacity = 30}, {.history_depth = 32, .store = {{{64, 32}}}});
  for (int i = 0; i < 32; ++i)
    table.push(kButton);
  for (int i = 0; i < 30; ++i)
    table.push(kPose);
  EXPECT_EQ(table.exchange.queue(table.number).size(), 30U);
  EXPECT_EQ(table.exchange.losses(table.number), Losses{});
}

TEST(Exchange, EventsAreHeldNoLongerThanASubscriptionNeedsThem) {
  Table table(correlate({of_type(kPose), of_type(kButton)}), {}, {.history_depth = 0});
  table.push(kPose);
  table.push(kPose);
  EXPECT_EQ(table.exchange.store().count(), 1U);
  table.push(kButton);
  EXPECT_EQ(table.exchange.store().count(), 2U);
  static_cast<void>(table.exchange.unsubscribe(table.number));
  EXPECT_EQ(table.exchange.store().count(), 0U);
}

TEST(Exchange, ReusesTheSlotOfAnEndedSubscription) {
  Table table(everything(), {}, {.subscription_count_max = 1});
  for (int i = 0; i < 3; ++i) {
    table.push(kPose);
    static_cast<void>(table.exchange.unsubscribe(table.number));
    EXPECT_EQ(table.exchange.take_ready(), std::nullopt);
    EXPECT_EQ(table.subscribe(everything()), table.number);
    EXPECT_EQ(table.got(), "");
  }
  auto one_more = Exchange::prepare(everything(), {}, table.catalog);
  ASSERT_TRUE(one_more);
  EXPECT_FALSE(table.exchange.subscribe(std::move(*one_more), table.now));
}

TEST(Exchange, ReportsAReadySubscriptionOnce) {
  Table table(of_type(kPose), {}, {.subscription_count_max = 2});
  const auto other = table.subscribe(of_type(kButton));
  for (int round = 0; round < 5; ++round) {
    table.push(kPose);
    table.push(kPose);
    EXPECT_EQ(table.exchange.take_ready(), table.number);
    table.push(kButton);
    EXPECT_EQ(table.exchange.take_ready(), other);
    EXPECT_EQ(table.exchange.take_ready(), std::nullopt);
  }
}

/// Writes down each broadcast: "0,2:5.0#1".
class Listener final : public Broadcaster {
 public:
  void broadcast(std::span<const SubscriptionNumber> to,
                 std::span<const EventRef> group) noexcept override {
    for (const SubscriptionNumber number : to)
      text += std::to_string(number) + ",";
    text.back() = ':';
    for (const EventRef& event : group)
      text += name_of(event.header()) + "+";
    text.back() = ' ';
  }
  std::string text{};
};

TEST(Exchange, BroadcastsAnEventOnceToAllItsSubscribers) {
  Listener listener;
  Exchange exchange({}, &listener);
  const TypeCatalog catalog = pose_catalog();
  for (const Filter& filter : {of_type(kPose), of_type(kButton), everything(),
                               correlate({of_type(kPose), of_type(kButton)})}) {
    auto prepared = Exchange::prepare(filter, {}, catalog, /*is_broadcast=*/true);
    ASSERT_TRUE(prepared);
    ASSERT_TRUE(exchange.subscribe(std::move(*prepared), {}));
  }
  EXPECT_TRUE(exchange.offer({{.type = kPose, .sequence = 1}, {}}, {}));
  EXPECT_TRUE(exchange.offer({{.type = kButton, .sequence = 1}, {}}, {}));
  EXPECT_EQ(listener.text, "0,2:5.0#1 3:5.0#1+6.0#1 1,2:6.0#1 ");
}

TEST(Quota, RefusesEventsAboveTheRateAndRecovers) {
  QuotaMeter meter({.events_per_s = 1000, .bytes_per_s = 1e9, .burst_s = 0.01});
  int taken = 0;
  for (int i = 0; i < 100; ++i)
    taken += meter.take(10, at(0)) ? 1 : 0;
  EXPECT_EQ(taken, 10);
  EXPECT_TRUE(meter.take(10, at(1)));
  EXPECT_FALSE(meter.take(10, at(1)));
}

TEST(Quota, LimitsBytesToo) {
  QuotaMeter meter({.events_per_s = 1e6, .bytes_per_s = 1000, .burst_s = 1});
  EXPECT_TRUE(meter.take(900, at(0)));
  EXPECT_FALSE(meter.take(900, at(0)));
  EXPECT_TRUE(meter.take(900, at(800)));
}

}  // namespace
}  // namespace rtpm::events::test
