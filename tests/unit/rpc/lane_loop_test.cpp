#include <gtest/gtest.h>

#include "scripted_lane.hpp"

// A lane's duty cycle, turn by turn.
namespace rtpm::rpc {
namespace {

using namespace test;
using namespace std::chrono_literals;

// One source that has frames without end, and 63 with one each.
TEST(LaneLoop, ServesEachOfItsSourcesHoweverBusyOneIs) {
  for (const rt::WaitStrategy strategy : {rt::WaitStrategy::kSpin, rt::WaitStrategy::kBlock}) {
    ScriptedLane scripted(strategy);
    ScriptedConnection& hot = scripted.connect();
    std::vector<ScriptedConnection*> others;
    for (int i = 0; i < 63; ++i)
      others.push_back(&scripted.connect());
    ScriptedClient hot_client(hot);
    hot.is_endless = true;
    std::vector<std::unique_ptr<ScriptedClient>> clients;
    for (ScriptedConnection* const other : others)
      clients.push_back(std::make_unique<ScriptedClient>(*other));
    std::thread watcher([&] {
      EXPECT_TRUE(await([&] { return scripted.lane->counters().frames.received_count >= 400; }));
      scripted.lane->stop();
    });
    scripted.run();
    watcher.join();
    for (const ScriptedConnection* const other : others) {
      EXPECT_EQ(other->taken_count, 1);
      EXPECT_LE(other->last_taken, 64 + static_cast<int>(Attention::kStreakMax));
    }
    EXPECT_GT(hot.taken_count, 300);
    scripted.lane->close();
  }
}

TEST(LaneLoop, SleepsOnlyWhenThereIsNothingToDoAndThenForEver) {
  ScriptedLane scripted(rt::WaitStrategy::kBlock);
  ScriptedConnection* connection = nullptr;
  std::vector<MonotonicTime> sleeps;
  std::optional<ScriptedClient> client;
  scripted.wait_set->on_sleep = [&](MonotonicTime until) {
    sleeps.push_back(until);
    switch (sleeps.size()) {
      case 1:
        connection = &scripted.connect();
        return;
      case 2:
        client.emplace(*connection);
        return;
      case 3:
        client->begin(echo::kEcho.id);
        return;
      default:
        EXPECT_EQ(connection->sent.size(), 2) << "the welcome and the reply";
        scripted.lane->stop();
    }
  };
  scripted.run();
  EXPECT_EQ(sleeps, std::vector<MonotonicTime>(4, kNever));
  EXPECT_EQ(scripted.servant.order().size(), 1);
  EXPECT_EQ(connection->sent.size(), 3) << "at last it says that it stops";
  scripted.lane->close();
}

TEST(LaneLoop, HearsARingThatComesAsItGoesToSleep) {
  ScriptedLane scripted(rt::WaitStrategy::kBlock);
  int sleep_count = 0;
  scripted.wait_set->on_sleep = [&](MonotonicTime) {
    // Nobody rings a second time for what was handed over now.
    if (++sleep_count < 100) {
      scripted.connect();
    } else {
      scripted.lane->stop();
    }
  };
  scripted.run();
  EXPECT_EQ(sleep_count, 100);
  EXPECT_EQ(scripted.lane->counters().connection_count, 99);
  scripted.lane->close();
}

/// Answers with a stream that it never ends.
class Streaming final : public Servant {
 public:
  const InterfaceDescriptor& interface() const noexcept override { return echo::kInterface; }
  DispatchResult dispatch(std::uint16_t, ConstBytes, MutableBytes,
                          const CallContext& context) override {
    writer = context.deferral->stream();
    return {};
  }
  ItemWriter writer;
};

// A caller that falls silent: the lane wakes by itself when its patience ends, and not before.
TEST(LaneLoop, SleepsNoLongerThanUntilAnOpenCallIsDue) {
  ScriptedLane scripted(rt::WaitStrategy::kBlock);
  Streaming streaming;
  scripted.add(streaming);
  ScriptedConnection& connection = scripted.connect();
  ScriptedClient client(connection);
  std::vector<MonotonicTime> sleeps;
  MonotonicTime begun{};
  scripted.wait_set->on_sleep = [&](MonotonicTime until) {
    sleeps.push_back(until);
    if (sleeps.size() == 1) {
      begun = rt::now();
      client.begin(echo::kEcho.id, /*stream_window=*/4, /*budget_us=*/20'000, /*service=*/2);
    } else if (until != kNever) {
      EXPECT_TRUE(streaming.writer.is_awaited());
      rt::sleep_until(until);
    } else {
      EXPECT_EQ(streaming.writer.ending(), CallEnding::kSilent);
      scripted.lane->stop();
    }
  };
  scripted.run();
  ASSERT_EQ(sleeps.size(), 3);
  EXPECT_EQ(sleeps.front(), kNever);
  EXPECT_GE(sleeps[1], begun + 20ms);
  EXPECT_LT(sleeps[1], begun + 10s);
  EXPECT_EQ(sleeps.back(), kNever);
  scripted.lane->close();
}

}  // namespace
}  // namespace rtpm::rpc
