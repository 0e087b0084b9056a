#pragma once

#include <chrono>
#include <cstdint>
#include <string_view>

#include "rtpm/base/time.hpp"

namespace rtpm::gvd {

/// How long a lease lasts, and how fast it may change hands.
struct LeaseConfig {
  /// How long a holder keeps the lease without a sign of life.
  Duration silence_max = std::chrono::seconds{1};
  /// How long a holder keeps the lease without using it: renewals alone do not keep it.
  Duration idle_max = std::chrono::seconds{10};
  /// From one acquire() that succeeded to the next, at least.
  Duration acquire_interval = std::chrono::milliseconds{100};
  /// From one take_over() that succeeded to the next, at least.
  Duration take_over_interval = std::chrono::seconds{1};
};

/// How a lease stands. The numbers stand on the wire and never change.
enum class LeaseState : std::uint8_t {
  kUnknown = 0,     ///< There was no such lease, or too many came after it.
  kHeld = 1,        ///< Its holder may command.
  kReleased = 2,    ///< Its holder gave it back.
  kSilent = 3,      ///< Its holder gave no sign of life for LeaseConfig::silence_max.
  kIdle = 4,        ///< Its holder used it for nothing for LeaseConfig::idle_max.
  kTakenOver = 5,   ///< An operator took it over.
  kDeviceLost = 6,  ///< The device was lost or stopped.
};
inline constexpr std::uint8_t kLeaseStateCount = 7;
/// A clause for a person: "an operator took the lease over".
[[nodiscard]] std::string_view to_string(LeaseState state) noexcept;

}  // namespace rtpm::gvd
