#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>
#include <type_traits>

#include "rtpm/base/time.hpp"
#include "rtpm/driver/geometry.hpp"

namespace rtpm::driver {

inline constexpr std::size_t kJointCountMax = 8;
inline constexpr std::size_t kOutputCountMax = 8;

/// The kind of setpoint; wire numbers. A descriptor lists the modes of its device.
enum class CommandMode : std::uint8_t {
  kOff = 0,            ///< No force, no motion, outputs at their safe values.
  kForce = 1,          ///< Apply the wrench.
  kPose = 2,           ///< Move to the pose.
  kVelocity = 3,       ///< Move with the twist.
  kJointPosition = 4,  ///< Move each joint to its position.
  kJointVelocity = 5,  ///< Move each joint with its velocity.
  kJointEffort = 6,    ///< Apply each joint's effort.
  kOutputs = 7,        ///< Set the outputs; force and motion do not change.
};
inline constexpr std::uint8_t kCommandModeCount = 8;
/// "off", "force", "pose", "velocity", "joint position", "joint velocity", "joint effort",
/// "outputs".
[[nodiscard]] std::string_view to_string(CommandMode mode) noexcept;

/// A client's request to a device, in force until the next setpoint. The mode selects which of
/// wrench, pose, twist and joints applies. All-zero outputs leave the outputs unchanged, except in
/// kOutputs, which sets them, and in kOff, which makes them safe.
/// @ownership plain value, trivially copyable
struct Setpoint {
  CommandMode mode = CommandMode::kOff;
  Wrench wrench{};
  Pose pose{};
  Twist twist{};
  /// Positions in the units of Descriptor::joints, velocities in these per second, or efforts in
  /// newton (joints in m) or newton metre (joints in rad).
  std::array<double, kJointCountMax> joints{};
  /// In the units of Descriptor::outputs, in that order.
  std::array<float, kOutputCountMax> outputs{};

  /// Applies `wrench`.
  [[nodiscard]] static Setpoint with_wrench(const Wrench& wrench) noexcept {
    Setpoint setpoint;
    setpoint.mode = CommandMode::kForce;
    setpoint.wrench = wrench;
    return setpoint;
  }
  /// Sets the outputs.
  [[nodiscard]] static Setpoint with_outputs(
      const std::array<float, kOutputCountMax>& outputs) noexcept {
    Setpoint setpoint;
    setpoint.mode = CommandMode::kOutputs;
    setpoint.outputs = outputs;
    return setpoint;
  }
};
static_assert(std::is_trivially_copyable_v<Setpoint>);

/// The command until the next cycle. The safety filter has made it finite and limited it to the
/// descriptor's range.
/// @ownership plain value, trivially copyable
struct Command : Setpoint {
  /// Counts cycles from 1, so that a device can echo the command that it executes.
  std::uint64_t sequence = 0;
  /// When this cycle started, on the host's clock; never decreases.
  MonotonicTime cycle_time{};
  /// The time by which force, motion and outputs must end if no newer command arrives. Pass it to
  /// the device's watchdog, if it has one, in case this program dies.
  MonotonicTime deadline = kNever;
};
static_assert(std::is_trivially_copyable_v<Command>);

}  // namespace rtpm::driver
