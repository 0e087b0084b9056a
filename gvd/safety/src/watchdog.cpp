#include "rtpm/safety/watchdog.hpp"

#include <algorithm>

#include "vector.hpp"

namespace rtpm::gvd {
void Watchdog::follow(const SafetyConfig& config, MonotonicTime ends) noexcept {
  zero_at_ = deadline_after(config.rest(), ends);
}

double Watchdog::fall(const SafetyConfig& config, MonotonicTime now, MonotonicTime ends,
                      Duration elapsed, bool has_client, const Motion& motion,
                      driver::Wrench& output) noexcept {
  zero_at_ = std::min(zero_at_, deadline_after(has_client ? config.rest() : config.ramp, ends));
  if (now >= zero_at_) {
    output = {};
    return 0;
  }
  const Duration rest_now = zero_at_ - now;
  if (has_client && config.watchdog == WatchdogPolicy::kDamp) {
    output = {scaled(motion.twist.linear_m_per_s, -config.watchdog_newton_s_per_m), {}};
    return 1;
  }
  if (rest_now > config.ramp) return 1;
  // The ramp started at zero_at − ramp, perhaps between two steps. Each step scales the force by
  // the remaining share of the time, which is linear from any starting point.
  const Duration rest_before = std::min(rest_now + elapsed, config.ramp);
  const double share = std::clamp(seconds(rest_now) / seconds(rest_before), 0.0, 1.0);
  output = scaled(output, share);
  return share;
}

}  // namespace rtpm::gvd
