#pragma once

#include <cstdint>
#include <ctime>

#include "rtpm/base/time.hpp"
#include "rtpm/rt/clock.hpp"

namespace rtpm::console {

/// A time of this host's monotonic clock as nanoseconds since 1970, for people and files.
[[nodiscard]] inline std::uint64_t wall_time_ns(MonotonicTime time) noexcept {
  std::timespec wall{};
  ::clock_gettime(CLOCK_REALTIME, &wall);
  const std::int64_t now_ns = std::int64_t{wall.tv_sec} * 1'000'000'000 + wall.tv_nsec;
  return static_cast<std::uint64_t>(now_ns - (rt::now() - time).count());
}

}  // namespace rtpm::console
