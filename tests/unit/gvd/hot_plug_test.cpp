#include <gtest/gtest.h>

#include <optional>
#include <string>
#include <vector>

#include "cycle.hpp"
#include "scripted_driver.hpp"

/// A device that is unplugged and plugged in again, on a simulated time line of one cycle per
/// millisecond.
namespace rtpm::gvd {
namespace {

using driver::ExchangeStatus;
using driver::Fault;
using driver::Lifecycle;
using std::chrono::milliseconds;
using std::chrono::seconds;

class Listener final : public DeviceListener {
 public:
  void report(std::string_view text) override { texts.emplace_back(text); }
  std::vector<std::string> texts;
};

class HotPlug : public ::testing::Test {
 protected:
  HotPlug() {
    CycleConfig config;
    config.listener = &listener_;
    cycle_.emplace(driver_, config, SipKey{1, 2});
    driver_.script = [this](const driver::Command&, driver::Sample&) {
      return is_plugged_in_ ? ExchangeStatus::kOk : ExchangeStatus::kGone;
    };
  }
  void unplug() {
    is_plugged_in_ = false;
    driver_.configure_error = "the cable is out";
  }
  void plug_in() {
    is_plugged_in_ = true;
    driver_.configure_error.clear();
  }
  /// Starts like DeviceServer::start() with starts_without_device.
  void begin() {
    const auto begun = cycle_->begin(now_);
    if (!begun) cycle_->begin_without(now_, begun.error());
  }
  void run(int count) {
    for (int i = 0; i < count; ++i) {
      now_ += milliseconds{1};
      cycle_->run(now_, 0);
      if (cycle_->needs_maintenance(now_)) cycle_->maintain(now_);
    }
  }
  /// The number of cycles until the sample says that the device is active; 2000 if it never does.
  int cycles_until_active() {
    int count = 0;
    do {
      run(1);
      ++count;
    } while (count < 2000 && sample().lifecycle != Lifecycle::kActive);
    return count;
  }
  expected<void, DeviceOutcome> command(std::uint64_t lease, double newton) {
    return cycle_->submit(
        {lease, ++sequence_, milliseconds{10}, driver::Setpoint::with_wrench({{newton, 0, 0}, {}})},
        now_);
  }
  driver::Sample sample() const { return *cycle_->newest(); }

  test::ScriptedDriver driver_;
  Listener listener_;
  std::optional<DeviceCycle> cycle_;
  MonotonicTime now_{seconds{1000}};
  std::uint32_t sequence_ = 0;
  bool is_plugged_in_ = true;
};

// The promise is 1 s: half of it for the retry, the rest for the driver's configure().
TEST_F(HotPlug, IsActiveAgainHalfASecondAfterItIsBackWheneverThatIs) {
  begin();
  run(5);
  for (int out_ms = 1; out_ms < 1500; out_ms += 17) {
    unplug();
    run(1);
    EXPECT_EQ(sample().lifecycle, Lifecycle::kFault) << "in the cycle in which it is lost";
    run(out_ms - 1);
    EXPECT_EQ(sample().lifecycle, Lifecycle::kFault);
    EXPECT_TRUE(sample().faults.has(Fault::kDeviceGone));
    plug_in();
    EXPECT_LE(cycles_until_active(), 502) << "out for " << out_ms << " ms";
    EXPECT_TRUE(sample().faults.empty());
  }
}

TEST_F(HotPlug, IsActiveHalfASecondAfterItComesFirst) {
  for (const int out_ms : {1, 499, 500, 501, 5000}) {
    SCOPED_TRACE(out_ms);
    cycle_.emplace(driver_, CycleConfig{}, SipKey{1, 2});
    unplug();
    begin();
    run(out_ms);
    EXPECT_EQ(sample().lifecycle, Lifecycle::kFault) << "it has an object all the same";
    EXPECT_TRUE(sample().faults.has(Fault::kDeviceGone));
    EXPECT_FALSE(driver_.is_active);
    plug_in();
    EXPECT_LE(cycles_until_active(), 502);
    EXPECT_TRUE(driver_.is_active);
    cycle_->end(now_);
  }
}

TEST_F(HotPlug, TakesNoCommandWhileItIsAway) {
  unplug();
  begin();
  run(1);
  const auto lease = cycle_->lease().acquire();
  ASSERT_TRUE(lease);
  EXPECT_EQ(command(*lease, 5).error(), DeviceOutcome::kNotActive);
}

TEST_F(HotPlug, ComesBackWithoutItsLeaseAndSoftly) {
  begin();
  run(1);
  const auto lease = cycle_->lease().acquire();
  ASSERT_TRUE(lease);
  for (int i = 0; i < 300; ++i) {
    ASSERT_TRUE(command(*lease, 5));
    run(1);
  }
  ASSERT_NEAR(driver_.last_command.wrench.force_newton.x, 5, 1e-9);
  unplug();
  run(1);
  plug_in();
  // The client keeps commanding as if nothing had happened.
  for (int i = 0; i < 1000; ++i) {
    EXPECT_EQ(command(*lease, 5).error(), DeviceOutcome::kNotHolder);
    run(1);
  }
  EXPECT_EQ(sample().lifecycle, Lifecycle::kActive);
  EXPECT_EQ(sample().wrench_applied, driver::Wrench{});
  EXPECT_EQ(cycle_->lease().state_of(*lease), LeaseState::kDeviceLost) << "it learns why";

  const auto next = cycle_->lease().acquire();
  ASSERT_TRUE(next);
  double newton = 0;
  for (int i = 0; i < 300; ++i) {
    ASSERT_TRUE(command(*next, 5));
    run(1);
    const double now_newton = driver_.last_command.wrench.force_newton.x;
    EXPECT_LT(now_newton - newton, 0.1) << "in cycle " << i;
    newton = now_newton;
  }
  EXPECT_NEAR(newton, 5, 1e-9);
}

TEST_F(HotPlug, IsLoggedOnceLostAndOnceBack) {
  unplug();
  begin();
  run(3000);
  ASSERT_EQ(listener_.texts.size(), 1u) << "not at every attempt";
  EXPECT_NE(listener_.texts[0].find("the cable is out"), std::string::npos) << listener_.texts[0];
  plug_in();
  run(600);
  unplug();
  run(3000);
  plug_in();
  run(600);
  ASSERT_EQ(listener_.texts.size(), 4u);
  EXPECT_NE(listener_.texts[1].find("active again"), std::string::npos) << listener_.texts[1];
  EXPECT_NE(listener_.texts[2].find("does not answer"), std::string::npos) << listener_.texts[2];
  EXPECT_NE(listener_.texts[3].find("active again"), std::string::npos) << listener_.texts[3];
}

}  // namespace
}  // namespace rtpm::gvd
