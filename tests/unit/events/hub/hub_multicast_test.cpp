#include <gtest/gtest.h>

#include <memory>
#include <vector>

#include "loopback_multicast.hpp"
#include "rtpm/transport/broadcast_memory.hpp"
#include "served_hub.hpp"

// Consumers of the hub's multicast over loopback behave like those of a stream, even with lost
// datagrams (ev-7).
namespace rtpm::events::test {
namespace {

// Limits the events in flight, for slow (checked) builds.
constexpr std::size_t kPushedAtATime = 100;

class HubMulticast : public testing::TestWithParam<std::uint32_t> {
 protected:
  void SetUp() override {
    if (!has_multicast()) GTEST_SKIP() << kNeedsMulticast;
    lose_every(GetParam());
  }
  void TearDown() override { lose_every(0); }
  [[nodiscard]] static HubConfig config(std::uint32_t history_count = 4096) {
    HubConfig config;
    config.multicast = MulticastConfig{.group = group_of_mine(), .history_count = history_count};
    return config;
  }
  [[nodiscard]] std::unique_ptr<Consumer> join(ServedHub& hub, EventHandler& handler,
                                               const Filter& filter,
                                               const DeliveryPolicy& delivery = {}) {
    auto consumer = rtpm::test::made(Consumer::create(node_, hub.url(),
                                                      {.filter = filter,
                                                       .delivery = delivery,
                                                       .realtime = rt::RealtimeMode::kOff,
                                                       .types = {&kPoseDescriptor},
                                                       .shared_ring = false,
                                                       .multicast = true,
                                                       .multicast_interface = kLoopback,
                                                       .deadline = kPatience},
                                                      handler));
    if (!consumer) return nullptr;
    EXPECT_TRUE(consumer->receives_multicast());
    return consumer;
  }

  rpc::Node node_{};
  Recorder recorder_{};
};

TEST_P(HubMulticast, EachConsumerGetsWhatItsFilterAccepts) {
  ServedHub hub(config());
  // Another consumer reads the ring, where there is one.
  const auto in_ring =
      make_consumer(node_, hub, recorder_, of_type(kPose), {}, rpc::Transport::kAuto, true);
  EXPECT_EQ(in_ring->reads_ring(), transport::offers_broadcast_memory());
  expect_filtered_deliveries(node_, hub, [&](EventHandler& handler, const Filter& filter) {
    return join(hub, handler, filter);
  });
  ASSERT_TRUE(recorder_.await_deliveries(2));
  EXPECT_EQ(recorder_.text(), "5.1#1 5.1#2");
}

// ev-7.2-2, ev-7.2-3 and ev-7.3-1
TEST_P(HubMulticast, DeliversAllEventsInOrderToEveryConsumer) {
  ServedHub hub(config());
  const auto supplier = make_supplier(node_, hub);
  constexpr std::size_t kConsumerCount = 5;
  constexpr std::size_t kCount = 1000;
  std::vector<std::unique_ptr<Recorder>> recorders;
  std::vector<std::unique_ptr<Consumer>> consumers;
  for (std::size_t i = 0; i < kConsumerCount; ++i) {
    recorders.push_back(std::make_unique<Recorder>());
    consumers.push_back(join(hub, *recorders.back(), of_type(kPose), {.queue_capacity = 4096}));
  }
  std::string wanted;
  for (std::size_t i = 1; i <= kCount; ++i) {
    push(*supplier, kPose);
    if (i % kPushedAtATime == 0) await_taken(hub.hub(), i);
    wanted += (i > 1 ? " 5.0#" : "5.0#") + std::to_string(i);
  }
  for (std::size_t i = 0; i < kConsumerCount; ++i) {
    const bool has_all = recorders[i]->await_deliveries(kCount);
    ASSERT_TRUE(has_all) << consumers[i]->counters().event_count;
    EXPECT_EQ(recorders[i]->text(), wanted);
    EXPECT_EQ(consumers[i]->counters().losses, Losses{});
  }
}

TEST_P(HubMulticast, DeliversLargeEventsWhole) {
  ServedHub hub(config());
  const auto supplier = make_supplier(node_, hub);
  const auto consumer = join(hub, recorder_, of_type(kPose));
  const auto payload = large_payload();
  for (int i = 0; i < 3; ++i)
    ASSERT_TRUE(supplier->push({.type = kPose, .payload = payload}));
  ASSERT_TRUE(recorder_.await_deliveries(3));
  EXPECT_EQ(recorder_.last_payload_, payload);
}

TEST_P(HubMulticast, IsChangedSuspendedResumedAndEnded) {
  ServedHub hub(config());
  const auto supplier = make_supplier(node_, hub);
  const auto consumer = join(hub, recorder_, of_type(kPose));
  change_suspend_and_resume(hub.hub(), *supplier, *consumer, recorder_);
  consumer->unsubscribe();
  EXPECT_FALSE(consumer->is_subscribed());
}

// ev-7.3-2
TEST_P(HubMulticast, SleepingConsumerReportsEvictedEvents) {
  ServedHub hub(config(/*history_count=*/64));
  const auto supplier = make_supplier(node_, hub);
  Sleeper sleeper;
  const auto slow = join(hub, sleeper, of_type(kPose), {.queue_capacity = 16});
  const auto quick = join(hub, recorder_, of_type(kPose), {.queue_capacity = 64});
  push(*supplier, kPose);
  ASSERT_TRUE(sleeper.await_deliveries(1));
  // Less than a second, so that the sleeper does not count as dead; in batches smaller than the
  // hub's history, so that the other consumer loses nothing.
  constexpr std::size_t kCount = 320;
  for (std::size_t i = 2; i <= kCount; ++i) {
    push(*supplier, kPose);
    if (i % 16 == 0) {
      ASSERT_TRUE(recorder_.await_deliveries(i));
    }
  }
  EXPECT_EQ(quick->counters().losses, Losses{});
  sleeper.release();
  ASSERT_TRUE(
      sleeper.await([&](const Recorder& it) { return it.last_header_.sequence == kCount; }));
  const auto is_all_reported = [&] {
    const ConsumerCounters counters = slow->counters();
    return counters.event_count + counters.losses.total() == kCount;
  };
  EXPECT_TRUE(await(is_all_reported))
      << slow->counters().event_count << " and " << slow->counters().losses.total() << " lost";
}

// The program keeps fewer datagrams than the hub, and requests the rest.
TEST_P(HubMulticast, SlowConsumerRequestsEvictedDatagramsFromTheHub) {
  ServedHub hub(config());
  const auto supplier = make_supplier(node_, hub);
  Sleeper sleeper;
  constexpr std::size_t kCount = 1200;
  const DeliveryPolicy keep_all{.queue_capacity = 2 * kCount};
  const auto slow = join(hub, sleeper, of_type(kPose), keep_all);
  const auto quick = join(hub, recorder_, of_type(kPose), keep_all);
  push(*supplier, kPose);
  ASSERT_TRUE(sleeper.await_deliveries(1));
  for (std::size_t i = 2; i <= kCount; ++i) {
    push(*supplier, kPose);
    if (i % kPushedAtATime == 0) await_taken(hub.hub(), i);
  }
  ASSERT_TRUE(recorder_.await_deliveries(kCount));
  sleeper.release();
  ASSERT_TRUE(sleeper.await_deliveries(kCount)) << slow->counters().event_count;
  EXPECT_EQ(sleeper.last_header_.sequence, kCount);
  EXPECT_EQ(slow->counters().losses, Losses{});
}

INSTANTIATE_TEST_SUITE_P(Losses, HubMulticast, testing::Values(0U, 3U), [](const auto& each) {
  return each.param == 0 ? std::string("none") : "each_" + std::to_string(each.param);
});

TEST(HubMulticastSetUp, ReportsAnInvalidGroup) {
  for (const transport::MulticastGroup& group :
       {transport::MulticastGroup{.group = "10.0.0.1"}, transport::MulticastGroup{.group = "here"},
        transport::MulticastGroup{.interface = "eth0"}}) {
    HubConfig config{.realtime = rt::RealtimeMode::kOff};
    config.multicast = {group};
    const auto hub = Hub::create(config);
    ASSERT_FALSE(hub);
    rtpm::test::expect_text(hub.error().text(), {"multicast group", "Remedy"});
  }
}

TEST(HubMulticastSetUp, FallsBackToAStreamWithoutMulticast) {
  ServedHub hub;
  rpc::Node node;
  Recorder recorder;
  const auto consumer = Consumer::create(
      node, hub.url(),
      {.realtime = rt::RealtimeMode::kOff, .shared_ring = false, .multicast = true}, recorder);
  ASSERT_TRUE(consumer) << consumer.error().text();
  EXPECT_FALSE((*consumer)->receives_multicast());
}

}  // namespace
}  // namespace rtpm::events::test
