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

/// The properties of a device that the kernel does not know.
struct Scales {
  /// A steering wheel's range from end to end. Most wheels with a motor have 900°.
  double wheel_range_rad = 5 * std::numbers::pi;
  double effort_newton_metre_max = 2;  ///< The motor's effort at the full level.
  double counts_per_m = 39'370;        ///< Scale of relative axes in m: 1000 counts per inch.
  double counts_per_turn = 24;         ///< Scale of relative axes in rad.
  bool is_reversed = false;            ///< A positive effort turns towards smaller positions.
};

/// An absolute axis as an analog: the count times `scale`, or normalised if `scale` is 0.
struct AnalogChannel {
  AbsoluteAxis axis{};
  double scale = 0;
  bool is_one_sided = false;  ///< Normalised to 0 to 1, such as a trigger; otherwise to −1 to 1.
};

/// An axis as a joint.
struct JointChannel {
  std::uint16_t code = 0;
  double scale = 0;                    ///< Units of the joint per count.
  double end_rad = 0;                  ///< A wheel's position at its maximum.
  std::optional<AbsoluteAxis> axis{};  ///< A wheel's axis; nullopt if relative: its counts add up.
};

/// Maps each axis, key and effect to a channel of the descriptor.
struct Layout {
  driver::Descriptor descriptor{};  ///< Complete but for serial and frame.
  std::vector<AnalogChannel> analogs{};
  std::vector<JointChannel> joints{};
  std::vector<std::uint16_t> buttons{};
  std::vector<EffectKind> effects{};
  bool has_gain = false;
  bool has_autocenter = false;
  /// Axes, keys and effects of the device that no channel has, for people; may be empty.
  std::string left_out{};
};

/// The layout of a device: as many axes, keys and effects as a descriptor and the device have
/// capacity for. Axes without a range are left out, and so are those of touch points: `left_out`
/// names them.
/// @realtime set-up only
[[nodiscard]] Layout make_layout(const Capabilities& capabilities, const Scales& scales);

/// The layout of a device that is not plugged in: the game pad of the kernel's documentation, with
/// two sticks, two triggers, a cross, eleven buttons and rumble.
/// @source   Linux, Documentation/input/gamepad.rst
[[nodiscard]] Layout game_pad_layout();

/// Whether both have the same channels, so that a program that knows one can use the other.
[[nodiscard]] bool has_same_channels(const Layout& a, const Layout& b);

/// The value of `axis` as an analog, within the analog's range.
/// @realtime alloc-free
[[nodiscard]] float analog_value(const AnalogChannel& channel, std::int32_t count) noexcept;
/// The position of a wheel, within its joint's range.
/// @realtime alloc-free
[[nodiscard]] double wheel_position(const JointChannel& channel, std::int32_t count) noexcept;

}  // namespace rtpm::device_evdev
