#include <gtest/gtest.h>
#include <linux/input.h>

#include <functional>
#include <memory>
#include <optional>
#include <thread>

#include "opened_driver.hpp"
#include "rtpm/device_evdev/open.hpp"
#include "rtpm/rt/clock.hpp"
#include "uinput_device.hpp"

/// The driver as a user opens it, on this machine's own kernel. Needs /dev/uinput and permission to
/// use it; udev need not run.
namespace rtpm::device_evdev {
namespace {

using driver::CommandMode;
using std::chrono::milliseconds;
using test::UinputDevice;

UinputDevice::Description pad() {
  return {.name = "RTPM Test Pad",
          .axes = {{ABS_X, -32'768, 32'767}, {ABS_Y, -32'768, 32'767}},
          .keys = {BTN_SOUTH, BTN_EAST},
          .effects = {FF_RUMBLE, FF_GAIN}};
}

UinputDevice::Description wheel() {
  return {.name = "RTPM Test Wheel",
          .axes = {{ABS_X, 0, 65'535}, {ABS_Z, 0, 255}},
          .keys = {BTN_TRIGGER, BTN_THUMB},
          .effects = {FF_CONSTANT, FF_SPRING, FF_DAMPER, FF_GAIN}};
}

class EvdevUinputTest : public OpenedDriver {
 protected:
  void SetUp() override {
    if (const std::string obstacle = UinputDevice::obstacle(); !obstacle.empty()) {
      GTEST_SKIP() << obstacle;
    }
  }
  void use(const UinputDevice::Description& description, const std::string& words) {
    device_.emplace(description);
    ASSERT_NE(device_->node(), "");
    auto opened = open(words + "name=" + description.name, "device0");
    ASSERT_TRUE(opened) << opened.error().text();
    driver_ = std::move(*opened);
    start();
  }

  std::optional<UinputDevice> device_{};
};

TEST_F(EvdevUinputTest, ReadsAPad) {
  use(pad(), "");
  const driver::Descriptor descriptor = driver_->describe();
  EXPECT_EQ(descriptor.analogs.size(), 2u);
  EXPECT_EQ(descriptor.buttons, (std::vector<std::string>{"south", "east"}));
  const MonotonicTime before = rt::now();
  device_->send(EV_ABS, ABS_X, 32'767);
  device_->send(EV_KEY, BTN_EAST, 1);
  device_->send(EV_SYN, SYN_REPORT, 0);
  ASSERT_TRUE(exchange_until(CommandMode::kOff, 0, [&](auto) { return sample_.buttons == 2; }));
  EXPECT_EQ(sample_.analogs[0], 1);
  EXPECT_GE(sample_.host_time, before - milliseconds{1}) << "on the monotonic clock";
}

TEST_F(EvdevUinputTest, Rumbles) {
  use(pad(), "gain=0.5 ");
  EXPECT_TRUE(exchange_until(CommandMode::kOutputs, 1,
                             [&](auto) { return device_->level(FF_RUMBLE) == 65'535; }));
  EXPECT_NEAR(device_->gain(), 32'767, 1);
  EXPECT_TRUE(
      exchange_until(CommandMode::kOff, 0, [&](auto) { return device_->level(FF_RUMBLE) == 0; }));
}

TEST_F(EvdevUinputTest, AppliesAConstantForceAndErasesIt) {
  use(wheel(), "");
  EXPECT_EQ(device_->effect_count(), 3u);
  for (const double newton_metre : {1.0, -2.0}) {
    const int level = static_cast<int>(newton_metre / 2 * 32'767);
    EXPECT_TRUE(exchange_until(CommandMode::kJointEffort, newton_metre,
                               [&](auto) { return device_->level(FF_CONSTANT) == level; }));
  }
  EXPECT_TRUE(exchange_until(CommandMode::kOutputs, 1, [&](auto) {
    return device_->level(FF_SPRING) == 32'767 && device_->level(FF_CONSTANT) == 0;
  }));
  driver_->deactivate();
  EXPECT_EQ(device_->effect_count(), 0u);
}

}  // namespace
}  // namespace rtpm::device_evdev
