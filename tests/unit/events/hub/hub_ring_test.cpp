#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <vector>

#include "rtpm/rt/clock.hpp"
#include "rtpm/transport/broadcast_memory.hpp"
#include "served_hub.hpp"

// Consumers that read the hub's ring behave like those of a stream.
namespace rtpm::events::test {
namespace {

using namespace std::chrono_literals;

class HubRing : public testing::Test {
 protected:
  [[nodiscard]] std::unique_ptr<Consumer> join(EventHandler& handler, const Filter& filter,
                                               const DeliveryPolicy& delivery = {}) {
    auto consumer =
        make_consumer(node_, hub_, handler, filter, delivery, rpc::Transport::kAuto, true);
    EXPECT_TRUE(consumer != nullptr && consumer->reads_ring());
    return consumer;
  }
  ServedHub hub_{};
  rpc::Node node_{};
  Recorder recorder_{};
};

TEST_F(HubRing, EachConsumerGetsWhatItsFilterAccepts) {
  expect_filtered_deliveries(node_, hub_, [this](EventHandler& handler, const Filter& filter) {
    return join(handler, filter);
  });
}

TEST_F(HubRing, DeliversTimeoutsAndReplays) {
  const auto supplier = make_supplier(node_, hub_);
  push(*supplier, kPose);
  Recorder early;
  const auto other = join(early, of_type(kButton));
  push(*supplier, kButton);
  ASSERT_TRUE(early.await_deliveries(1));
  const auto consumer = join(recorder_, any_of({of_type(kPose), once(1ms, 9)}), {.replay = 1});
  ASSERT_TRUE(recorder_.await_deliveries(2));
  EXPECT_EQ(recorder_.text(), "~5.0#1 @9");
}

TEST_F(HubRing, DeliversLargeEventsWhole) {
  const auto supplier = make_supplier(node_, hub_);
  const auto consumer = join(recorder_, of_type(kPose));
  const auto payload = large_payload();
  ASSERT_TRUE(supplier->push({.type = kPose, .payload = payload}));
  ASSERT_TRUE(recorder_.await_deliveries(1));
  EXPECT_EQ(recorder_.last_payload_, payload);
}

TEST_F(HubRing, IsChangedSuspendedResumedAndEnded) {
  const auto supplier = make_supplier(node_, hub_);
  const auto consumer = join(recorder_, of_type(kPose));
  change_suspend_and_resume(hub_.hub(), *supplier, *consumer, recorder_);
  ASSERT_TRUE(recorder_.await_notice(NoticeKind::kLosses));
  EXPECT_EQ(recorder_.notice(NoticeKind::kLosses).losses.suspended_count, 1U);
  consumer->unsubscribe();
  EXPECT_TRUE(recorder_.has(NoticeKind::kEnded));
}

TEST_F(HubRing, SleepingConsumerKeepsToItsPolicyAndReportsItsLosses) {
  Sleeper oldest;
  Sleeper latest;
  const auto supplier = make_supplier(node_, hub_);
  const auto first = join(oldest, of_type(kPose), {.queue_capacity = 4});
  const auto second =
      join(latest, of_type(kPose), {.when_full = QueuePolicy::kKeepLatest, .queue_capacity = 2});
  const auto quick = join(recorder_, of_type(kPose), {.queue_capacity = 1000});
  push(*supplier, kPose);
  ASSERT_TRUE(oldest.await_deliveries(1));
  ASSERT_TRUE(latest.await_deliveries(1));
  for (int i = 0; i < 100; ++i)
    push(*supplier, kPose);
  ASSERT_TRUE(recorder_.await_deliveries(101));
  oldest.release();
  latest.release();
  ASSERT_TRUE(oldest.await_deliveries(5));
  ASSERT_TRUE(latest.await_deliveries(2));
  EXPECT_EQ(oldest.text(), "5.0#1 5.0#98 5.0#99 5.0#100 5.0#101");
  EXPECT_EQ(latest.text(), "5.0#1 5.0#101");
  ASSERT_TRUE(oldest.await_notice(NoticeKind::kLosses));
  EXPECT_EQ(first->counters().losses.overflow_count, 96U);
  ASSERT_TRUE(latest.await_notice(NoticeKind::kLosses));
  EXPECT_EQ(second->counters().losses.replaced_count, 99U);
  EXPECT_EQ(quick->counters().losses, Losses{});
}

TEST_F(HubRing, TheLargestQueueIsTheRing) {
  Sleeper sleeper;
  const auto supplier = make_supplier(node_, hub_);
  const auto slow = join(sleeper, of_type(kPose), {.queue_capacity = kQueueCapacityMax});
  const auto quick = join(recorder_, of_type(kPose), {.queue_capacity = kQueueCapacityMax});
  push(*supplier, kPose);
  ASSERT_TRUE(sleeper.await_deliveries(1));
  constexpr std::size_t kCount = 2 * kQueueCapacityMax;
  for (std::size_t i = 1; i <= kCount; ++i)
    push(*supplier, kPose);
  ASSERT_TRUE(recorder_.await_deliveries(kCount + 1));
  sleeper.release();
  ASSERT_TRUE(sleeper.await_deliveries(kCount + 1));
  EXPECT_EQ(slow->counters().losses, Losses{});
}

TEST(HubRingLimits, AQueueThatIsTheRingDropsTheOldestEvents) {
  ServedHub hub({.ring_size = 64 * 1024});
  rpc::Node node;
  Sleeper sleeper;
  Recorder quick;
  const auto supplier = make_supplier(node, hub);
  const DeliveryPolicy delivery{.queue_capacity = kQueueCapacityMax};
  const auto slow = make_consumer(node, hub, sleeper, of_type(kPose), delivery,
                                  rpc::Transport::kAuto, /*shared_ring=*/true);
  const auto other = make_consumer(node, hub, quick, of_type(kPose));
  push(*supplier, kPose);
  ASSERT_TRUE(sleeper.await_deliveries(1));
  // More than half of the ring, and less than all of it.
  constexpr std::size_t kCount = 12;
  const std::vector<std::byte> large(4000);
  for (std::size_t i = 2; i <= kCount; ++i) {
    ASSERT_TRUE(supplier->push({.type = kPose, .payload = large}));
    ASSERT_TRUE(quick.await_deliveries(i));
  }
  sleeper.release();
  ASSERT_TRUE(sleeper.await_notice(NoticeKind::kLosses));
  ASSERT_TRUE(sleeper.await([](const Recorder& it) { return it.last_header_.sequence == kCount; }));
  const std::uint64_t lost_count = slow->counters().losses.overrun_count;
  EXPECT_EQ(lost_count + slow->counters().event_count, kCount);
  EXPECT_GE(lost_count, 5U);
}

TEST(HubRingLimits, OverrunConsumerReportsItsLosses) {
  ServedHub hub({.ring_size = 64 * 1024});
  rpc::Node node;
  Sleeper sleeper;
  Recorder quick;
  const auto supplier = make_supplier(node, hub);
  const auto slow = make_consumer(node, hub, sleeper, of_type(kPose), {}, rpc::Transport::kAuto,
                                  /*shared_ring=*/true);
  const auto other = make_consumer(node, hub, quick, of_type(kPose));
  push(*supplier, kPose);
  ASSERT_TRUE(sleeper.await_deliveries(1));
  // Large events, a few times the ring's capacity: fewer events delay the sleeper less.
  constexpr std::size_t kCount = 100;
  const std::vector<std::byte> large(4000);
  for (std::size_t i = 2; i <= kCount; ++i) {
    ASSERT_TRUE(supplier->push({.type = kPose, .payload = large}));
    ASSERT_TRUE(quick.await_deliveries(i));
  }
  sleeper.release();
  ASSERT_TRUE(sleeper.await([&](const Recorder& it) {
    return !it.notices_.empty() && it.notices_.back().losses.overrun_count > 0;
  }));
  push(*supplier, kPose);
  ASSERT_TRUE(
      sleeper.await([&](const Recorder& it) { return it.last_header_.sequence == kCount + 1; }));
  const ConsumerCounters counters = slow->counters();
  EXPECT_EQ(counters.event_count + counters.losses.total(), kCount + 1);
}

/// A hub in its own process, which the test kills. Created before the test starts a thread.
class ChildHub {
 public:
  ChildHub() {
    std::array<int, 2> ends{};
    EXPECT_EQ(pipe(ends.data()), 0);
    process_ = fork();
    if (process_ == 0) serve(ends[1]);
    close(ends[1]);
    std::array<char, 256> text{};
    const ssize_t size = read(ends[0], text.data(), text.size());
    EXPECT_GT(size, 0);
    url_.assign(text.data(), static_cast<std::size_t>(std::max<ssize_t>(size, 0)));
    close(ends[0]);
  }
  ~ChildHub() { kill(); }
  ChildHub(const ChildHub&) = delete;
  ChildHub& operator=(const ChildHub&) = delete;
  [[nodiscard]] const std::string& url() const { return url_; }
  void kill() {
    if (process_ <= 0) return;
    ::kill(process_, SIGKILL);
    waitpid(process_, nullptr, 0);
    process_ = 0;
  }

 private:
  [[noreturn]] static void serve(int output) {
    const ServedHub hub;
    const std::string url = hub.url();
    static_cast<void>(!write(output, url.data(), url.size()));
    while (getppid() != 1)
      rt::sleep_until(rt::now() + 10ms);
    _exit(0);
  }
  pid_t process_ = 0;
  std::string url_{};
};

// A reader of the ring of a killed hub is notified by the system, not only by missed heartbeats.
TEST(HubRingEnd, DetectsAKilledHubWithoutWaitingForHeartbeats) {
  using Strategy = rt::WaitStrategy;
  for (const auto& [strategy, transport] : {std::pair(Strategy::kAdaptive, rpc::Transport::kAuto),
                                            std::pair(Strategy::kBlock, rpc::Transport::kAuto),
                                            std::pair(Strategy::kAdaptive, rpc::Transport::kTcp)}) {
    for (const bool has_own_thread : {true, false}) {
      ChildHub hub;
      rpc::NodeConfig config;
      config.wait.strategy = strategy;
      rpc::Node node(config);
      std::array<Recorder, 2> recorders;
      std::vector<std::unique_ptr<Consumer>> consumers;
      for (Recorder& each : recorders) {
        consumers.push_back(rtpm::test::made(Consumer::create(node, hub.url(),
                                                              {.filter = of_type(kPose),
                                                               .realtime = rt::RealtimeMode::kOff,
                                                               .transport = transport,
                                                               .has_own_thread = has_own_thread,
                                                               .deadline = kPatience},
                                                              each)));
        EXPECT_TRUE(consumers.back()->reads_ring());
      }
      hub.kill();
      for (Recorder& each : recorders) {
        ASSERT_TRUE(each.await_notice(NoticeKind::kInterrupted));
        EXPECT_EQ(each.notice_text(NoticeKind::kInterrupted).find("signs of life"),
                  std::string::npos)
            << each.notice_text(NoticeKind::kInterrupted);
      }
    }
  }
}

TEST(HubRingLimits, HubWithoutARingServesStreams) {
  ServedHub hub({.ring_size = 0});
  rpc::Node node;
  Recorder recorder;
  const auto supplier = make_supplier(node, hub);
  const auto consumer = make_consumer(node, hub, recorder, of_type(kPose), {},
                                      rpc::Transport::kAuto, /*shared_ring=*/true);
  EXPECT_FALSE(consumer->reads_ring());
  push(*supplier, kPose);
  EXPECT_TRUE(recorder.await_deliveries(1));
}

TEST(HubRingLimits, RingOfAnImpossibleSizeIsRefused) {
  const auto hub = Hub::create({.realtime = rt::RealtimeMode::kOff, .ring_size = 100'000});
  ASSERT_FALSE(hub);
  rtpm::test::expect_text(hub.error().text(), {"100000"});
}

TEST(HubRingLimits, RingThatTheSystemDoesNotOfferIsRefused) {
  if (transport::offers_broadcast_memory()) GTEST_SKIP() << "this system offers rings";
  const auto hub = Hub::create({.realtime = rt::RealtimeMode::kOff, .ring_size = 64 * 1024});
  ASSERT_FALSE(hub);
  rtpm::test::expect_text(hub.error().text(),
                          {"offers no events through shared memory", "Remedy", "no ring"});
}

}  // namespace
}  // namespace rtpm::events::test
