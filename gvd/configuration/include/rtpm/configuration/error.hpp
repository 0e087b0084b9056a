#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "rtpm/base/setup_error.hpp"

namespace rtpm::gvd {

/// Outcome of a request to a device's configuration; wire numbers. With any outcome but kDone
/// nothing has changed.
enum class ConfigurationOutcome : std::uint8_t {
  kDone = 0,
  kUnknownParameter = 1,
  kWrongType = 2,
  kOutOfRange = 3,
  kReadOnly = 4,
  kWrongState = 5,         ///< The parameter can't change while the device is active.
  kRepeatedParameter = 6,  ///< The request names a parameter twice.
  kStaleRevision = 7,      ///< Another client changed a parameter first.
  kBusy = 8,               ///< Too many requests, no cycle in time, or a calibration is running.
  kRefusedByDevice = 9,    ///< The driver refused the values.
  kNotPersistent = 10,     ///< The device's server has no folder to save to.
  kStorageFailed = 11,     ///< The operating system could not save.
  kUnknownCalibration = 12,
  kNoSuchRun = 13,    ///< The calibration's run has ended, or never started.
  kWrongAnswer = 14,  ///< The calibration is not waiting for this answer.
  kNoResult = 15,     ///< The calibration has no result to keep.
  kCallFailed = 255,  ///< Client only: the call got no reply; it may have run.
};
inline constexpr std::uint8_t kConfigurationOutcomeCount = 16;
/// "done", "unknown parameter", "stale revision", …
[[nodiscard]] std::string_view to_string(ConfigurationOutcome outcome) noexcept;

/// The error of a refused request.
/// @ownership a value
struct ConfigurationError {
  ConfigurationOutcome outcome = ConfigurationOutcome::kCallFailed;
  std::string parameter{};  ///< The parameter's name, if the error concerns one.
  SetupError words{};       ///< The problem, its cause and the remedy, for people.
};

}  // namespace rtpm::gvd
