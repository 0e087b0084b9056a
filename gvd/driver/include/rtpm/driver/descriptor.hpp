#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "rtpm/driver/command.hpp"
#include "rtpm/driver/geometry.hpp"

namespace rtpm::driver {

/// Class of a device; wire numbers. It states the device's purpose; the channels state its parts.
enum class DeviceClass : std::uint8_t {
  kHaptic = 0,   ///< Measures a position and applies a force.
  kTracker = 1,  ///< Measures the pose of a body, a head or a gaze; a gaze's ray is the frame's -z.
  kInput = 2,    ///< Buttons and analog inputs.
  kDial = 3,     ///< A joint that turns endlessly, with or without a motor.
  kVibrotactile = 4,  ///< Vibrates: outputs in pairs, amplitude and frequency.
  kPoser = 5,         ///< Moves to a pose or with a velocity.
  kOutput = 6,        ///< Analog outputs and lamps.
  kPlayer = 7,        ///< Plays media: rate and position as outputs, position as an analog.
  kBiometric = 8,     ///< Signals of a body as analogs, such as pulse or skin conductance.
};
inline constexpr std::uint8_t kDeviceClassCount = 9;
/// "haptic", "tracker", "input", "dial", "vibrotactile", "poser", "output", "player", "biometric".
[[nodiscard]] std::string_view to_string(DeviceClass device_class) noexcept;

/// A degree of freedom of the end effector.
struct Axis {
  std::string name;          ///< "x", "y", "z" along the frame's axes, "rx", "ry", "rz" about them.
  bool is_sensed = true;     ///< The sample's pose contains its position.
  bool is_actuated = false;  ///< A force or torque along it has an effect.
};

/// One analog input.
struct Analog {
  std::string name;
  std::string unit;  ///< SI, "1" for a plain ratio.
  double low = 0;    ///< Minimum.
  double high = 1;   ///< Maximum.
};

/// One joint, gripper or dial.
struct Joint {
  std::string name;         ///< "elbow", "gripper", "dial".
  std::string unit;         ///< "rad", or "m" for a joint that slides.
  double low = 0;           ///< Minimum position; equal to `high` if it turns endlessly.
  double high = 0;          ///< Maximum position.
  double velocity_max = 0;  ///< In units per second; 0 if commands cannot move it.
  double effort_max = 0;    ///< In newton or newton metre; 0 without a motor.
};

/// One output: an analog value, a lamp, an amplitude.
struct Output {
  std::string name;
  std::string unit;  ///< SI, "1" for a plain ratio.
  double low = 0;    ///< Minimum.
  double high = 1;   ///< Maximum.
  double safe = 0;   ///< Its value without a command.
};

/// Limits of a device; 0 for missing actuators.
struct Limits {
  double force_newton_max = 0;         ///< Maximum magnitude in any direction.
  double torque_newton_metre_max = 0;  ///< Maximum magnitude of the torque.
  /// The stiffest wall that stays passive when the device's own loop renders it at `rate_hz`.
  double stiffness_newton_per_m_max = 0;
  /// The mechanics' own damping, which bounds rendering in a remote loop: stiffness × (period / 2 +
  /// delay) must stay below it.
  double damping_newton_s_per_m = 0;
  double velocity_m_per_s_max = 0;  ///< Limit of commanded motion; 0 if commands cannot move it.
  /// Limit of commanded rotation; 0 if commands cannot turn it.
  double velocity_rad_per_s_max = 0;
};

/// The box in which the end effector moves.
struct Workspace {
  Vector3 low_m{};
  Vector3 high_m{};
};

/// Self-description of a device, for programs that have no prior knowledge of it.
/// @ownership a value
struct Descriptor {
  DeviceClass device_class = DeviceClass::kInput;
  std::string model;   ///< The maker's name.
  std::string serial;  ///< Unique per model; never empty.
  std::string frame;   ///< The name of the right-handed frame of all poses and forces, "arm0/base".
  std::vector<Axis> axes{};
  std::vector<std::string> buttons{};  ///< Names, at most kButtonCountMax.
  std::vector<Analog> analogs{};       ///< At most kAnalogCountMax.
  std::vector<Joint> joints{};         ///< At most kJointCountMax.
  std::vector<Output> outputs{};       ///< At most kOutputCountMax.
  std::vector<CommandMode> modes{};  ///< Modes besides kOff; empty for a device that only measures.
  Limits limits{};
  Workspace workspace{};
  double rate_hz = 1000;             ///< Rate of exchange().
  double position_resolution_m = 0;  ///< Step of the position; 0 if unknown.
};

}  // namespace rtpm::driver
