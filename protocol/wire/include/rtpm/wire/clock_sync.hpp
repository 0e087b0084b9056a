#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "rtpm/base/time.hpp"

namespace rtpm::wire {

/// The four times of a call: when each side sent its frame and received the other's.
struct ClockProbe {
  MonotonicTime request_sent{};      ///< On the client's clock.
  MonotonicTime request_received{};  ///< On the server's clock.
  MonotonicTime reply_sent{};        ///< On the server's clock.
  MonotonicTime reply_received{};    ///< On the client's clock.
};

/// An estimate of the peer's clock.
struct PeerClock {
  Duration offset{};       ///< The current difference: the peer's clock minus this one.
  Duration uncertainty{};  ///< The true offset is within this of `offset`.
  double drift_ppm = 0;    ///< How much faster the peer's clock runs; 0 until known.
};

/// Estimates the peer's clock from calls, each of which is a probe. A probe's round trip bounds its
/// error, so shorter ones are better: for each of the last 16 seconds with probes, the best one is
/// kept. The line through them gives the drift.
/// @threads  one at a time
/// @realtime alloc-free, a few ns to add
/// @source   spec/hprotocol.md#hp-5.7; the probe is NTP's (RFC 5905, section 8)
class ClockEstimator {
 public:
  void add(const ClockProbe& probe) noexcept;
  /// nullopt before the first probe.
  [[nodiscard]] std::optional<PeerClock> estimate(MonotonicTime now) const noexcept;
  /// Call it for another peer, or after the peer's restart.
  void clear() noexcept { *this = ClockEstimator{}; }

 private:
  struct Point {
    MonotonicTime time{};  ///< On this clock, in the middle of the probe.
    Duration offset{};
    Duration half_trip{};
  };
  static constexpr std::size_t kPointCountMax = 16;

  [[nodiscard]] std::optional<double> slope() const noexcept;

  std::array<Point, kPointCountMax> points_{};  ///< A ring; the newest is at newest_.
  std::size_t count_ = 0;
  std::size_t newest_ = 0;
};

}  // namespace rtpm::wire
