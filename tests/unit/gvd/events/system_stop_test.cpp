#include "rtpm/gvd/system_stop.hpp"

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <mutex>
#include <set>
#include <thread>

#include "served_hub.hpp"

namespace rtpm::gvd {
namespace {

using namespace std::chrono_literals;
using events::test::await;
using events::test::ServedHub;

/// The devices of a program.
class Devices final : public SystemStopDevices {
 public:
  bool obey(std::uint64_t id) noexcept override {
    const std::lock_guard lock(mutex_);
    if (!known_.insert(id).second) return false;
    in_force_ = id;
    ++stop_count;
    return true;
  }
  std::uint64_t obeyed() const noexcept override { return in_force_; }
  void rearm() noexcept { in_force_ = 0; }
  std::atomic<int> stop_count{0};

 private:
  std::mutex mutex_{};
  std::set<std::uint64_t> known_{};
  std::atomic<std::uint64_t> in_force_{0};
};

class SystemStops : public ::testing::Test {
 protected:
  std::unique_ptr<SystemStop> start(SystemStopDevices* devices) {
    SystemStopConfig config;
    config.hub = hub_.url();
    config.retry = 10ms;
    config.repeat = 10ms;
    config.repeat_for = 200ms;
    config.remind = 50ms;
    config.realtime = rt::RealtimeMode::kOff;
    auto stop = SystemStop::start(node_, devices, config);
    RTPM_ASSERT(stop.has_value(), "starts");
    return std::move(*stop);
  }

  rpc::Node node_{};
  ServedHub hub_{};
  Devices mine_{};
  Devices others_{};
};

TEST_F(SystemStops, StopTheDevicesOfEveryProgramOnce) {
  const auto my_stop = start(&mine_);
  const auto their_stop = start(&others_);
  ASSERT_TRUE(await([&] { return my_stop->is_subscribed() && their_stop->is_subscribed(); }));
  my_stop->request();
  EXPECT_EQ(mine_.stop_count, 1) << "its own at once";
  EXPECT_TRUE(await([&] { return others_.stop_count > 0; }));
  // The request is repeated for 200 ms, and obeyed once.
  std::this_thread::sleep_for(300ms);
  EXPECT_EQ(others_.stop_count, 1);
  EXPECT_EQ(mine_.stop_count, 1);
  my_stop->request();
  EXPECT_TRUE(await([&] { return others_.stop_count == 2; })) << "a new request counts again";
}

TEST_F(SystemStops, AreRequestedByProgramsWithoutDevices) {
  const auto their_stop = start(&others_);
  const auto button = start(nullptr);
  ASSERT_TRUE(await([&] { return their_stop->is_subscribed(); }));
  button->request();
  EXPECT_TRUE(await([&] { return others_.stop_count == 1; }));
}

TEST_F(SystemStops, ReachServersThatStartAfterTheRequestUntilItsDevicesAreRearmed) {
  Devices late;
  Devices later;
  const auto my_stop = start(&mine_);
  my_stop->request();
  ASSERT_EQ(mine_.stop_count, 1);
  // The request is repeated for 200 ms, and then only by the device that is still stopped.
  std::this_thread::sleep_for(400ms);
  const auto late_stop = start(&late);
  EXPECT_TRUE(await([&] { return late.stop_count == 1; })) << "the stop is still in force";
  mine_.rearm();
  late.rearm();
  // After three times `remind` the hub's latched request is over, too.
  std::this_thread::sleep_for(400ms);
  const auto later_stop = start(&later);
  ASSERT_TRUE(await([&] { return later_stop->is_subscribed(); }));
  std::this_thread::sleep_for(200ms);
  EXPECT_EQ(later.stop_count, 0) << "nobody is stopped any more";
  EXPECT_EQ(mine_.stop_count, 1) << "its own request does not stop it again";
}

TEST_F(SystemStops, AreReportedToTheNextHubByStoppedServers) {
  const auto my_stop = start(&mine_);
  my_stop->request();
  std::this_thread::sleep_for(400ms);
  hub_.stop();
  hub_.start();
  const auto their_stop = start(&others_);
  EXPECT_TRUE(await([&] { return others_.stop_count == 1; }));
}

TEST_F(SystemStops, StopReachableDevicesWithoutAHubAndOthersWhenItIsBack) {
  hub_.stop();
  const auto my_stop = start(&mine_);
  const auto their_stop = start(&others_);
  my_stop->request();
  EXPECT_EQ(mine_.stop_count, 1);
  hub_.start();
  EXPECT_TRUE(await([&] { return others_.stop_count == 1; }));
  hub_.stop();
  EXPECT_EQ(others_.stop_count, 1) << "what was stopped stays stopped";
}

}  // namespace
}  // namespace rtpm::gvd
