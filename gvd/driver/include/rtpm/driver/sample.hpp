#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <type_traits>

#include "rtpm/base/time.hpp"
#include "rtpm/driver/command.hpp"
#include "rtpm/driver/geometry.hpp"

namespace rtpm::driver {

/// State of a device; wire numbers.
enum class Lifecycle : std::uint8_t {
  kUnconfigured = 0,  ///< Not set up: no samples.
  kInactive = 1,      ///< Set up, no force; the last sample stays.
  kActive = 2,        ///< Samples every cycle; force on command.
  kFault = 3,         ///< No answer: no force; the server retries.
  kFinalized = 4,     ///< Stopped for good.
};
inline constexpr std::uint8_t kLifecycleCount = 5;
/// "unconfigured", "inactive", "active", "fault", "finalized".
[[nodiscard]] std::string_view to_string(Lifecycle lifecycle) noexcept;

/// Bits of Sample::faults; wire numbers. The driver sets bits 0 to 7, the device server the others.
enum class Fault : std::uint32_t {
  /// No new data in this cycle. For a reader over the network, also: no cycle for more than twenty
  /// periods, because the driver does not return or its thread gets no CPU.
  kDeviceLate = 1u << 0,
  kDeviceCorrupt = 1u << 1,     ///< Unreadable data in this cycle.
  kDeviceGone = 1u << 2,        ///< The device does not answer.
  kDeviceSaturated = 1u << 3,   ///< Less force than commanded.
  kOutsideWorkspace = 1u << 4,  ///< At or beyond the workspace's edge.
  kCommandNotFinite =
      1u << 8,             ///< Latched: a command had a NaN or infinity. No force until recover().
  kCommandLost = 1u << 9,  ///< No live command: force went to zero.
  kForceClamped = 1u << 10,      ///< This cycle's command was above the force or torque limit.
  kForceRateLimited = 1u << 11,  ///< This cycle's command changed faster than the limit allows.
  kSoftStart = 1u << 12,         ///< The force is rising to the command.
  kEmergencyStop = 1u << 13,     ///< Latched: no force, and no commands, until rearmed.
  kTooFast = 1u << 14,       ///< Latched: moved faster than the limit. No force until recover().
  kSoftWall = 1u << 15,      ///< Outside the workspace; the soft wall pushes back.
  kPowerLimited = 1u << 16,  ///< The command would have given the user more power than the limit.
  kBraked = 1u << 17,        ///< The passivity guard is braking.
  kHeatLimited = 1u << 18,   ///< The force is reduced because the motors are hot.
  /// An impossible pose or time: beyond 1 km, a rotation that is not a unit quaternion, a host_time
  /// in the future or before the device was opened. The values are the driver's, unchanged.
  kImplausible = 1u << 19,
};

/// A set of faults.
class Faults {
 public:
  constexpr Faults() noexcept = default;
  constexpr explicit Faults(std::uint32_t bits) noexcept : bits_(bits) {}

  constexpr void set(Fault fault) noexcept { bits_ |= static_cast<std::uint32_t>(fault); }
  constexpr void set(Faults other) noexcept { bits_ |= other.bits_; }
  [[nodiscard]] constexpr Faults only(Faults those) const noexcept {
    return Faults{bits_ & those.bits_};
  }
  [[nodiscard]] constexpr bool has(Fault fault) const noexcept {
    return (bits_ & static_cast<std::uint32_t>(fault)) != 0;
  }
  [[nodiscard]] constexpr bool empty() const noexcept { return bits_ == 0; }
  [[nodiscard]] constexpr std::uint32_t bits() const noexcept { return bits_; }
  friend constexpr bool operator==(Faults, Faults) noexcept = default;

 private:
  std::uint32_t bits_ = 0;
};

/// The bits that a driver may set; others are ignored.
inline constexpr Faults kDriverFaults{0xff};

/// The faults as text, "command lost, soft start", or "none". Set-up only: allocates.
[[nodiscard]] std::string to_text(Faults faults);

inline constexpr std::size_t kButtonCountMax = 16;
inline constexpr std::size_t kAnalogCountMax = 8;

/// All values of a device in one cycle, mutually consistent.
/// @ownership plain value, trivially copyable
struct Sample {
  /// Counts the server's cycles from 1; the server sets it.
  std::uint64_t sequence = 0;
  /// Time of measurement on the host's clock. A driver without a timestamp copies
  /// Command::cycle_time.
  MonotonicTime host_time{};
  /// Time of measurement on the device's clock; 0 if it has none.
  Duration device_time{0};
  Pose pose{};
  Twist twist{};
  /// The wrench that the actuators actually apply, after all limits.
  Wrench wrench_applied{};
  /// Positions of Descriptor::joints in their units; for an endless joint they count turns.
  std::array<double, kJointCountMax> joints{};
  /// Velocities of the joints, in the same units per second.
  std::array<double, kJointCountMax> joint_velocities{};
  /// The efforts that the joints' motors actually apply, in newton or newton metre.
  std::array<double, kJointCountMax> efforts_applied{};
  /// The applied outputs, in the units of Descriptor::outputs.
  std::array<float, kOutputCountMax> outputs_applied{};
  /// Analog inputs in the units of Descriptor::analogs, in that order.
  std::array<float, kAnalogCountMax> analogs{};
  /// Bit i is set while button i (of Descriptor::buttons) is pressed.
  std::uint32_t buttons = 0;
  Faults faults{};
  /// Counts the presses and releases of button i, modulo 65536, so that a press between two reads
  /// is not lost.
  std::array<std::uint16_t, kButtonCountMax> button_edges{};
  /// Share, 0 to 1, of good cycles among the last 100: on time, answered, and with a live command
  /// while the lease is held. Set by the server.
  float success_rate = 0;
  /// Set by the server.
  Lifecycle lifecycle = Lifecycle::kUnconfigured;
};
static_assert(std::is_trivially_copyable_v<Sample>);

}  // namespace rtpm::driver
