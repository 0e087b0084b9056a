#include "rtpm/device_evdev/layout.hpp"

#include <gtest/gtest.h>
#include <linux/input.h>

#include <limits>
#include <string>

#include "evdev_model.hpp"
#include "rtpm/driver/sample.hpp"

namespace rtpm::device_evdev {
namespace {

using driver::CommandMode;
using test::EvdevModel;

TEST(EvdevLayout, DescribesAPad) {
  const Layout layout = make_layout(EvdevModel::pad(), {});
  const driver::Descriptor& pad = layout.descriptor;
  EXPECT_EQ(pad.device_class, driver::DeviceClass::kInput);
  EXPECT_EQ(pad.model, "Model Pad");
  ASSERT_EQ(pad.analogs.size(), 8u);
  EXPECT_EQ(pad.analogs[0].name, "x");
  EXPECT_EQ(pad.analogs[0].unit, "1");
  EXPECT_EQ(pad.analogs[0].low, -1);
  EXPECT_EQ(pad.analogs[2].name, "z");
  EXPECT_EQ(pad.analogs[2].low, 0) << "a trigger, as the second stick is at rx and ry";
  EXPECT_EQ(pad.analogs[6].name, "hat0x");
  EXPECT_EQ(pad.buttons.size(), 11u);
  EXPECT_EQ(pad.buttons[0], "south");
  ASSERT_EQ(pad.outputs.size(), 2u);
  EXPECT_EQ(pad.outputs[0].name, "strong");
  EXPECT_EQ(pad.outputs[1].name, "weak");
  EXPECT_TRUE(pad.joints.empty()) << "what the kernel makes of rumble motors is no motor";
  EXPECT_EQ(pad.modes, std::vector{CommandMode::kOutputs});
}

TEST(EvdevLayout, DescribesAWheel) {
  const Layout layout =
      make_layout(EvdevModel::wheel(), {.wheel_range_rad = 8, .effort_newton_metre_max = 3});
  const driver::Descriptor& wheel = layout.descriptor;
  EXPECT_EQ(wheel.device_class, driver::DeviceClass::kHaptic);
  ASSERT_EQ(wheel.joints.size(), 1u);
  EXPECT_EQ(wheel.joints[0].unit, "rad");
  EXPECT_EQ(wheel.joints[0].low, -4);
  EXPECT_EQ(wheel.joints[0].high, 4);
  EXPECT_EQ(wheel.joints[0].effort_max, 3);
  ASSERT_EQ(wheel.analogs.size(), 2u) << "the wheel's axis is a joint only";
  EXPECT_EQ(wheel.analogs[0].name, "z");
  ASSERT_EQ(wheel.outputs.size(), 2u);
  EXPECT_EQ(wheel.outputs[0].name, "spring");
  EXPECT_EQ(wheel.outputs[1].name, "damper");
  EXPECT_EQ(wheel.modes, (std::vector{CommandMode::kJointEffort, CommandMode::kOutputs}));
  EXPECT_NEAR(wheel_position(layout.joints[0], 65'535), 4, 1e-12);
  EXPECT_NEAR(wheel_position(layout.joints[0], 0), -4, 1e-12);
  EXPECT_EQ(wheel_position(layout.joints[0], std::numeric_limits<std::int32_t>::max()), 4);
}

TEST(EvdevLayout, DescribesADial) {
  const Layout layout = make_layout(EvdevModel::dial(), {});
  EXPECT_EQ(layout.descriptor.device_class, driver::DeviceClass::kDial);
  ASSERT_EQ(layout.descriptor.joints.size(), 1u);
  EXPECT_EQ(layout.descriptor.joints[0].name, "dial");
  EXPECT_EQ(layout.descriptor.joints[0].low, layout.descriptor.joints[0].high) << "without end";
  EXPECT_TRUE(layout.descriptor.modes.empty());
}

TEST(EvdevLayout, TakesUnitsFromTheResolution) {
  Capabilities tracker;
  tracker.absolute = {{.code = ABS_X, .minimum = -100, .maximum = 100, .resolution = 10},
                      {.code = ABS_RX, .minimum = -50, .maximum = 50, .resolution = 100},
                      {.code = ABS_THROTTLE, .minimum = 0, .maximum = 10, .resolution = 7}};
  Layout layout = make_layout(tracker, {});
  EXPECT_EQ(layout.descriptor.analogs[0].unit, "m");
  EXPECT_FLOAT_EQ(analog_value(layout.analogs[0], 50), 0.005F) << "10 counts per mm";
  EXPECT_EQ(layout.descriptor.analogs[1].unit, "rad");
  EXPECT_FLOAT_EQ(analog_value(layout.analogs[1], 50), 0.5F) << "100 counts per rad";
  EXPECT_EQ(layout.descriptor.analogs[2].unit, "1") << "the kernel defines no unit here";
  tracker.is_accelerometer = true;
  layout = make_layout(tracker, {});
  EXPECT_EQ(layout.descriptor.analogs[0].unit, "m/s^2");
  EXPECT_FLOAT_EQ(analog_value(layout.analogs[0], 10), 9.80665F) << "10 counts per g";
  EXPECT_EQ(layout.descriptor.analogs[1].unit, "rad/s");
}

TEST(EvdevLayout, HasADeadZoneWithoutAJump) {
  const AnalogChannel stick{{.code = ABS_X, .minimum = -1000, .maximum = 1000, .flat = 100}};
  EXPECT_EQ(analog_value(stick, 100), 0);
  EXPECT_EQ(analog_value(stick, -100), 0);
  EXPECT_NEAR(analog_value(stick, 101), 1.0 / 900, 1e-6);
  EXPECT_EQ(analog_value(stick, 1000), 1);
  EXPECT_EQ(analog_value(stick, std::numeric_limits<std::int32_t>::min()), -1);
}

TEST(EvdevLayout, NamesInputsWithoutAChannel) {
  for (const Capabilities& whole : {EvdevModel::pad(), EvdevModel::wheel(), EvdevModel::dial()})
    EXPECT_EQ(make_layout(whole, {}).left_out, "") << whole.name;
  Capabilities flight_stick;
  for (std::uint16_t code = ABS_X; code <= ABS_BRAKE; ++code)
    flight_stick.absolute.push_back({.code = code, .minimum = 0, .maximum = 255});
  flight_stick.absolute[2].maximum = 0;
  for (std::uint16_t code = ABS_MT_SLOT; code <= ABS_MT_TOUCH_MAJOR; ++code)
    flight_stick.absolute.push_back({.code = code, .minimum = 0, .maximum = 255});
  for (std::uint16_t code = REL_X; code <= REL_MISC; ++code)
    flight_stick.relative.push_back(code);
  for (std::uint16_t code = BTN_TRIGGER_HAPPY; code < BTN_TRIGGER_HAPPY + 19; ++code)
    flight_stick.keys.push_back(code);
  flight_stick.force_feedback = {FF_RUMBLE, FF_SPRING, FF_DAMPER};
  flight_stick.effect_count = 1;
  const Layout layout = make_layout(flight_stick, {});
  EXPECT_EQ(layout.left_out,
            "brake: a sample holds 8 analogs; dial, wheel: a sample holds 8 joints; "
            "3 buttons: a sample holds 16; spring, damper: the device keeps 1 at a time; "
            "z: without a range; 2 axes of touch points");
  EXPECT_EQ(layout.analogs.size(), driver::kAnalogCountMax);
  EXPECT_EQ(layout.buttons.size(), driver::kButtonCountMax);
}

TEST(EvdevLayout, SurvivesWhateverADeviceClaims) {
  constexpr std::int32_t kMin = std::numeric_limits<std::int32_t>::min();
  constexpr std::int32_t kMax = std::numeric_limits<std::int32_t>::max();
  Capabilities absurd;
  absurd.absolute = {{.code = ABS_X, .minimum = 5, .maximum = 5},
                     {.code = ABS_Y, .minimum = 5, .maximum = -5},
                     {.code = ABS_Z, .minimum = kMin, .maximum = kMax, .flat = kMax},
                     {.code = ABS_RX, .minimum = 0, .maximum = 1, .flat = kMin},
                     {.code = ABS_MT_POSITION_X, .minimum = 0, .maximum = 100}};
  for (std::uint16_t code = 0; code < KEY_CNT; ++code)
    absurd.keys.push_back(code);
  absurd.force_feedback = {FF_CONSTANT, FF_RUMBLE, FF_SPRING, FF_DAMPER};
  absurd.effect_count = -7;
  Layout layout = make_layout(absurd, {});
  ASSERT_EQ(layout.analogs.size(), 2u);
  EXPECT_EQ(layout.descriptor.buttons.size(), driver::kButtonCountMax);
  EXPECT_EQ(layout.descriptor.buttons[0], "0") << "buttons before a keyboard's keys";
  EXPECT_TRUE(layout.effects.empty());
  EXPECT_FALSE(layout.descriptor.model.empty());
  for (const AnalogChannel& analog : layout.analogs) {
    for (const std::int32_t count : {kMin, -1, 0, 1, kMax}) {
      EXPECT_GE(analog_value(analog, count), -1);
      EXPECT_LE(analog_value(analog, count), 1);
    }
  }
  absurd.effect_count = 2;
  EXPECT_EQ(make_layout(absurd, {}).effects.size(), 2u) << "as many as it keeps";
}

}  // namespace
}  // namespace rtpm::device_evdev
