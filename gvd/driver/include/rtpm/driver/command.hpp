#pragma once

#include <cstdint>
#include <type_traits>

#include "rtpm/base/time.hpp"
#include "rtpm/driver/geometry.hpp"

namespace rtpm::driver {

/// What a command asks of the actuators.
enum class CommandMode : std::uint8_t {
  kOff = 0,    ///< No force: the end effector is free to move. The wrench is zero.
  kForce = 1,  ///< Apply the wrench.
};

/// What the device is to do from this cycle until the next. It has passed the safety filter: finite
/// and within the descriptor's limits.
/// @ownership plain value, trivially copyable
struct Command {
  CommandMode mode = CommandMode::kOff;
  /// Counts the cycles from 1, so that a device that echoes it shows which command it obeys.
  std::uint64_t sequence = 0;
  /// When this cycle began, on the host's clock. It never goes back.
  MonotonicTime cycle_time{};
  /// When the force must have ended unless a newer command came. A device with a watchdog of its
  /// own passes it on, so that it lets go even if this program dies.
  MonotonicTime deadline = kNever;
  Wrench wrench{};
};
static_assert(std::is_trivially_copyable_v<Command>);

}  // namespace rtpm::driver
