#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <string_view>

#include "rtpm/base/priority.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/gvd/lease.hpp"
#include "rtpm/gvd/safety.hpp"

namespace rtpm::gvd {

/// Is told, in one sentence each, what happens to a device: lost, back, not to be activated.
/// @threads  report() runs on the device's thread, outside its real-time part
class DeviceListener {
 public:
  DeviceListener() = default;
  DeviceListener(const DeviceListener&) = delete;
  DeviceListener& operator=(const DeviceListener&) = delete;
  virtual ~DeviceListener() = default;
  virtual void report(std::string_view text) = 0;
};

/// How a device is run.
struct CycleConfig {
  Duration period = std::chrono::milliseconds{1};  ///< Of the device's loop.
  LeaseConfig lease{};  ///< How long a client keeps the right to command.
  /// Calls of this priority and above may take the lease over. Below the device's own thread, so
  /// that nobody can delay it, and above its clients.
  Priority operator_priority{28000};
  Duration retry = std::chrono::milliseconds{500};  ///< Between tries to reach a lost device.
  std::uint32_t bad_cycle_max = 20;  ///< So many late or corrupt cycles in a row count as gone.
  /// What the safety filter allows; nothing: the defaults with the device's own limits.
  std::optional<SafetyConfig> safety{};
  DeviceListener* listener = nullptr;  ///< If there is one, it must outlive the device's server.
};

/// What happened so far on the device's side.
struct DeviceCounters {
  std::uint64_t cycle_count = 0;
  std::uint64_t missed_count = 0;            ///< Cycles left out because the thread was late.
  std::uint64_t late_count = 0;              ///< Exchanges without new data.
  std::uint64_t corrupt_count = 0;           ///< Exchanges with unreadable data.
  std::uint64_t gone_count = 0;              ///< Times that the device was lost.
  std::uint64_t command_count = 0;           ///< Commands accepted.
  std::uint64_t foreign_command_count = 0;   ///< Refused: not from the lease's holder.
  std::uint64_t old_command_count = 0;       ///< Refused: older than the newest.
  std::uint64_t hasty_command_count = 0;     ///< Refused: met many others in the same instant.
  std::uint64_t lease_expired_count = 0;     ///< Leases that ended because their holder was silent.
  std::uint64_t lease_idle_count = 0;        ///< Leases that ended because their holder was idle.
  std::uint64_t lease_taken_over_count = 0;  ///< Leases that an operator took away.
  SafetyCounters safety{};
};

}  // namespace rtpm::gvd
