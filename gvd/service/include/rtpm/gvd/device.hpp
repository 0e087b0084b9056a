#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <string_view>

#include "rtpm/base/priority.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/gvd/emergency.hpp"
#include "rtpm/gvd/lease.hpp"
#include "rtpm/gvd/observer.hpp"
#include "rtpm/safety/filter.hpp"

namespace rtpm::gvd {

/// Receives a message for each change of a device: lost, back, activation failed.
/// @threads  report() runs on the device's thread, outside its real-time part
class DeviceListener {
 public:
  DeviceListener() = default;
  DeviceListener(const DeviceListener&) = delete;
  DeviceListener& operator=(const DeviceListener&) = delete;
  virtual ~DeviceListener() = default;
  virtual void report(std::string_view text) = 0;
};

/// Configures a device.
struct CycleConfig {
  Duration period = std::chrono::milliseconds{1};  ///< The period of the device's loop.
  LeaseConfig lease{};                             ///< The rules of the right to command.
  /// Minimum priority of a call that takes the lease over: below the device's thread, above its
  /// clients.
  Priority operator_priority{28000};
  Duration retry = std::chrono::milliseconds{500};  ///< Pause between retries of a lost device.
  /// How long cycles may be late or corrupt, and for more than twenty cycles, before the device
  /// counts as gone. Its force goes to zero after twenty cycles.
  Duration gone_after = std::chrono::milliseconds{200};
  /// Limits of the safety filter; by default SafetyConfig::for_device().
  std::optional<SafetyConfig> safety{};
  DeviceListener* listener = nullptr;  ///< May be null; must outlive the device's server.
  CycleObserver* observer = nullptr;   ///< May be null; must outlive the device's server.
  /// The emergency stops of the hosting program; must outlive the server. Null if it hosts no other
  /// device.
  EmergencyStops* emergency_stops = nullptr;
  /// Must outlive the server. If null, an emergency stop is forgotten when the device's server
  /// ends.
  StopMemory* stop_memory = nullptr;
};

/// Counters of a device.
struct DeviceCounters {
  std::uint64_t cycle_count = 0;
  std::uint64_t missed_count = 0;            ///< Cycles skipped because the thread was late.
  std::uint64_t late_count = 0;              ///< Exchanges without new data.
  std::uint64_t corrupt_count = 0;           ///< Exchanges with unreadable data.
  std::uint64_t gone_count = 0;              ///< How often the device was lost.
  std::uint64_t command_count = 0;           ///< Commands accepted.
  std::uint64_t foreign_command_count = 0;   ///< Refused: not from the lease's holder.
  std::uint64_t old_command_count = 0;       ///< Refused: older than the newest.
  std::uint64_t hasty_command_count = 0;     ///< Refused: too many concurrent commands.
  std::uint64_t lease_expired_count = 0;     ///< Leases that ended because their holder was silent.
  std::uint64_t lease_idle_count = 0;        ///< Leases that ended because their holder was idle.
  std::uint64_t lease_taken_over_count = 0;  ///< Leases taken over by an operator.
  SafetyCounters safety{};
};

}  // namespace rtpm::gvd
