#include <gtest/gtest.h>

#include <atomic>
#include <set>
#include <thread>
#include <vector>

#include "loopback_multicast.hpp"
#include "rtpm/rt/clock.hpp"
#include "served_hub.hpp"

// Consumers of one program that share a thread for the hub's ring or multicast do not affect each
// other.
namespace rtpm::events::test {
namespace {

/// Records the calling thread and the number of calls, and runs the test's function.
class Noter final : public EventHandler {
 public:
  void on_events(std::span<const EventView> events) override {
    thread = std::this_thread::get_id();
    is_in_order = is_in_order && events[0].header.sequence > last;
    ++count;
    // Written last, because the test waits for it.
    last = events[0].header.sequence;
    if (act) act();
  }
  std::atomic<std::thread::id> thread{};
  std::atomic<std::uint64_t> last{0};
  std::atomic<std::uint64_t> count{0};
  std::atomic<bool> is_in_order{true};
  std::function<void()> act{};  ///< Set before its consumer is made.
};

enum class Way : std::uint8_t { kRing, kMulticast, kLossyMulticast };

class HubCommonReader : public testing::TestWithParam<Way> {
 protected:
  void SetUp() override {
    if (GetParam() != Way::kRing && !has_multicast()) GTEST_SKIP() << kNeedsMulticast;
    if (GetParam() == Way::kLossyMulticast) lose_every(5);
  }
  void TearDown() override { lose_every(0); }
  [[nodiscard]] static HubConfig config() {
    HubConfig config;
    if (GetParam() != Way::kRing) config.multicast = MulticastConfig{.group = group_of_mine()};
    return config;
  }
  [[nodiscard]] std::unique_ptr<Consumer> join(EventHandler& handler, bool has_own_thread = false) {
    auto consumer = rtpm::test::made(Consumer::create(node_, hub_.url(),
                                                      {.filter = of_type(kPose),
                                                       .delivery = {.queue_capacity = 4096},
                                                       .realtime = rt::RealtimeMode::kOff,
                                                       .shared_ring = GetParam() == Way::kRing,
                                                       .has_own_thread = has_own_thread,
                                                       .multicast = GetParam() != Way::kRing,
                                                       .multicast_interface = kLoopback,
                                                       .deadline = kPatience},
                                                      handler));
    if (!consumer) return nullptr;
    EXPECT_EQ(consumer->reads_ring(), GetParam() == Way::kRing);
    EXPECT_EQ(consumer->receives_multicast(), GetParam() != Way::kRing);
    return consumer;
  }
  /// Pushes until one thread calls all handlers. On a busy machine one may seem slow for a while.
  [[nodiscard]] bool await_common(const std::vector<Noter*>& noters) {
    return rtpm::test::await(
        [&] {
          const std::uint64_t number = ++pushed_;
          push(*supplier_, kPose);
          if (!await_number(noters, number)) return false;
          return std::ranges::all_of(noters, [&](const Noter* each) {
            return each->thread.load() == noters[0]->thread.load();
          });
        },
        3 * kPatience);
  }
  [[nodiscard]] static bool await_number(const std::vector<Noter*>& noters, std::uint64_t number) {
    return await([&] {
      return std::ranges::all_of(noters, [&](const Noter* each) { return each->last >= number; });
    });
  }
  ServedHub hub_{config()};
  rpc::Node node_{};
  std::unique_ptr<Supplier> supplier_ = make_supplier(node_, hub_);
  std::uint64_t pushed_ = 0;
};

TEST_P(HubCommonReader, OneThreadServesConsumersWithoutTheirOwn) {
  Noter first;
  Noter second;
  Noter third;
  Noter apart;
  const auto a = join(first);
  const auto b = join(second);
  const auto c = join(third);
  const auto d = join(apart, /*has_own_thread=*/true);
  ASSERT_TRUE(await_common({&first, &second, &third}));
  EXPECT_TRUE(await_number({&apart}, pushed_));
  EXPECT_NE(apart.thread.load(), first.thread.load());
}

TEST_P(HubCommonReader, BlockingHandlersDelayNoOtherConsumer) {
  std::atomic<bool> shall_block{false};
  std::atomic<int> blocked_count{0};
  const auto block = [&] {
    if (!shall_block) return;
    ++blocked_count;
    EXPECT_TRUE(await([&] { return !shall_block; }));
  };
  Noter quick;
  Noter other;
  Noter stuck;
  Noter stuck_too;
  stuck.act = block;
  stuck_too.act = block;
  const auto a = join(stuck);
  const auto b = join(quick);
  const auto c = join(stuck_too);
  const auto d = join(other);
  ASSERT_TRUE(await_common({&quick, &other, &stuck, &stuck_too}));
  shall_block = true;
  for (int i = 0; i < 100; ++i) {
    ++pushed_;
    push(*supplier_, kPose);
    ASSERT_TRUE(await_number({&quick, &other}, pushed_));
  }
  EXPECT_TRUE(await([&] { return blocked_count == 2; }));
  EXPECT_EQ(stuck.last, pushed_ - 99);
  shall_block = false;
  ASSERT_TRUE(await_number({&stuck, &stuck_too}, pushed_));
  // Fast consumers share a thread again, slow ones keep their own for some time.
  ASSERT_TRUE(await_common({&quick, &other}));
  ASSERT_TRUE(await_number({&stuck, &stuck_too}, pushed_));
  EXPECT_NE(stuck.thread.load(), quick.thread.load());
  for (const Noter* const each : {&quick, &other, &stuck, &stuck_too}) {
    EXPECT_EQ(each->count, pushed_);
    EXPECT_TRUE(each->is_in_order);
  }
}

TEST_P(HubCommonReader, ConsumerMayUnsubscribeInItsHandler) {
  std::unique_ptr<Consumer> leaving;
  std::atomic<bool> shall_leave{false};
  Noter leaver;
  Noter first;
  Noter second;
  leaver.act = [&] {
    if (shall_leave) leaving->unsubscribe();
  };
  leaving = join(leaver);
  const auto a = join(first);
  const auto b = join(second);
  ASSERT_TRUE(await_common({&leaver, &first, &second}));
  const std::uint64_t before = pushed_;
  shall_leave = true;
  ASSERT_TRUE(await_common({&first, &second}));
  leaving.reset();
  EXPECT_EQ(leaver.last, before + 1);
}

TEST_P(HubCommonReader, HandlerMayEndAnotherConsumer) {
  std::unique_ptr<Consumer> victim;
  std::atomic<bool> shall_end{false};
  std::atomic<bool> has_ended{false};
  Noter ended;
  Noter ender;
  Noter other;
  ender.act = [&] {
    if (!shall_end) return;
    victim.reset();
    has_ended = true;
  };
  victim = join(ended);
  const auto a = join(ender);
  const auto b = join(other);
  ASSERT_TRUE(await_common({&ended, &ender, &other}));
  shall_end = true;
  ++pushed_;
  push(*supplier_, kPose);
  ASSERT_TRUE(await_number({&ender, &other}, pushed_));
  EXPECT_TRUE(await([&] { return has_ended.load(); }));
}

TEST_P(HubCommonReader, LosesNothingWhileOthersJoinAndLeave) {
  Noter first;
  Noter second;
  const auto a = join(first);
  const auto b = join(second);
  std::atomic<bool> is_over{false};
  std::thread guests([&] {
    while (!is_over) {
      Noter guest;
      Noter other;
      const auto c = join(guest);
      const auto d = join(other);
      EXPECT_TRUE(await([&] { return is_over || (guest.count > 3 && other.count > 3); }));
      EXPECT_TRUE(guest.is_in_order && other.is_in_order);
    }
  });
  for (int i = 0; i < 2000; ++i) {
    ++pushed_;
    push(*supplier_, kPose);
    if (i % 8 == 0) {
      EXPECT_TRUE(await_number({&first, &second}, pushed_));
    }
  }
  EXPECT_TRUE(await_number({&first, &second}, pushed_));
  is_over = true;
  guests.join();
  EXPECT_EQ(first.count, pushed_);
  EXPECT_EQ(second.count, pushed_);
  EXPECT_EQ(a->counters().losses, Losses{});
}

TEST_P(HubCommonReader, ConsumersResubscribeAfterARestartOfTheHub) {
  Noter first;
  Noter second;
  const auto a = join(first);
  const auto b = join(second);
  ASSERT_TRUE(await_common({&first, &second}));
  hub_.stop();
  ASSERT_TRUE(await([&] { return !a->is_subscribed() && !b->is_subscribed(); }));
  hub_.start();
  ASSERT_TRUE(await([&] { return a->is_subscribed() && b->is_subscribed(); }));
  ASSERT_TRUE(await([&] {
    if (const auto pushed = supplier_->push({.type = kPose}); pushed) ++pushed_;
    return first.last > 0 && first.last == second.last && first.thread == second.thread.load() &&
           first.count > 1;
  }));
  EXPECT_EQ(a->reads_ring(), GetParam() == Way::kRing);
  EXPECT_EQ(a->receives_multicast(), GetParam() != Way::kRing);
}

INSTANTIATE_TEST_SUITE_P(Ways, HubCommonReader,
                         testing::Values(Way::kRing, Way::kMulticast, Way::kLossyMulticast),
                         [](const auto& each) {
                           return std::string(each.param == Way::kRing        ? "ring"
                                              : each.param == Way::kMulticast ? "multicast"
                                                                              : "lossy_multicast");
                         });

}  // namespace
}  // namespace rtpm::events::test
