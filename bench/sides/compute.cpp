#include "rtpm/rt/clock.hpp"
#include "sides/caller.hpp"

namespace rtpm::bench {

void compute_for(Duration duration) noexcept {
  const MonotonicTime end = rt::now() + duration;
  while (rt::now() < end) {
  }
}

}  // namespace rtpm::bench
