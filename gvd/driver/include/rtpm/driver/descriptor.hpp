#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "rtpm/driver/geometry.hpp"

namespace rtpm::driver {

/// What kind of device it is. The numbers stand on the wire and never change.
enum class DeviceClass : std::uint8_t {
  kHaptic = 0,   ///< Measures a position and applies a force.
  kTracker = 1,  ///< Measures a pose.
  kInput = 2,    ///< Buttons and analog inputs.
};
inline constexpr std::uint8_t kDeviceClassCount = 3;
/// "haptic", "tracker", "input".
[[nodiscard]] std::string_view to_string(DeviceClass device_class) noexcept;

/// One direction in which the end effector moves.
struct Axis {
  std::string name;          ///< "x", "y", "z" along the frame's axes, "rx", "ry", "rz" about them.
  bool is_sensed = true;     ///< Its position is in the sample's pose.
  bool is_actuated = false;  ///< A force or torque along it has an effect.
};

/// One analog input.
struct Analog {
  std::string name;
  std::string unit;  ///< SI, "1" for a plain ratio.
  double low = 0;    ///< The least value.
  double high = 1;   ///< The greatest.
};

/// What the device bears and gives. A limit of zero means that it has none of it to give.
struct Limits {
  double force_newton_max = 0;         ///< Length of the greatest force, in any direction.
  double torque_newton_metre_max = 0;  ///< Likewise of the torque.
  /// The stiffest wall that stays passive when rendered in the device's own loop at `rate_hz`.
  double stiffness_newton_per_m_max = 0;
  /// The damping that the mechanics have of themselves. It bounds what a loop further away may
  /// render: stiffness × (period / 2 + delay) must stay below it.
  double damping_newton_s_per_m = 0;
};

/// The box in which the end effector moves.
struct Workspace {
  Vector3 low_m{};
  Vector3 high_m{};
};

/// What a device is and can, so that a program that never heard of it can use it.
/// @ownership a value. Set-up only: holds strings
struct Descriptor {
  DeviceClass device_class = DeviceClass::kInput;
  std::string model;   ///< As the maker calls it.
  std::string serial;  ///< Tells two devices of one model apart; never empty.
  std::string frame;   ///< The name of the right-handed frame of all poses and forces, "arm0/base".
  std::vector<Axis> axes{};
  std::vector<std::string> buttons{};  ///< Names, at most kButtonCountMax.
  std::vector<Analog> analogs{};       ///< At most kAnalogCountMax.
  Limits limits{};
  Workspace workspace{};
  double rate_hz = 1000;             ///< How often exchange() wants to be called.
  double position_resolution_m = 0;  ///< The step of the position; 0 if it has none.
};

}  // namespace rtpm::driver
