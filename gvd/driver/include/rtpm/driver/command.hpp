#pragma once

#include <cstdint>
#include <type_traits>

#include "rtpm/base/time.hpp"
#include "rtpm/driver/geometry.hpp"

namespace rtpm::driver {

/// Mode of the actuators.
enum class CommandMode : std::uint8_t {
  kOff = 0,    ///< No force: the end effector is free to move. The wrench is zero.
  kForce = 1,  ///< Apply the wrench.
};

/// The command until the next cycle. It has passed the safety filter: finite and within the
/// descriptor's limits.
/// @ownership plain value, trivially copyable
struct Command {
  CommandMode mode = CommandMode::kOff;
  /// Counts cycles from 1, so that a device can echo the command that it executes.
  std::uint64_t sequence = 0;
  /// When this cycle began, on the host's clock; never decreases.
  MonotonicTime cycle_time{};
  /// When the force must have ended without a newer command. Pass it to the device's watchdog, if
  /// any, for the case that this program dies.
  MonotonicTime deadline = kNever;
  Wrench wrench{};
};
static_assert(std::is_trivially_copyable_v<Command>);

}  // namespace rtpm::driver
