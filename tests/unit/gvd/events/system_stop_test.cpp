#include "rtpm/gvd/system_stop.hpp"

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <thread>

#include "served_hub.hpp"

namespace rtpm::gvd {
namespace {

using namespace std::chrono_literals;
using events::test::await;
using events::test::ServedHub;

/// The devices of a program.
class Devices final : public EmergencyStops {
 public:
  void stop_devices() noexcept override { ++stop_count; }
  bool stop_system() noexcept override { return false; }
  std::atomic<int> stop_count{0};
};

class SystemStops : public ::testing::Test {
 protected:
  std::unique_ptr<SystemStop> start(EmergencyStops* devices) {
    SystemStopConfig config;
    config.hub = hub_.url();
    config.retry = 10ms;
    config.repeat = 10ms;
    config.repeat_for = 200ms;
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
  // It is repeated for 200 ms, and obeyed once.
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

TEST_F(SystemStops, WithoutAHubStopWhatTheyCanAndTheRestWhenItIsBack) {
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
