#pragma once

#include <cstdint>
#include <string_view>

#include "rtpm/rpc/error.hpp"

namespace rtpm::gvd {

/// The outcome of a call to a device; wire numbers below 254.
/// @source   OutcomeCode in schema/idl/device.fbs
enum class DeviceOutcome : std::uint8_t {
  kDone = 0,
  kNotHolder = 1,  ///< This client does not hold the lease. Acquire it; lease_state() tells why.
  kHeld = 2,       ///< Another client holds the lease. Wait, or take it over.
  kTooSoon = 3,    ///< The lease changed a moment ago. Try again; take_over(), after a second.
  kBelowOperatorPriority = 4,  ///< Call with operator_priority() or above.
  kNotActive = 5,              ///< The device is not active. Activate it, or wait until it is back.
  kSuperseded = 6,             ///< Another thread's newer command came first. Nothing to do.
  kNotFinite = 7,              ///< A NaN or an infinity; no force until recover().
  kTooMany = 8,                ///< Too many concurrent commands. Command from fewer threads.
  kWrongMode = 9,              ///< The device does not have the mode. See Descriptor::modes.
  kEmergencyStop = 10,         ///< An emergency stop is in force. Remove its cause, then rearm().
  kOutOfRange = 11,            ///< A number of a model is out of range. See ModelsError::text.
  kNotInSystem = 12,  ///< Only the server's own devices are stopped. Stop the others one by one.
  kNoSample = 254,    ///< The device has no sample yet. Read again.
  kCallFailed = 255,  ///< The call itself failed: DeviceError::call() tells why.
};

/// Why a client's call had no effect: the device refused it, or the call failed.
/// @ownership a value
/// @realtime alloc-free
class DeviceError {
 public:
  // Implicit, because both are errors of a device client.
  // NOLINTNEXTLINE(google-explicit-constructor)
  constexpr DeviceError(DeviceOutcome outcome) noexcept : outcome_(outcome) {}
  // NOLINTNEXTLINE(google-explicit-constructor)
  constexpr DeviceError(rpc::CallError call) noexcept
      : outcome_(DeviceOutcome::kCallFailed), call_(call) {}

  [[nodiscard]] constexpr DeviceOutcome outcome() const noexcept { return outcome_; }
  /// Why the call failed, with kCallFailed.
  [[nodiscard]] constexpr rpc::CallError call() const noexcept { return call_; }
  friend constexpr bool operator==(const DeviceError& a, const DeviceError& b) noexcept {
    return a.outcome_ == b.outcome_ &&
           (a.outcome_ != DeviceOutcome::kCallFailed || a.call_ == b.call_);
  }

 private:
  DeviceOutcome outcome_;
  rpc::CallError call_{};
};

/// A clause for people: the cause and what the caller can do.
[[nodiscard]] std::string_view to_string(const DeviceError& error) noexcept;

}  // namespace rtpm::gvd
