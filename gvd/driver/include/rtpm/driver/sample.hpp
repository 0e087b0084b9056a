#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <type_traits>

#include "rtpm/base/time.hpp"
#include "rtpm/driver/geometry.hpp"

namespace rtpm::driver {

/// What state a device is in. The numbers stand on the wire and never change.
enum class Lifecycle : std::uint8_t {
  kUnconfigured = 0,  ///< Known, not yet set up: no samples.
  kInactive = 1,      ///< Set up, at rest: the last sample stands, no force.
  kActive = 2,        ///< Samples every cycle; force if somebody commands it.
  kFault = 3,         ///< The device does not answer any more: no force, the server tries again.
  kFinalized = 4,     ///< Stopped for good.
};
inline constexpr std::uint8_t kLifecycleCount = 5;
/// "unconfigured", "inactive", "active", "fault", "finalized".
[[nodiscard]] std::string_view to_string(Lifecycle lifecycle) noexcept;

/// What is wrong or limited, as bits of Sample::faults. The numbers stand on the wire and never
/// change. The driver sets bits 0 to 7, the device server the others.
enum class Fault : std::uint32_t {
  kDeviceLate = 1u << 0,        ///< This cycle brought no new data: the values are older.
  kDeviceCorrupt = 1u << 1,     ///< This cycle's data was unreadable: the values are older.
  kDeviceGone = 1u << 2,        ///< The device does not answer any more.
  kDeviceSaturated = 1u << 3,   ///< The actuators gave less force than was asked for.
  kOutsideWorkspace = 1u << 4,  ///< The end effector is at or beyond the workspace's edge.
  kCommandNotFinite =
      1u << 8,               ///< Latched: a command had a NaN or infinity. No force till recover.
  kCommandLost = 1u << 9,    ///< The commands stopped: the force went to zero until the next.
  kForceClamped = 1u << 10,  ///< This cycle's command was above the force or torque limit.
  kForceRateLimited = 1u << 11,  ///< This cycle's command rose faster than the limit allows.
  kSoftStart = 1u << 12,         ///< The force is still rising to what is commanded.
};

/// A set of faults.
class Faults {
 public:
  constexpr Faults() noexcept = default;
  constexpr explicit Faults(std::uint32_t bits) noexcept : bits_(bits) {}

  constexpr void set(Fault fault) noexcept { bits_ |= static_cast<std::uint32_t>(fault); }
  constexpr void set(Faults other) noexcept { bits_ |= other.bits_; }
  [[nodiscard]] constexpr bool has(Fault fault) const noexcept {
    return (bits_ & static_cast<std::uint32_t>(fault)) != 0;
  }
  [[nodiscard]] constexpr bool empty() const noexcept { return bits_ == 0; }
  [[nodiscard]] constexpr std::uint32_t bits() const noexcept { return bits_; }
  friend constexpr bool operator==(Faults, Faults) noexcept = default;

 private:
  std::uint32_t bits_ = 0;
};

/// The faults in words, "command lost, soft start", or "none".   Set-up only: allocates.
[[nodiscard]] std::string to_text(Faults faults);

inline constexpr std::size_t kButtonCountMax = 16;
inline constexpr std::size_t kAnalogCountMax = 8;

/// Everything that one device says in one cycle, as one value: nobody ever sees the position of one
/// cycle with the buttons of another.
/// @ownership plain value, trivially copyable
struct Sample {
  /// Counts the server's cycles from 1; the server sets it.
  std::uint64_t sequence = 0;
  /// When the values were measured, on the host's clock, as near to the measurement as the driver
  /// can tell. A driver without a stamp of its own copies Command::cycle_time.
  MonotonicTime host_time{};
  /// The same on the device's own clock, which has its own zero and rate; 0 if it has none.
  Duration device_time{0};
  Pose pose{};
  Twist twist{};
  /// What the actuators really apply, limits included.
  Wrench wrench_applied{};
  /// Analog inputs in the units of Descriptor::analogs, in that order.
  std::array<float, kAnalogCountMax> analogs{};
  /// Bit i is set while button i (of Descriptor::buttons) is pressed.
  std::uint32_t buttons = 0;
  Faults faults{};
  /// How often button i was pressed or released so far, modulo 65536: a press between two reads is
  /// not lost.
  std::array<std::uint16_t, kButtonCountMax> button_edges{};
  /// The share, 0 to 1, of the last 100 cycles that were good: on time, answered by the device and,
  /// while somebody holds the lease, with a command that had not expired. The server sets it.
  float success_rate = 0;
  /// The server sets it.
  Lifecycle lifecycle = Lifecycle::kUnconfigured;
};
static_assert(std::is_trivially_copyable_v<Sample>);

}  // namespace rtpm::driver
