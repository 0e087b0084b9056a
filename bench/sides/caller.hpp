#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>

#include "outcome.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/rt/clock.hpp"

namespace rtpm::bench {

/// Six doubles, as in the paper.
inline constexpr std::size_t kPayloadSize = 48;

/// One call, made again and again by one thread: sends a payload, lets the server compute for
/// `work` if the payload has 48 bytes, and waits for the same payload. Fails with the reason if
/// that did not come within a second, or differs.
/// @threads  one
/// @realtime alloc-free when it succeeds
using Call = std::function<Outcome<>(Duration work)>;

/// Makes `count` echoes on one thread, of which kInFlight are unanswered at a time.
/// @threads  one
using Pipeline = std::function<Outcome<>(std::uint64_t count)>;
inline constexpr std::size_t kInFlight = 64;

/// Computes, without sleeping, until `duration` has passed: the work of all servers.
inline void compute_for(Duration duration) noexcept {
  const MonotonicTime end = rt::now() + duration;
  while (rt::now() < end) {
  }
}

}  // namespace rtpm::bench
