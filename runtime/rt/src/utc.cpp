#include "rtpm/rt/utc.hpp"

#include <chrono>

#include "rtpm/rt/clock.hpp"

namespace rtpm::rt {

std::uint64_t utc_ns(MonotonicTime time) noexcept {
  const auto wall = std::chrono::system_clock::now().time_since_epoch();
  const auto wall_ns = std::chrono::duration_cast<std::chrono::nanoseconds>(wall).count();
  return static_cast<std::uint64_t>(wall_ns - (now() - time).count());
}

}  // namespace rtpm::rt
