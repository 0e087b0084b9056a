#include "rtpm/device_evdev/layout.hpp"

#include <libevdev/libevdev.h>
#include <linux/input.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <cstdio>
#include <string_view>

#include "rtpm/driver/sample.hpp"

namespace rtpm::device_evdev {
namespace {

constexpr double kStandardGravity = 9.80665;
constexpr double kRadPerDegree = std::numbers::pi / 180;

/// Converts "ABS_HAT0X" to "hat0x"; uses the number of a code without a name.
std::string name_of(unsigned type, std::uint16_t code) {
  const char* const known = libevdev_event_code_get_name(type, code);
  if (known == nullptr) {
    std::array<char, 16> text{};
    std::snprintf(text.data(), text.size(), "code_%03x", code);
    return text.data();
  }
  std::string name = known;
  name.erase(0, name.find('_') + 1);
  std::ranges::transform(name, name.begin(), [](unsigned char letter) {
    return static_cast<char>(std::tolower(letter));
  });
  return name;
}

bool has(const std::vector<std::uint16_t>& codes, std::uint16_t code) {
  return std::ranges::find(codes, code) != codes.end();
}

const AbsoluteAxis* find(const Capabilities& capabilities, std::uint16_t code) {
  const auto axis = std::ranges::find(capabilities.absolute, code, &AbsoluteAxis::code);
  return axis == capabilities.absolute.end() || axis->minimum >= axis->maximum ? nullptr : &*axis;
}

/// Pads have triggers at ABS_Z and ABS_RZ if their second stick is at ABS_RX and ABS_RY; older pads
/// have the second stick at ABS_Z and ABS_RZ.
bool is_one_sided(const Capabilities& capabilities, const AbsoluteAxis& axis) {
  switch (axis.code) {
    case ABS_THROTTLE:
    case ABS_GAS:
    case ABS_BRAKE:
    case ABS_PRESSURE:
    case ABS_DISTANCE:
    case ABS_VOLUME:
      return true;
    case ABS_Z:
    case ABS_RZ:
      return axis.minimum == 0 && find(capabilities, ABS_RX) != nullptr &&
             find(capabilities, ABS_RY) != nullptr;
    default:
      return false;
  }
}

/// Unit and scale of an axis whose resolution is defined by the kernel.
struct UnitScale {
  const char* unit = "1";
  double scale = 0;
};
UnitScale unit_of(const AbsoluteAxis& axis, bool is_accelerometer) {
  if (axis.resolution <= 0) return {};
  const double per_count = 1.0 / axis.resolution;
  if (axis.code <= ABS_Z) {
    return is_accelerometer ? UnitScale{"m/s^2", kStandardGravity * per_count}
                            : UnitScale{"m", 1e-3 * per_count};
  }
  if (axis.code <= ABS_RZ) {
    return is_accelerometer ? UnitScale{"rad/s", kRadPerDegree * per_count}
                            : UnitScale{"rad", per_count};
  }
  return axis.code == ABS_TILT_X || axis.code == ABS_TILT_Y ? UnitScale{"rad", per_count}
                                                            : UnitScale{};
}

void append(std::string& text, std::string_view separator, std::string_view more) {
  if (!text.empty()) text += separator;
  text += more;
}

/// The axes, buttons and effects without a channel, as text for users.
struct LeftOut {
  std::string analogs{};  ///< Axes that exceed the capacity of a sample.
  std::string joints{};
  std::size_t button_count = 0;
  std::string without_range{};
  std::size_t touch_axis_count = 0;
  std::string effects{};

  [[nodiscard]] std::string text(int effect_count) const {
    std::string text;
    const auto add = [&](const std::string& what, const std::string& why) {
      if (!what.empty()) append(text, "; ", what + why);
    };
    const auto sample_holds = [](std::size_t count) {
      return ": a sample holds " + std::to_string(count);
    };
    const auto counted = [](std::size_t count, const char* what) {
      return count == 0 ? std::string() : std::to_string(count) + what;
    };
    add(analogs, sample_holds(driver::kAnalogCountMax) + " analogs");
    add(joints, sample_holds(driver::kJointCountMax) + " joints");
    add(counted(button_count, " buttons"), sample_holds(driver::kButtonCountMax));
    add(effects, ": the device keeps " + std::to_string(std::max(effect_count, 0)) + " at a time");
    add(without_range, ": without a range");
    add(counted(touch_axis_count, " axes"), " of touch points");
    return text;
  }
};

void add_analog(Layout& layout, const Capabilities& capabilities, const AbsoluteAxis& axis,
                LeftOut& left_out) {
  if (layout.analogs.size() == driver::kAnalogCountMax) {
    append(left_out.analogs, ", ", name_of(EV_ABS, axis.code));
    return;
  }
  const auto [unit, scale] = unit_of(axis, capabilities.is_accelerometer);
  const AnalogChannel channel{axis, scale, is_one_sided(capabilities, axis)};
  layout.descriptor.analogs.push_back({.name = name_of(EV_ABS, axis.code),
                                       .unit = unit,
                                       .low = analog_value(channel, axis.minimum),
                                       .high = analog_value(channel, axis.maximum)});
  layout.analogs.push_back(channel);
}

void add_wheel(Layout& layout, const AbsoluteAxis& axis, const Scales& scales, bool has_motor) {
  const double end_rad = scales.wheel_range_rad / 2;
  layout.descriptor.joints.push_back(
      {.name = "wheel",
       .unit = "rad",
       .low = -end_rad,
       .high = end_rad,
       .effort_max = has_motor ? scales.effort_newton_metre_max : 0});
  const double span = static_cast<double>(axis.maximum) - static_cast<double>(axis.minimum);
  layout.joints.push_back({axis.code, scales.wheel_range_rad / span, end_rad, axis});
}

void add_relative(Layout& layout, const Capabilities& capabilities, const Scales& scales,
                  LeftOut& left_out) {
  for (const std::uint16_t code : capabilities.relative) {
    // The high-resolution steps of a wheel, reported in addition to its normal steps.
    if (code == REL_WHEEL_HI_RES || code == REL_HWHEEL_HI_RES || code == REL_MISC) continue;
    if (layout.joints.size() == driver::kJointCountMax) {
      append(left_out.joints, ", ", name_of(EV_REL, code));
      continue;
    }
    const bool is_straight = code <= REL_Z;
    layout.descriptor.joints.push_back(
        {.name = name_of(EV_REL, code), .unit = is_straight ? "m" : "rad"});
    const double scale =
        is_straight ? 1 / scales.counts_per_m : 2 * std::numbers::pi / scales.counts_per_turn;
    layout.joints.push_back({code, scale, 0, std::nullopt});
  }
}

/// Adds the buttons of joysticks, pads and mice before the keys of keyboards.
void add_buttons(Layout& layout, const Capabilities& capabilities, LeftOut& left_out) {
  std::vector<std::uint16_t> keys = capabilities.keys;
  const auto is_button = [](std::uint16_t code) {
    return (code >= BTN_MISC && code < KEY_OK) || code >= BTN_DPAD_UP;
  };
  std::stable_partition(keys.begin(), keys.end(), is_button);
  const std::size_t count = std::min(keys.size(), driver::kButtonCountMax);
  left_out.button_count = keys.size() - count;
  keys.resize(count);
  for (const std::uint16_t code : keys)
    layout.descriptor.buttons.push_back(name_of(EV_KEY, code));
  layout.buttons = std::move(keys);
}

void add_output(Layout& layout, const char* name) {
  layout.descriptor.outputs.push_back({.name = name, .unit = "1", .low = 0, .high = 1, .safe = 0});
}

void add_effects(Layout& layout, const Capabilities& capabilities, bool has_motor,
                 LeftOut& left_out) {
  const auto add = [&](std::uint16_t code, EffectKind kind) {
    if (!has(capabilities.force_feedback, code)) return false;
    const bool fits =
        layout.effects.size() < static_cast<std::size_t>(std::max(capabilities.effect_count, 0));
    if (fits) {
      layout.effects.push_back(kind);
    } else {
      append(left_out.effects, ", ", name_of(EV_FF, code));
    }
    return fits;
  };
  if (has_motor && add(FF_CONSTANT, EffectKind::kConstant)) {
    layout.descriptor.modes.push_back(driver::CommandMode::kJointEffort);
  }
  if (add(FF_RUMBLE, EffectKind::kRumble)) {
    add_output(layout, "strong");
    add_output(layout, "weak");
  }
  if (add(FF_SPRING, EffectKind::kSpring)) add_output(layout, "spring");
  if (add(FF_DAMPER, EffectKind::kDamper)) add_output(layout, "damper");
  if (!layout.descriptor.outputs.empty()) {
    layout.descriptor.modes.push_back(driver::CommandMode::kOutputs);
  }
  layout.has_gain = has(capabilities.force_feedback, FF_GAIN);
  layout.has_autocenter = has(capabilities.force_feedback, FF_AUTOCENTER);
}

driver::DeviceClass class_of(const Layout& layout, bool has_motor) {
  if (has_motor) return driver::DeviceClass::kHaptic;
  const bool is_dial = layout.analogs.empty() && layout.joints.size() == 1 &&
                       layout.descriptor.joints.front().unit == "rad";
  return is_dial ? driver::DeviceClass::kDial : driver::DeviceClass::kInput;
}

/// The axis that the motor of a wheel or joystick moves; null if there is no motor.
const AbsoluteAxis* motor_axis(const Capabilities& capabilities) {
  const bool has_motor = has(capabilities.force_feedback, FF_CONSTANT) ||
                         has(capabilities.force_feedback, FF_SPRING) ||
                         has(capabilities.force_feedback, FF_DAMPER);
  // The kernel emulates all effects with a pad's rumble motors, but conditions need a real motor.
  const bool is_pad =
      has(capabilities.force_feedback, FF_RUMBLE) && has(capabilities.keys, BTN_GAMEPAD);
  if (!has_motor || is_pad || capabilities.effect_count <= 0) return nullptr;
  const AbsoluteAxis* const wheel = find(capabilities, ABS_WHEEL);
  return wheel != nullptr ? wheel : find(capabilities, ABS_X);
}

}  // namespace

Layout make_layout(const Capabilities& capabilities, const Scales& scales) {
  Layout layout;
  LeftOut left_out;
  layout.descriptor.model = capabilities.name.empty() ? "Linux input device" : capabilities.name;
  const AbsoluteAxis* const motor = motor_axis(capabilities);
  if (motor != nullptr) {
    add_wheel(layout, *motor, scales, has(capabilities.force_feedback, FF_CONSTANT));
  }
  for (const AbsoluteAxis& axis : capabilities.absolute) {
    if (motor != nullptr && axis.code == motor->code) continue;
    if (axis.code >= ABS_MT_SLOT) {
      ++left_out.touch_axis_count;
    } else if (axis.minimum >= axis.maximum) {
      append(left_out.without_range, ", ", name_of(EV_ABS, axis.code));
    } else {
      add_analog(layout, capabilities, axis, left_out);
    }
  }
  add_relative(layout, capabilities, scales, left_out);
  add_buttons(layout, capabilities, left_out);
  add_effects(layout, capabilities, motor != nullptr, left_out);
  layout.left_out = left_out.text(capabilities.effect_count);
  layout.descriptor.device_class = class_of(layout, motor != nullptr);
  layout.descriptor.rate_hz = motor != nullptr ? 1000 : 250;
  return layout;
}

Layout game_pad_layout() {
  Capabilities pad;
  pad.name = "game pad";
  for (std::uint16_t code = ABS_X; code <= ABS_RZ; ++code) {
    const bool is_trigger = code == ABS_Z || code == ABS_RZ;
    pad.absolute.push_back({.code = code, .minimum = is_trigger ? 0 : -32'768, .maximum = 32'767});
  }
  for (std::uint16_t code = ABS_HAT0X; code <= ABS_HAT0Y; ++code)
    pad.absolute.push_back({.code = code, .minimum = -1, .maximum = 1});
  pad.keys = {BTN_SOUTH,  BTN_EAST,  BTN_NORTH, BTN_WEST,   BTN_TL,    BTN_TR,
              BTN_SELECT, BTN_START, BTN_MODE,  BTN_THUMBL, BTN_THUMBR};
  pad.force_feedback = {FF_RUMBLE, FF_GAIN};
  pad.effect_count = 16;
  return make_layout(pad, {});
}

bool has_same_channels(const Layout& a, const Layout& b) {
  const auto same = [](const auto& lefts, const auto& rights, auto is_same) {
    return std::ranges::equal(lefts, rights, is_same);
  };
  const auto is_same_range = [](const auto& left, const auto& right) {
    return left.name == right.name && left.unit == right.unit && left.low == right.low &&
           left.high == right.high;
  };
  const driver::Descriptor& left = a.descriptor;
  const driver::Descriptor& right = b.descriptor;
  return left.buttons == right.buttons && same(left.analogs, right.analogs, is_same_range) &&
         same(left.joints, right.joints, is_same_range) &&
         same(left.outputs, right.outputs, is_same_range) && left.modes == right.modes;
}

float analog_value(const AnalogChannel& channel, std::int32_t count) noexcept {
  const AbsoluteAxis& axis = channel.axis;
  const double value = std::clamp(count, axis.minimum, axis.maximum);
  if (channel.scale != 0) return static_cast<float>(value * channel.scale);
  const double low = axis.minimum;
  const double high = axis.maximum;
  if (channel.is_one_sided) return static_cast<float>((value - low) / (high - low));
  const double half = (high - low) / 2;
  const double flat = std::clamp<double>(axis.flat, 0, half / 2);
  const double offset = value - (low + half);
  const double beyond_flat = std::max(0.0, std::abs(offset) - flat) / (half - flat);
  return static_cast<float>(std::copysign(beyond_flat, offset));
}

double wheel_position(const JointChannel& channel, std::int32_t count) noexcept {
  const double low = channel.axis->minimum;
  const double high = channel.axis->maximum;
  const double value = std::clamp(count, channel.axis->minimum, channel.axis->maximum);
  return std::clamp(channel.scale * (value - (low + high) / 2), -channel.end_rad, channel.end_rad);
}

}  // namespace rtpm::device_evdev
