#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/rt/finding.hpp"

// The facts of a host with Windows, and their judgements, which depend on them only.
namespace rtpm::rt {

enum class PowerScheme : std::uint8_t { kUnknown, kPerformance, kOther };

struct WindowsFacts {
  std::optional<SetupError> realtime_refusal{};     ///< nullopt if granted.
  std::optional<SetupError> memory_lock_refusal{};  ///< nullopt if granted.
  std::string memory_lock{};                        ///< How much memory stays resident.
  /// The percentage of each CPU that MMCSS leaves to other work.
  std::uint32_t responsiveness = 20;
  /// How many packets a millisecond the system takes from the network while MMCSS has threads;
  /// nullopt if that is not limited.
  std::optional<std::uint32_t> packets_per_ms = 10;
  bool is_virtual_machine = false;
  int usable_cpu_count = 1;
  PowerScheme power = PowerScheme::kUnknown;
  std::int64_t clock_frequency = 0;  ///< The performance counter's, in Hz.
  bool has_fine_timers = false;
  bool is_clock_synchronised = false;
  bool has_firewall = false;
  /// How long this machine waits for a user before it sleeps, on mains; 0: it does not.
  std::uint32_t sleeps_after_s = 0;
  std::uint64_t free_commit = 0;  ///< How many bytes all programs may still ask for.
};

/// Makes the same requests to the system as RTPM does. Locks the process's memory.
/// @realtime set-up only
[[nodiscard]] WindowsFacts read_windows();

/// A finding for each subject, in a fixed order.
/// @realtime set-up only
[[nodiscard]] std::vector<Finding> judge_windows(const WindowsFacts& facts);

}  // namespace rtpm::rt
