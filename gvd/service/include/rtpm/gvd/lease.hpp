#pragma once

#include <chrono>
#include <cstdint>
#include <string_view>

#include "rtpm/base/time.hpp"

namespace rtpm::gvd {

/// Times of a lease.
struct LeaseConfig {
  /// How long the holder may be silent before the lease ends.
  Duration silence_max = std::chrono::seconds{1};
  /// How long the holder may only renew before the lease ends.
  Duration idle_max = std::chrono::seconds{10};
  /// Minimum time between two successful calls of acquire().
  Duration acquire_interval = std::chrono::milliseconds{100};
  /// Minimum time between two successful calls of take_over().
  Duration take_over_interval = std::chrono::seconds{1};
  /// How long an operator, who took the lease over, may be silent before it ends. There is no
  /// `idle_max` for an operator, who may hold a device without commanding it.
  Duration operator_silence_max = std::chrono::seconds{5};

  /// The times of a lease that was taken over.
  [[nodiscard]] constexpr LeaseConfig of_operator() const noexcept {
    LeaseConfig config = *this;
    config.silence_max = operator_silence_max;
    config.idle_max = std::chrono::hours{24 * 365 * 100};
    return config;
  }
};

/// State of a lease; wire numbers.
enum class LeaseState : std::uint8_t {
  kUnknown = 0,     ///< No such lease, or it ended too long ago.
  kHeld = 1,        ///< Its holder may command.
  kReleased = 2,    ///< Released by its holder.
  kSilent = 3,      ///< Silent for LeaseConfig::silence_max.
  kIdle = 4,        ///< Unused for LeaseConfig::idle_max.
  kTakenOver = 5,   ///< Taken over by an operator.
  kDeviceLost = 6,  ///< The device was lost or stopped.
};
inline constexpr std::uint8_t kLeaseStateCount = 7;
/// A clause for people: "an operator took the lease over".
[[nodiscard]] std::string_view to_string(LeaseState state) noexcept;

}  // namespace rtpm::gvd
