#include <gtest/gtest.h>

#include <atomic>
#include <thread>
#include <vector>

#include "rtpm/rt/clock.hpp"
#include "served_hub.hpp"

// Bad input from programs, and actions that consumers may take in their handlers.
namespace rtpm::events::test {
namespace {

using namespace std::chrono_literals;

class HubBadInput : public testing::Test {
 protected:
  ServedHub hub_{};
  rpc::Node node_{};
  Recorder recorder_{};
};

TEST_F(HubBadInput, FilterThatIsTooLargeIsRefused) {
  for (const Filter& filter : {any_of(std::vector<Filter>(1000, of_type(kPose))),
                               listed(std::vector<Match>(kMatchCountMax + 1))}) {
    const auto refused = Consumer::create(
        node_, hub_.url(),
        {.filter = filter, .realtime = rt::RealtimeMode::kOff, .deadline = kPatience}, recorder_);
    ASSERT_FALSE(refused);
    rtpm::test::expect_text(refused.error().text(), {"too large"});
    EXPECT_EQ(hub_.hub().subscription_count(), 0U);
  }
}

TEST(HubBadInputLimits, CountsAnEventLargerThanTheRingAsLost) {
  ServedHub hub({.ring_size = 64 * 1024});
  rpc::Node node;
  Recorder in_ring;
  Recorder in_stream;
  const auto supplier = make_supplier(node, hub);
  const auto first =
      make_consumer(node, hub, in_ring, of_type(kPose), {}, rpc::Transport::kAuto, true);
  const auto second = make_consumer(node, hub, in_stream, of_type(kPose));
  ASSERT_TRUE(first->reads_ring());
  const std::vector<std::byte> payload(60'000);
  ASSERT_TRUE(supplier->push({.type = kPose, .payload = payload}));
  push(*supplier, kPose);
  ASSERT_TRUE(in_stream.await_deliveries(2)) << "a stream takes it in parts";
  ASSERT_TRUE(in_ring.await_deliveries(1));
  EXPECT_EQ(in_ring.text(), "5.0#2");
  ASSERT_TRUE(in_ring.await_notice(NoticeKind::kLosses));
  EXPECT_EQ(first->counters().losses.too_large_count, 1U);
  EXPECT_EQ(second->counters().losses, Losses{});
}

/// Calls a function on its consumer in its first callback.
class Doer final : public Recorder {
 public:
  explicit Doer(std::function<void(Consumer&)> act) : act_(std::move(act)) {}
  void on_events(std::span<const EventView> events) override {
    Recorder::on_events(events);
    if (!has_done_.exchange(true)) {
      consumer_.wait(nullptr);
      act_(*consumer_);
      has_acted_ = true;
    }
  }
  [[nodiscard]] bool has_acted() const noexcept { return has_acted_; }
  void set(Consumer& consumer) {
    consumer_ = &consumer;
    consumer_.notify_all();
  }

 private:
  std::function<void(Consumer&)> act_;
  std::atomic<Consumer*> consumer_{nullptr};
  std::atomic<bool> has_done_{false};
  std::atomic<bool> has_acted_{false};
};

TEST_F(HubBadInput, HandlerMayChangeItsSubscription) {
  Doer doer([](Consumer& consumer) { ASSERT_TRUE(consumer.change(of_type(kButton), {})); });
  const auto supplier = make_supplier(node_, hub_);
  const auto consumer = make_consumer(node_, hub_, doer, of_type(kPose));
  push(*supplier, kPose);
  ASSERT_TRUE(doer.await_deliveries(1));
  doer.set(*consumer);
  ASSERT_TRUE(await([&] {
    push(*supplier, kButton);
    return doer.text().find(' ') != std::string::npos;
  }));
  EXPECT_TRUE(doer.text().starts_with("5.0#1 6.0#")) << doer.text();
}

TEST_F(HubBadInput, HandlerMaySuspendItsSubscription) {
  Doer doer([](Consumer& consumer) { ASSERT_TRUE(consumer.suspend()); });
  const auto supplier = make_supplier(node_, hub_);
  const auto consumer = make_consumer(node_, hub_, doer, of_type(kPose));
  doer.set(*consumer);
  push(*supplier, kPose);
  ASSERT_TRUE(doer.await_deliveries(1));
  ASSERT_TRUE(await([&] { return doer.has_acted(); }));
  push(*supplier, kPose);
  ASSERT_TRUE(await([&] { return hub_.hub().intake().taken_count == 2; }));
  ASSERT_TRUE(consumer->resume());
  EXPECT_TRUE(await([&] { return consumer->counters().losses.suspended_count == 1; }));
  EXPECT_EQ(doer.text(), "5.0#1");
}

TEST_F(HubBadInput, ConsumerThatIsDestroyedInMidCallbackWaitsForIt) {
  Sleeper sleeper;
  const auto supplier = make_supplier(node_, hub_);
  auto consumer = make_consumer(node_, hub_, sleeper, of_type(kPose));
  push(*supplier, kPose);
  ASSERT_TRUE(sleeper.await_deliveries(1));
  std::atomic<bool> is_gone{false};
  std::thread ender([&] {
    consumer.reset();
    is_gone = true;
  });
  // The hub drops it at once; its handler still runs.
  EXPECT_TRUE(await([&] { return hub_.hub().subscription_count() == 0; }));
  EXPECT_FALSE(is_gone);
  sleeper.release();
  ender.join();
  EXPECT_EQ(sleeper.deliveries_.size(), 1U);
}

TEST_F(HubBadInput, SuspensionSurvivesARestartOfTheHub) {
  const auto consumer = make_consumer(node_, hub_, recorder_, of_type(kPose));
  ASSERT_TRUE(consumer->suspend());
  hub_.stop();
  ASSERT_TRUE(recorder_.await_notice(NoticeKind::kInterrupted));
  hub_.start();
  ASSERT_TRUE(recorder_.await_notice(NoticeKind::kResubscribed));
  const auto supplier = make_supplier(node_, hub_);
  push(*supplier, kPose);
  await_taken(hub_.hub(), 1);
  ASSERT_TRUE(consumer->resume());
  push(*supplier, kPose);
  ASSERT_TRUE(recorder_.await_deliveries(1));
  EXPECT_EQ(recorder_.text(), "5.0#2");
}

}  // namespace
}  // namespace rtpm::events::test
