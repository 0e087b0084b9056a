#include <gtest/gtest.h>
#include <signal.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "../programs.hpp"
#include "rtpm/events/consumer.hpp"
#include "rtpm/events/defaults.hpp"
#include "rtpm/events/supplier.hpp"
#include "rtpm/rpc/node.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/test/os.hpp"

// When a hub is killed: a supplier's view of its events, over each transport, and a consumer's view
// of the hub.
namespace rtpm::system_test {
namespace {

using namespace std::chrono_literals;
using rtpm::test::await;

constexpr events::EventType kTick = 5;

/// Records the numbers of events.
class Numbers final : public events::EventHandler {
 public:
  void on_events(std::span<const events::EventView> some) override {
    const std::lock_guard lock(mutex_);
    numbers_.push_back(some[0].header.sequence);
  }
  void on_notice(const events::Notice& notice) override {
    if (notice.kind == events::NoticeKind::kResubscribed) ++resubscription_count_;
  }
  [[nodiscard]] std::vector<std::uint64_t> numbers() const {
    const std::lock_guard lock(mutex_);
    return numbers_;
  }
  [[nodiscard]] std::uint64_t last() const {
    const std::lock_guard lock(mutex_);
    return numbers_.empty() ? 0 : numbers_.back();
  }
  [[nodiscard]] int resubscription_count() const { return resubscription_count_; }

 private:
  mutable std::mutex mutex_;
  std::vector<std::uint64_t> numbers_;
  std::atomic<int> resubscription_count_{0};
};

class HubRestart : public testing::TestWithParam<rpc::Transport> {
 protected:
  void SetUp() override {
    start_hub(0);
    ASSERT_TRUE(hub_);
    auto supplier = events::Supplier::create(
        node_, hub_->url, {.attend_interval = 20ms, .transport = GetParam(), .deadline = 10s});
    ASSERT_TRUE(supplier) << supplier.error().text();
    supplier_ = std::move(*supplier);
    auto consumer =
        events::Consumer::create(node_, hub_->url,
                                 {.filter = events::of_type(kTick),
                                  .delivery = {.queue_capacity = events::kQueueCapacityMax},
                                  .realtime = rt::RealtimeMode::kOff,
                                  .shared_ring = false,
                                  .deadline = 10s},
                                 numbers_);
    ASSERT_TRUE(consumer) << consumer.error().text();
    consumer_ = std::move(*consumer);
  }
  void start_hub(std::uint16_t port) {
    hub_ = start_daemon("rtpm-eventd",
                        {"--port", std::to_string(port), "--name", "", "--realtime", "off"});
  }
  void restart_hub() {
    const std::uint16_t port = hub_->port();
    hub_->process.send_signal(SIGKILL);
    ASSERT_TRUE(hub_->process.wait(kPatience));
    start_hub(port);
    ASSERT_TRUE(hub_);
    ASSERT_TRUE(await([&] { return numbers_.resubscription_count() > 0; }));
  }
  [[nodiscard]] expected<void, rpc::CallError> push() { return supplier_->push({.type = kTick}); }
  void push_all(int count) {
    for (int i = 0; i < count; ++i) {
      const auto pushed = push();
      ASSERT_TRUE(pushed) << to_string(pushed.error());
    }
  }
  /// Pushes until a push is refused.
  [[nodiscard]] rpc::CallError push_until_refused() {
    std::optional<rpc::CallError> error;
    EXPECT_TRUE(await([&] {
      const auto pushed = push();
      if (!pushed) error = pushed.error();
      return !pushed;
    }));
    return error.value_or(rpc::CallError::kTimeout);
  }
  /// The counters once the hub has counted the last of the events.
  [[nodiscard]] events::SupplierCounters settled() {
    EXPECT_TRUE(await([&] { return supplier_->counters().unconfirmed_count == 0; }));
    return supplier_->counters();
  }
  [[nodiscard]] std::uint64_t pushed_count() const {
    const auto counters = supplier_->counters();
    return counters.sent_count + counters.failed_count;
  }
  /// The numbers that are missing up to the last one.
  [[nodiscard]] std::uint64_t missing_count() const {
    const auto numbers = numbers_.numbers();
    EXPECT_TRUE(std::ranges::is_sorted(numbers));
    return numbers.empty() ? 0 : numbers.back() - numbers.size();
  }

  std::optional<Daemon> hub_{};
  rpc::Node node_{};
  Numbers numbers_{};
  std::unique_ptr<events::Supplier> supplier_{};
  std::unique_ptr<events::Consumer> consumer_{};
};

INSTANTIATE_TEST_SUITE_P(Udp, HubRestart, testing::Values(rpc::Transport::kUdp));
INSTANTIATE_TEST_SUITE_P(Tcp, HubRestart, testing::Values(rpc::Transport::kTcp));
INSTANTIATE_TEST_SUITE_P(SharedMemory, HubRestart, testing::Values(rpc::Transport::kSharedMemory));

TEST_P(HubRestart, IsReportedToTheSupplierWithTheGapThatConsumersSee) {
  push_all(100);
  ASSERT_TRUE(await([&] { return numbers_.last() == 100; }));
  EXPECT_EQ(settled().maybe_lost_count, 0U);
  hub_->process.stop();
  push_all(200);
  restart_hub();
  EXPECT_EQ(push_until_refused(), rpc::CallError::kMaybeLost);
  push_all(100);
  ASSERT_TRUE(await([&] { return numbers_.last() == pushed_count(); }))
      << numbers_.last() << " of " << pushed_count();
  const auto counters = settled();
  EXPECT_EQ(counters.failed_count, 1U);
  EXPECT_GE(counters.maybe_lost_count, 200U);
  // A datagram is refused only after it was sent.
  EXPECT_LE(counters.maybe_lost_count, GetParam() == rpc::Transport::kUdp ? 250U : 200U);
  EXPECT_EQ(counters.maybe_lost_count + counters.failed_count, missing_count());
}

TEST_P(HubRestart, CostsNothingWhereTheHubHadCountedAll) {
  push_all(100);
  ASSERT_TRUE(await([&] { return numbers_.last() == 100; }));
  EXPECT_EQ(settled().maybe_lost_count, 0U);
  restart_hub();
  // Only over UDP does a supplier send events before it notices that the hub is another one.
  ASSERT_TRUE(await([&] {
    const bool is_pushed = push().has_value();
    EXPECT_TRUE(is_pushed || GetParam() == rpc::Transport::kUdp);
    return numbers_.last() > 100;
  }));
  push_all(100);
  ASSERT_TRUE(await([&] { return numbers_.last() == pushed_count(); }));
  const auto counters = settled();
  EXPECT_EQ(counters.maybe_lost_count + counters.failed_count, missing_count());
  if (GetParam() != rpc::Transport::kUdp) {
    EXPECT_EQ(counters.maybe_lost_count, 0U);
  }
}

TEST_P(HubRestart, IsReportedToAnIdleSupplier) {
  push_all(100);
  EXPECT_EQ(settled().maybe_lost_count, 0U);
  hub_->process.stop();
  push_all(20);
  restart_hub();
  // No UDP datagram is in flight that a host could refuse, so the count stays open.
  if (GetParam() == rpc::Transport::kUdp) {
    EXPECT_EQ(supplier_->counters().unconfirmed_count, 20U);
    return;
  }
  EXPECT_TRUE(await([&] { return supplier_->counters().maybe_lost_count == 20; }));
  EXPECT_EQ(push().error(), rpc::CallError::kMaybeLost);
  EXPECT_TRUE(push());
}

TEST_P(HubRestart, CountsEventsRefusedWithoutAHub) {
  push_all(10);
  EXPECT_EQ(settled().maybe_lost_count, 0U);
  const std::uint16_t port = hub_->port();
  hub_->process.send_signal(SIGKILL);
  ASSERT_TRUE(hub_->process.wait(kPatience));
  std::uint64_t refused = 0;
  std::uint64_t sent = 10;
  for (int i = 0; i < 50; ++i)
    ++(push() ? sent : refused);
  EXPECT_GT(refused, 40U) << "the end is reported";
  EXPECT_EQ(supplier_->counters().sent_count, sent);
  EXPECT_EQ(supplier_->counters().failed_count, refused);
  start_hub(port);
  ASSERT_TRUE(hub_);
  ASSERT_TRUE(await([&] { return push().has_value(); }));
  ASSERT_TRUE(await([&] { return numbers_.resubscription_count() > 0; }));
  push_all(10);
  ASSERT_TRUE(await([&] { return numbers_.last() == pushed_count(); }));
}

}  // namespace
}  // namespace rtpm::system_test
