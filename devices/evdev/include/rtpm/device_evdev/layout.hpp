#pragma once

#include <cstdint>
#include <numbers>
#include <optional>
#include <string>
#include <vector>

#include "rtpm/device_evdev/effects.hpp"
#include "rtpm/device_evdev/event.hpp"
#include "rtpm/driver/descriptor.hpp"

namespace rtpm::device_evdev {

/// Properties of a device that the kernel does not report.
struct Scales {
  /// The full range of a steering wheel. Most motorised wheels have 900°.
  double wheel_range_rad = 5 * std::numbers::pi;
  double effort_newton_metre_max = 2;  ///< The motor's effort at full level.
  double counts_per_m = 39'370;        ///< Scale of relative axes in metres: 1000 counts per inch.
  double counts_per_turn = 24;         ///< Scale of relative axes in radians.
  bool is_reversed = false;            ///< A positive effort moves towards smaller positions.
};

/// Maps an absolute axis to an analog: the count times `scale`, or normalised if `scale` is 0.
struct AnalogChannel {
  AbsoluteAxis axis{};
  double scale = 0;
  /// If true, normalised to 0 to 1, for example a trigger; otherwise to −1 to 1.
  bool is_one_sided = false;
};

/// Maps an axis to a joint.
struct JointChannel {
  std::uint16_t code = 0;
  double scale = 0;    ///< Units of the joint per count.
  double end_rad = 0;  ///< A wheel's position at the axis maximum.
  /// The axis of a wheel; nullopt if the axis is relative, so that its counts are summed.
  std::optional<AbsoluteAxis> axis{};
};

/// Maps each axis, key and effect to a channel in the descriptor.
struct Layout {
  driver::Descriptor descriptor{};  ///< Complete except for serial number and frame.
  std::vector<AnalogChannel> analogs{};
  std::vector<JointChannel> joints{};
  std::vector<std::uint16_t> buttons{};
  std::vector<EffectKind> effects{};
  bool has_gain = false;
  bool has_autocenter = false;
  /// The device's axes, keys and effects without a channel, as text for users; may be empty.
  std::string left_out{};
};

/// Creates the layout of a device, with as many axes, keys and effects as fit in a descriptor and
/// the device's capacity. Axes without a range and axes of touch points are left out and listed in
/// `left_out`.
/// @realtime set-up only
[[nodiscard]] Layout make_layout(const Capabilities& capabilities, const Scales& scales);

/// The layout used for a device that is not plugged in: the game pad from the kernel's
/// documentation, with two sticks, two triggers, a d-pad, eleven buttons and rumble.
/// @source   Linux, Documentation/input/gamepad.rst
[[nodiscard]] Layout game_pad_layout();

/// Whether both layouts have the same channels, so that a program for one can use the other.
[[nodiscard]] bool has_same_channels(const Layout& a, const Layout& b);

/// Converts the value of `axis` to an analog, within the analog's range.
/// @realtime alloc-free
[[nodiscard]] float analog_value(const AnalogChannel& channel, std::int32_t count) noexcept;
/// The position of a wheel, within the range of its joint.
/// @realtime alloc-free
[[nodiscard]] double wheel_position(const JointChannel& channel, std::int32_t count) noexcept;

}  // namespace rtpm::device_evdev
