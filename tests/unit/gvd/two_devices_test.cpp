#include <gtest/gtest.h>

#include <atomic>
#include <functional>
#include <memory>
#include <utility>

#include "rtpm/gvd/client.hpp"
#include "rtpm/gvd/server.hpp"
#include "rtpm/rpc/node.hpp"
#include "rtpm/rpc/server.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/test/os.hpp"
#include "scripted_driver.hpp"

/// Two devices of one program, with real threads: one driver's behaviour must not affect the other.
/// Counted in cycles, because a busy machine may delay any thread.
namespace rtpm::gvd {
namespace {

using rtpm::test::await;

using driver::ExchangeStatus;
using driver::Lifecycle;
using std::chrono::milliseconds;
using std::chrono::seconds;

std::unique_ptr<DeviceServer> start_device(test::ScriptedDriver::Script script) {
  auto driver = std::make_unique<test::ScriptedDriver>();
  driver->script = std::move(script);
  DeviceServerConfig config;
  config.thread.realtime = rt::RealtimeMode::kOff;
  auto device = DeviceServer::create(std::move(driver), std::move(config));
  RTPM_ASSERT(device.has_value() && (*device)->start().has_value(),
              "a device could not be started");
  return std::move(*device);
}

TEST(TwoDevices, ADriverThatSleepsCostsTheOtherNoCycle) {
  const auto quick = start_device({});
  // Another program's load may cost the quick device cycles during one exchange of the slow device.
  // If the slow device itself cost cycles, it would do so in each.
  std::atomic<int> undisturbed_count{0};
  const auto slow = start_device([&](const driver::Command&, driver::Sample&) {
    const DeviceCounters before = quick->counters();
    rt::sleep_until(rt::now() + milliseconds{100});
    const DeviceCounters after = quick->counters();
    const bool is_undisturbed =
        after.missed_count == before.missed_count && after.cycle_count - before.cycle_count >= 99;
    if (is_undisturbed) ++undisturbed_count;
    return ExchangeStatus::kOk;
  });
  EXPECT_TRUE(await([&] { return undisturbed_count >= 3; }));
  // Each cycle but the first counts the missed cycles before it; the loop begins at the second.
  const DeviceCounters counters = slow->counters();
  EXPECT_GE(counters.missed_count, 99 * (counters.cycle_count - 2)) << "its own cycles it misses";
}

TEST(TwoDevices, ADriverThatBlocksLeavesTheOtherAndAllCallsRunning) {
  std::atomic<bool> is_open{true};
  std::atomic<bool> is_inside{false};
  const auto blocked = start_device([&](const driver::Command&, driver::Sample&) {
    is_inside = !is_open;
    is_open.wait(false);
    return ExchangeStatus::kOk;
  });
  const auto quick = start_device({});
  auto server = rpc::Server::create({.realtime = rt::RealtimeMode::kOff});
  ASSERT_TRUE(server);
  ASSERT_TRUE((*server)->add("lab/blocked", blocked->servant()));
  ASSERT_TRUE((*server)->add("lab/quick", quick->servant()));
  ASSERT_TRUE((*server)->start());
  rpc::Node node({.default_deadline = seconds{5}});

  is_open = false;
  ASSERT_TRUE(await([&] { return is_inside.load(); }));
  const std::uint64_t blocked_at = blocked->counters().cycle_count;
  const std::uint64_t quick_at = quick->counters().cycle_count;
  auto client = DeviceClient::open(node, (*server)->url("lab/blocked"));
  ASSERT_TRUE(client) << "describe() is answered";
  EXPECT_TRUE(await([&] {
    const auto sample = client->read();
    return sample && sample->faults.has(driver::Fault::kDeviceLate);
  })) << "the sample shows it";
  EXPECT_TRUE(client->acquire());
  EXPECT_TRUE(client->set_force({1, 0, 0}));
  EXPECT_TRUE(client->emergency_stop());
  auto other = DeviceClient::open(node, (*server)->url("lab/quick"));
  ASSERT_TRUE(other);
  EXPECT_TRUE(other->acquire());
  EXPECT_TRUE(await([&] {
    static_cast<void>(other->set_force({1, 0, 0}));
    return quick->newest()->wrench_applied.force_newton.x > 0.9;
  })) << "the other device follows its client";
  EXPECT_TRUE(await([&] { return quick->counters().cycle_count > quick_at + 300; }));
  EXPECT_EQ(blocked->counters().cycle_count, blocked_at);

  is_open = true;
  is_open.notify_all();
  EXPECT_TRUE(await([&] { return blocked->counters().cycle_count > blocked_at + 20; }));
}

TEST(BlockedDriver, IsWaitedForAsLongAsTheCallerWants) {
  std::atomic<bool> is_open{true};
  std::atomic<bool> is_inside{false};
  const auto device = start_device([&](const driver::Command&, driver::Sample&) {
    is_inside = !is_open;
    is_open.wait(false);
    return ExchangeStatus::kOk;
  });
  is_open = false;
  ASSERT_TRUE(await([&] { return is_inside.load(); }));
  EXPECT_FALSE(device->stop(milliseconds{10}));
  EXPECT_EQ(device->newest()->lifecycle, Lifecycle::kActive) << "it was not deactivated";
  is_open = true;
  is_open.notify_all();
  EXPECT_TRUE(device->stop(seconds{20}));
  EXPECT_EQ(device->newest()->lifecycle, Lifecycle::kFinalized);
  EXPECT_TRUE(device->stop(milliseconds{0})) << "it has stopped";
}

TEST(AbsentDevice, IsTheSameObjectWhenItComes) {
  auto driver = std::make_unique<test::ScriptedDriver>();
  test::ScriptedDriver& watched = *driver;
  std::atomic<bool> is_plugged_in{false};
  watched.is_reachable = [&] { return is_plugged_in.load(); };
  watched.script = [&](const driver::Command&, driver::Sample&) {
    return is_plugged_in ? ExchangeStatus::kOk : ExchangeStatus::kGone;
  };
  DeviceServerConfig config;
  config.thread.realtime = rt::RealtimeMode::kOff;
  config.starts_without_device = true;
  auto device = DeviceServer::create(std::move(driver), std::move(config));
  ASSERT_TRUE(device);
  ASSERT_TRUE((*device)->start());
  auto server = rpc::Server::create({.realtime = rt::RealtimeMode::kOff});
  ASSERT_TRUE(server);
  ASSERT_TRUE((*server)->add("lab/arm0", (*device)->servant()));
  ASSERT_TRUE((*server)->start());
  rpc::Node node({.default_deadline = seconds{5}});
  auto client = DeviceClient::open(node, (*server)->url("lab/arm0"));
  ASSERT_TRUE(client);

  const auto is_in = [&](Lifecycle lifecycle) {
    const auto sample = client->read();
    return sample && sample->lifecycle == lifecycle;
  };
  EXPECT_TRUE(is_in(Lifecycle::kFault));
  for (int i = 0; i < 2; ++i) {
    const std::uint64_t plugged_in_at = (*device)->newest()->sequence;
    is_plugged_in = true;
    ASSERT_TRUE(await([&] { return (*device)->newest()->lifecycle == Lifecycle::kActive; }));
    EXPECT_LE((*device)->newest()->sequence - plugged_in_at, 1000u) << "cycles of 1 ms";
    EXPECT_TRUE(is_in(Lifecycle::kActive));
    is_plugged_in = false;
    ASSERT_TRUE(await([&] { return is_in(Lifecycle::kFault); }));
  }
}

}  // namespace
}  // namespace rtpm::gvd
