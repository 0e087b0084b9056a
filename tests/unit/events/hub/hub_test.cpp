#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <string>
#include <thread>
#include <vector>

#include "rtpm/events/hub_report.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/host.hpp"
#include "served_hub.hpp"

// A hub behind a server, on every transport.
namespace rtpm::events::test {
namespace {

using namespace std::chrono_literals;

/// Restarts the hub before it has confirmed events.
void expect_maybe_lost_events(rpc::Node& node, ServedHub& hub, rpc::Transport transport) {
  const auto supplier = Supplier::create(
      node, hub.url(), {.attend_interval = 1h, .transport = transport, .deadline = kPatience});
  ASSERT_TRUE(supplier) << supplier.error().text();
  for (int i = 0; i < 10; ++i)
    ASSERT_TRUE((*supplier)->push({.type = kPose}));
  EXPECT_EQ((*supplier)->counters().unconfirmed_count, 10U);
  hub.stop();
  hub.start();
  bool is_reported = false;
  EXPECT_TRUE(await([&] {
    const auto pushed = (*supplier)->push({.type = kPose});
    is_reported = is_reported || (!pushed && pushed.error() == rpc::CallError::kMaybeLost);
    return is_reported && pushed;
  }));
  const SupplierCounters counters = (*supplier)->counters();
  // The ring may report that all but the last were read.
  EXPECT_GE(counters.maybe_lost_count, 1U);
  EXPECT_GE(counters.unconfirmed_count, 1U);
  EXPECT_GE(counters.sent_count, counters.maybe_lost_count + counters.unconfirmed_count);
}

class HubOn : public testing::TestWithParam<rpc::Transport> {
 protected:
  ServedHub hub_{};
  rpc::Node node_{};
  Recorder recorder_{};
};

TEST_P(HubOn, EachConsumerGetsWhatItsFilterAccepts) {
  expect_filtered_deliveries(
      node_, hub_,
      [this](EventHandler& handler, const Filter& filter) {
        return make_consumer(node_, hub_, handler, filter, {}, GetParam());
      },
      GetParam());
}

// Pushes come from any thread, concurrently with the supplier's other requests.
TEST_P(HubOn, DeliversTheEventsOfASupplierInTheirOrder) {
  constexpr int kThreadCount = 3;
  constexpr int kCount = 60;  // The number per thread is small enough for a socket's buffer.
  const auto supplier = make_supplier(node_, hub_, GetParam());
  const auto consumer = make_consumer(node_, hub_, recorder_, of_type(kPose),
                                      {.queue_capacity = kThreadCount * kCount}, GetParam());
  std::array<std::thread, kThreadCount> threads;
  for (std::thread& thread : threads) {
    thread = std::thread([&] {
      for (int i = 0; i < kCount; ++i)
        push(*supplier, kPose);
    });
  }
  for (std::thread& thread : threads)
    thread.join();
  ASSERT_TRUE(recorder_.await_deliveries(kThreadCount * kCount));
  std::string wanted;
  for (int i = 1; i <= kThreadCount * kCount; ++i)
    wanted += (i > 1 ? " 5.0#" : "5.0#") + std::to_string(i);
  EXPECT_EQ(recorder_.text(), wanted);
}

TEST_P(HubOn, ReportsUnconfirmedEventsOfTheFormerHub) {
  expect_maybe_lost_events(node_, hub_, GetParam());
}

TEST_P(HubOn, DeliversBatches) {
  const auto supplier = make_supplier(node_, hub_, GetParam());
  const auto consumer =
      make_consumer(node_, hub_, recorder_, of_type(kPose), {.queue_capacity = 1000}, GetParam());
  for (int i = 0; i < 500; ++i) {
    ASSERT_TRUE(supplier->add({.type = kPose}));
  }
  ASSERT_TRUE(supplier->flush());
  ASSERT_TRUE(recorder_.await_deliveries(500));
  EXPECT_EQ(recorder_.last_header_.sequence, 500U);
  EXPECT_EQ(consumer->counters().losses, Losses{});
}

TEST_P(HubOn, DeliversLargeEventsInParts) {
  const auto supplier = make_supplier(node_, hub_, GetParam());
  const auto consumer = make_consumer(node_, hub_, recorder_, of_type(kPose), {}, GetParam());
  const auto payload = large_payload();
  ASSERT_TRUE(supplier->push({.type = kPose, .payload = payload}));
  push(*supplier, kPose);
  ASSERT_TRUE(supplier->push({.type = kPose, .payload = payload}));
  ASSERT_TRUE(recorder_.await_deliveries(3));
  EXPECT_EQ(recorder_.text(), "5.0#1 5.0#2 5.0#3");
  EXPECT_EQ(recorder_.last_payload_, payload);
}

TEST_P(HubOn, RefusesAFilterInWords) {
  const auto refused =
      Consumer::create(node_, hub_.url(),
                       {.filter = any_of({where(kPose, "y", Comparison::kLess, Scalar::of(1))}),
                        .realtime = rt::RealtimeMode::kOff,
                        .types = {&kPoseDescriptor},
                        .transport = GetParam(),
                        .deadline = kPatience},
                       recorder_);
  ASSERT_FALSE(refused);
  rtpm::test::expect_text(refused.error().text(), {"any[0].where", "'y'"});
  EXPECT_EQ(hub_.hub().subscription_count(), 0U);
}

INSTANTIATE_TEST_SUITE_P(Transports, HubOn,
                         testing::Values(rpc::Transport::kUdp, rpc::Transport::kTcp,
                                         rpc::Transport::kSharedMemory),
                         [](const auto& each) { return std::string(to_string(each.param)); });

// No connection ends in this case.
TEST(HubInTheProgram, ReportsUnconfirmedEventsOfTheFormerHub) {
  ServedHub hub;
  rpc::Node node;
  expect_maybe_lost_events(node, hub, rpc::Transport::kAuto);
}

/// Takes its time over each event.
class SlowHandler final : public EventHandler {
 public:
  void on_events(std::span<const EventView>) override { rt::sleep_until(rt::now() + 10ms); }
  void on_notice(const Notice&) override {}
};

/// A consumer of this name, with a queue of 8.
std::unique_ptr<Consumer> named_consumer(rpc::Node& node, const ServedHub& hub,
                                         EventHandler& handler, const std::string& name,
                                         bool shared_ring) {
  return rtpm::test::made(Consumer::create(node, hub.url(),
                                           {.name = name,
                                            .filter = of_type(kPose),
                                            .delivery = {.queue_capacity = 8},
                                            .realtime = rt::RealtimeMode::kOff,
                                            .shared_ring = shared_ring,
                                            .deadline = kPatience},
                                           handler));
}

class HubConsumers : public testing::TestWithParam<bool> {};

TEST_P(HubConsumers, AreListedWithTheSlowestFirst) {
  ServedHub hub;
  rpc::Node node;
  Recorder recorder;
  SlowHandler slow;
  const auto fast_consumer = named_consumer(node, hub, recorder, "fast", GetParam());
  const auto slow_consumer = named_consumer(node, hub, slow, "slow", GetParam());
  const auto supplier = make_supplier(node, hub);
  std::vector<HubConsumer> list;
  EXPECT_TRUE(await([&] {
    push(*supplier, kPose);
    auto asked = HubReport::ask(node, hub.url(), kPatience);
    list = asked ? std::move(asked->consumers) : std::vector<HubConsumer>{};
    // The queue of 8 holds events of the last milliseconds only, where a machine pushes fast.
    return list.size() == 2 && list[0].name == "slow" && list[0].lost_count > 0 &&
           list[0].lag > list[1].lag;
  }));
  ASSERT_EQ(list.size(), 2u);
  EXPECT_EQ(list[1].name, "fast");
  EXPECT_EQ(list[1].lost_count, 0u);
  for (const HubConsumer& each : list) {
    EXPECT_EQ(each.program, rt::program_name().substr(0, 64));
    EXPECT_EQ(each.process, static_cast<std::uint32_t>(::getpid()));
    EXPECT_EQ(each.host, "127.0.0.1");
    EXPECT_EQ(each.way, GetParam() ? "ring" : "stream");
    EXPECT_GT(each.age, 0ns);
    EXPECT_GT(each.accepted_count, 8u);
  }
}

INSTANTIATE_TEST_SUITE_P(Ways, HubConsumers, testing::Bool(),
                         [](const auto& each) { return each.param ? "ring" : "stream"; });

class HubTest : public testing::Test {
 protected:
  ServedHub hub_{};
  rpc::Node node_{};
  Recorder recorder_{};
};

TEST_F(HubTest, SupplierInTheHubsProgramNeedsNoCall) {
  auto supplier = Supplier::create(hub_.hub(), {.types = {&kPoseDescriptor}});
  ASSERT_TRUE(supplier);
  const auto consumer = make_consumer(node_, hub_, recorder_,
                                      where(kPose, "step", Comparison::kEqual, Scalar::of(3)));
  push(**supplier, kPose, 0, {.step = 2});
  push(**supplier, kPose, 0, {.step = 3});
  ASSERT_TRUE(recorder_.await_deliveries(1));
  EXPECT_EQ(recorder_.text(), "5.0#2");
}

// ev-2-2
TEST_F(HubTest, OverwritesTheFieldsThatOnlyTheHubSets) {
  const auto consumer = make_consumer(node_, hub_, recorder_, everything());
  alignas(16) std::array<std::byte, 3 * kEventHeaderSize> memory{};
  EventWriter writer(memory);
  ASSERT_TRUE(writer.put({.type = kTimeoutType}, {}));
  ASSERT_TRUE(writer.put({.type = kLinkType}, {}));
  ASSERT_TRUE(writer.put({.type = kPose,
                          .hub_received = at(1),
                          .hub_sent = at(1),
                          .priority = 9,
                          .is_replayed = true,
                          .is_continued = true,
                          .supplier_tag = 77},
                         {}));
  const MonotonicTime before = rt::now();
  hub_.hub().push(1, writer.bytes(), 5);
  ASSERT_TRUE(recorder_.await_deliveries(1));
  EXPECT_EQ(recorder_.text(), "5.0#0");
  const EventHeader& header = recorder_.last_header_;
  EXPECT_GE(header.hub_received, before);
  EXPECT_GE(header.hub_sent, before);
  EXPECT_EQ(header.priority, Priority(5));
  EXPECT_FALSE(header.is_continued);
  EXPECT_NE(header.supplier_tag, 77U);
  EXPECT_EQ(hub_.hub().intake().bad_count, 2U);
}

// ev-5.1-1: this includes the supplier whose number is 0.
TEST_F(HubTest, TagsTheEventsOfEverySupplier) {
  const auto consumer = make_consumer(node_, hub_, recorder_, everything());
  alignas(16) std::array<std::byte, kEventHeaderSize> memory{};
  EventWriter writer(memory);
  ASSERT_TRUE(writer.put({.type = kPose}, {}));
  std::vector<std::uint32_t> tags;
  for (const std::uint64_t supplier : {std::uint64_t{0}, std::uint64_t{0}, std::uint64_t{1}}) {
    hub_.hub().push(supplier, writer.bytes(), 5);
    ASSERT_TRUE(recorder_.await_deliveries(tags.size() + 1));
    tags.push_back(recorder_.last_header_.supplier_tag);
    EXPECT_NE(tags.back(), 0U);
  }
  EXPECT_EQ(tags[0], tags[1]);
  EXPECT_NE(tags[0], tags[2]);
}

TEST_F(HubTest, LateJoinerGetsTheLatchedValueAndTimeouts) {
  const auto supplier = make_supplier(node_, hub_);
  push(*supplier, kPose);
  push(*supplier, kPose);
  Recorder early;
  const auto other = make_consumer(node_, hub_, early, of_type(kButton));
  push(*supplier, kButton);
  // The hub has stored the events that it delivered.
  ASSERT_TRUE(early.await_deliveries(1));
  const auto consumer =
      make_consumer(node_, hub_, recorder_, any_of({of_type(kPose), once(1ms, 9)}), {.replay = 1});
  ASSERT_TRUE(recorder_.await_deliveries(2));
  EXPECT_EQ(recorder_.text(), "~5.0#2 @9");
}

TEST_F(HubTest, SubscriptionIsChangedSuspendedAndResumed) {
  const auto supplier = make_supplier(node_, hub_);
  const auto consumer = make_consumer(node_, hub_, recorder_, of_type(kPose));
  change_suspend_and_resume(hub_.hub(), *supplier, *consumer, recorder_);
  const auto refused = consumer->change(where(99, "z", Comparison::kLess, {}), {});
  ASSERT_FALSE(refused);
  rtpm::test::expect_text(refused.error().text(), {"'z'"});
  ASSERT_TRUE(recorder_.await_notice(NoticeKind::kLosses));
  EXPECT_EQ(recorder_.notice(NoticeKind::kLosses).losses.suspended_count, 1U);
}

TEST_F(HubTest, SubscriptionSurvivesARestartOfTheHub) {
  const auto supplier = make_supplier(node_, hub_);
  const auto consumer = make_consumer(node_, hub_, recorder_, of_type(kPose));
  push(*supplier, kPose);
  ASSERT_TRUE(recorder_.await_deliveries(1));
  hub_.stop();
  ASSERT_TRUE(recorder_.await_notice(NoticeKind::kInterrupted));
  hub_.start();
  ASSERT_TRUE(recorder_.await_notice(NoticeKind::kResubscribed));
  EXPECT_TRUE(recorder_.notice(NoticeKind::kResubscribed).has_hub_restarted);
  EXPECT_GT(recorder_.notice(NoticeKind::kResubscribed).gap, 0ns);
  ASSERT_TRUE(await([&] {
    static_cast<void>(supplier->push({.type = kPose}));
    return recorder_.text().find(' ') != std::string::npos;
  }));
  EXPECT_EQ(consumer->counters().resubscription_count, 1U);
}

TEST_F(HubTest, SubscriptionThatIsRefusedAfterARestartEndsWithTheReason) {
  const auto added = hub_.hub().add_type(kPoseDescriptor);
  ASSERT_TRUE(added);
  const auto consumer =
      make_consumer(node_, hub_, recorder_, where(kPose, "x", Comparison::kLess, Scalar::of(1)));
  hub_.stop();
  hub_.start();
  // The new hub does not know the type.
  ASSERT_TRUE(recorder_.await_notice(NoticeKind::kEnded));
  rtpm::test::expect_text(recorder_.texts_.back(), {"'x'"});
}

TEST_F(HubTest, HandlerMayUnsubscribeInItsCallback) {
  class Leaver final : public Recorder {
   public:
    void on_events(std::span<const EventView> events) override {
      {
        const std::lock_guard lock(mutex_);
        if (consumer == nullptr) return;
      }
      consumer->unsubscribe();
      Recorder::on_events(events);
    }
    void set(Consumer& it) {
      const std::lock_guard lock(mutex_);
      consumer = &it;
    }
    Consumer* consumer = nullptr;
  };
  Leaver leaver;
  const auto supplier = make_supplier(node_, hub_);
  const auto consumer = make_consumer(node_, hub_, leaver, of_type(kPose));
  leaver.set(*consumer);
  push(*supplier, kPose);
  push(*supplier, kPose);
  ASSERT_TRUE(leaver.await_notice(NoticeKind::kEnded));
  EXPECT_EQ(leaver.deliveries_.size(), 1U);
  EXPECT_FALSE(consumer->is_subscribed());
}

TEST_F(HubTest, HandlerThatThrowsIsCountedAndGoesOn) {
  class Thrower final : public Recorder {
   public:
    void on_events(std::span<const EventView> events) override {
      Recorder::on_events(events);
      if (events[0].header.sequence == 1) static_cast<void>(std::vector<int>().at(1));
    }
  };
  Thrower thrower;
  const auto supplier = make_supplier(node_, hub_);
  const auto consumer = make_consumer(node_, hub_, thrower, of_type(kPose));
  push(*supplier, kPose);
  push(*supplier, kPose);
  ASSERT_TRUE(thrower.await_deliveries(2));
  ASSERT_TRUE(thrower.await_notice(NoticeKind::kHandlerFailed));
  EXPECT_EQ(consumer->counters().handler_failure_count, 1U);
}

TEST_F(HubTest, FreesTheSlotsOfDisconnectedConsumers) {
  for (int i = 0; i < 3; ++i) {
    const auto consumer = make_consumer(node_, hub_, recorder_, everything());
    EXPECT_GE(hub_.hub().subscription_count(), 1U);
  }
  EXPECT_TRUE(await([&] { return hub_.hub().subscription_count() == 0; }));
}

TEST_F(HubTest, CountsAndReportsDisconnects) {
  const auto supplier = make_supplier(node_, hub_);
  Sleeper full;
  Sleeper silent;
  static_cast<void>(make_consumer(node_, hub_, recorder_, of_type(kGaze)));
  const auto ends = make_consumer(node_, hub_, full, of_type(kPose),
                                  {.when_full = QueuePolicy::kDisconnect, .queue_capacity = 4});
  const auto hangs = rtpm::test::made(Consumer::create(node_, hub_.url(),
                                                       {.name = "hanging",
                                                        .filter = of_type(kButton),
                                                        .realtime = rt::RealtimeMode::kOff,
                                                        .shared_ring = false,
                                                        .miss_count_max = rpc::kMissCountMin,
                                                        .deadline = kPatience},
                                                       silent));
  push(*supplier, kButton);
  ASSERT_TRUE(silent.await_deliveries(1));
  for (int i = 0; i < 1000; ++i)
    push(*supplier, kPose);
  const auto counters = [&] { return hub_.hub().disconnect_counters(); };
  EXPECT_TRUE(await([&] {
    return counters().unsubscribed_count > 0 && counters().silent_count > 0 &&
           counters().queue_full_count > 0;
  }));
  EXPECT_EQ(counters().unsubscribed_count, 1U);
  EXPECT_EQ(counters().silent_count, 1U);
  EXPECT_GE(counters().queue_full_count, 1U);
  const auto disconnects = hub_.hub().disconnects();
  const auto found = std::ranges::find(disconnects, "hanging", &Disconnect::name);
  ASSERT_NE(found, disconnects.end());
  EXPECT_EQ(found->reason, DisconnectReason::kSilent);
  EXPECT_TRUE(hub_.hub().disconnects(disconnects.back().number).empty());
  silent.release();
  full.release();
}

TEST_F(HubTest, RefusesAHeartbeatMissCountOutOfBounds) {
  for (const std::uint32_t count : {rpc::kMissCountMin - 1, rpc::kMissCountMax + 1}) {
    const auto refused = Consumer::create(node_, hub_.url(), {.miss_count_max = count}, recorder_);
    ASSERT_FALSE(refused);
    rtpm::test::expect_text(refused.error().text(), {"2 to 6"});
  }
}

TEST_F(HubTest, SleepingConsumersKeepToTheirPolicyAndReportTheirLosses) {
  Sleeper oldest;
  Sleeper latest;
  const auto supplier = make_supplier(node_, hub_);
  const auto first = make_consumer(node_, hub_, oldest, of_type(kPose), {.queue_capacity = 4});
  const auto second = make_consumer(node_, hub_, latest, of_type(kPose),
                                    {.when_full = QueuePolicy::kKeepLatest, .queue_capacity = 4});
  const auto quick = make_consumer(node_, hub_, recorder_, of_type(kPose));
  constexpr std::size_t kCount = 1000;
  for (std::size_t i = 1; i <= kCount; ++i) {
    push(*supplier, kPose);
    ASSERT_TRUE(recorder_.await_deliveries(i));
  }
  EXPECT_EQ(quick->counters().losses, Losses{});
  for (Sleeper* const each : {&oldest, &latest}) {
    each->release();
    ASSERT_TRUE(
        each->await([&](const Recorder& it) { return it.last_header_.sequence == kCount; }));
  }
  ASSERT_TRUE(oldest.await_notice(NoticeKind::kLosses));
  EXPECT_EQ(first->counters().event_count + first->counters().losses.overflow_count, kCount);
  // The other one gets events delivered or in flight when it fell asleep, then the newest.
  EXPECT_LE(latest.deliveries_.size(), 6U);
  EXPECT_EQ(second->counters().event_count + second->counters().losses.replaced_count, kCount);
}

TEST_F(HubTest, DisconnectingPolicyReportsWhyAndResubscribes) {
  Sleeper sleeper;
  const auto supplier = make_supplier(node_, hub_);
  const auto slow = make_consumer(node_, hub_, sleeper, of_type(kPose),
                                  {.when_full = QueuePolicy::kDisconnect, .queue_capacity = 4});
  for (int i = 0; i < 1000; ++i)
    push(*supplier, kPose);
  ASSERT_TRUE(sleeper.await_deliveries(1));
  sleeper.release();
  ASSERT_TRUE(sleeper.await_notice(NoticeKind::kInterrupted));
  rtpm::test::expect_text(sleeper.texts_[1], {"queue was full"});
  ASSERT_TRUE(sleeper.await_notice(NoticeKind::kResubscribed));
  EXPECT_FALSE(sleeper.notice(NoticeKind::kResubscribed).has_hub_restarted);
}

TEST(HubLimits, FloodingSupplierAffectsNoOther) {
  ServedHub hub({.quota = {.events_per_s = 100, .bytes_per_s = 1e6, .burst_s = 0.1}});
  rpc::Node node;
  Recorder recorder;
  const auto flooder = make_supplier(node, hub);
  const auto other = make_supplier(node, hub);
  const auto consumer = make_consumer(node, hub, recorder, of_type(kButton));
  for (int i = 0; i < 1000; ++i)
    push(*flooder, kPose);
  push(*other, kButton);
  ASSERT_TRUE(recorder.await_deliveries(1));
  EXPECT_TRUE(await([&] { return flooder->intake().over_quota_count > 0; }));
  EXPECT_GT(flooder->intake().over_quota_count, 500U);
  EXPECT_EQ(other->intake().over_quota_count, 0U);
}

TEST(HubLimits, EventThatIsTooLargeIsRefusedAtOnce) {
  ServedHub hub;
  rpc::Node node;
  const auto supplier = make_supplier(node, hub);
  const std::vector<std::byte> payload(65'537);
  EXPECT_EQ(supplier->push({.type = kPose, .payload = payload}).error(), rpc::CallError::kTooLarge);
}

TEST(HubLimits, RefusesASubscriptionAboveTheLimit) {
  ServedHub hub({.limits = {.subscription_count_max = 1}});
  rpc::Node node;
  Recorder recorder;
  const auto first = make_consumer(node, hub, recorder, everything());
  const auto second = Consumer::create(
      node, hub.url(), {.realtime = rt::RealtimeMode::kOff, .deadline = kPatience}, recorder);
  ASSERT_FALSE(second);
}

TEST(HubLimits, MissingHubIsReported) {
  rpc::Node node;
  Recorder recorder;
  const auto consumer =
      Consumer::create(node, "rtpm://127.0.0.1:1/rtpm/events",
                       {.realtime = rt::RealtimeMode::kOff, .deadline = 100ms}, recorder);
  ASSERT_FALSE(consumer);
  rtpm::test::expect_text(consumer.error().text(), {"127.0.0.1:1"});
}

}  // namespace
}  // namespace rtpm::events::test
