#include <gtest/gtest.h>

#include "../device_evdev/opened_driver.hpp"
#include "emulated_hidraw.hpp"
#include "rtpm/device_hid/open.hpp"
#include "rtpm/device_hid/profile.hpp"
#include "scripted_hid.hpp"
#include "umockdev.hpp"

/// The driver with the real hidapi and udev, and models that umockdev shows as hidraw nodes.
namespace rtpm::device_hid {
namespace {

using driver::CommandMode;
using test::EmulatedHidraw;

class HidRawTest : public device_evdev::OpenedDriver {
 protected:
  void SetUp() override {
    if (const std::string obstacle = test::umockdev_obstacle(); !obstacle.empty())
      GTEST_SKIP() << obstacle;
    hidraw_ = std::make_unique<EmulatedHidraw>();
  }
  void open(const std::string& arguments) {
    auto opened = device_hid::open(arguments, "pad0");
    ASSERT_TRUE(opened) << opened.error().text();
    driver_ = std::move(*opened);
  }
  bool is_safe(int number) {
    return hidraw_->with_model(number, [](test::HidModel& model) { return model.is_safe(); });
  }

  std::unique_ptr<EmulatedHidraw> hidraw_{};
};

TEST_F(HidRawTest, FindsThePluggedInUnits) {
  for (std::size_t i = 0; i < kKinds.size(); ++i) {
    const std::string number = std::to_string(i);
    hidraw_->plug(test::make_model(i), static_cast<int>(i), "serial-" + number, "port-" + number);
  }
  const auto found = probe();
  ASSERT_EQ(found.size(), kKinds.size());
  for (const auto& device : found) {
    EXPECT_EQ(device.driver, "hid");
    EXPECT_EQ(device.arguments, "node=" + device.node);
    EXPECT_EQ(device.serial.substr(7), device.node.substr(11));
    EXPECT_EQ(device.missing_right, "");
    EXPECT_NE(device.udev_rule.find("idVendor"), std::string::npos);
  }
}

TEST_F(HidRawTest, ServesEachKind) {
  int node = 0;  // umockdev accepts a node's number only once.
  for (const bool is_bluetooth : {false, true}) {
    for (std::size_t kind = 0; kind < kKinds.size(); ++kind) {
      const bool has_bluetooth =
          kKinds[kind] == Kind::kDualShock4 || kKinds[kind] == Kind::kDualSense;
      if (is_bluetooth && !has_bluetooth) continue;
      SCOPED_TRACE(testing::Message() << to_string(kKinds[kind]) << ' ' << is_bluetooth);
      hidraw_->plug(test::make_model(kind, is_bluetooth), ++node, "1", "usb-1/input0");
      open(kKinds[kind] == Kind::kOpenFfBoard ? "torque_newton_metre=2" : "");
      start();
      hidraw_->with_model(node, [](test::HidModel& model) {
        model.move(0, -1);
        return model.press(1, true), 0;
      });
      EXPECT_TRUE(exchange_until(CommandMode::kOff, 0, [&](auto) {
        return sample_.buttons == 2 && (sample_.analogs[0] < 0 || sample_.joints[0] < -1);
      }));
      const bool has_outputs = !driver_->describe().modes.empty();
      EXPECT_EQ(exchange_until(CommandMode::kJointEffort, 1,
                               [&](auto) { return !has_outputs || !is_safe(node); }),
                true);
      driver_.reset();
      EXPECT_TRUE(is_safe(node));
      hidraw_->unplug(node);
    }
  }
}

}  // namespace
}  // namespace rtpm::device_hid
