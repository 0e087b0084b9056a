#include "rtpm/rt/utc.hpp"

#include <time.h>

#include "rtpm/rt/clock.hpp"

namespace rtpm::rt {

std::uint64_t utc_ns(MonotonicTime time) noexcept {
  timespec wall{};
  ::clock_gettime(CLOCK_REALTIME, &wall);
  const std::int64_t now_ns = std::int64_t{wall.tv_sec} * 1'000'000'000 + wall.tv_nsec;
  return static_cast<std::uint64_t>(now_ns - (now() - time).count());
}

}  // namespace rtpm::rt
