#pragma once

#include "rtpm/base/time.hpp"
#include "rtpm/driver/geometry.hpp"
#include "rtpm/safety/config.hpp"
#include "rtpm/safety/motion.hpp"

namespace rtpm::gvd {

/// Takes the force away when commands stop, by SafetyConfig::watchdog. With the end of the last
/// command at t, the force is zero at and after zero_at(): t for kOff, t + ramp for kRamp,
/// t + watchdog_span for kDamp, t + watchdog_span + ramp for kHold.
/// @ownership a value
/// @realtime alloc-free
class Watchdog {
 public:
  /// Notes a live command that ends at `ends`.
  void follow(const SafetyConfig& config, MonotonicTime ends) noexcept;
  /// Turns `output` into the force that remains at `now`; live commands ended at `ends`. Without a
  /// client, whose lease has ended, the force lasts for the ramp at most, whatever the policy.
  /// @return the factor by which the ramp scaled the force, 0 to 1
  double fall(const SafetyConfig& config, MonotonicTime now, MonotonicTime ends, Duration elapsed,
              bool has_client, const Motion& motion, driver::Wrench& output) noexcept;
  /// Continues as if commands had ended long ago.
  void go_off(MonotonicTime now) noexcept { zero_at_ = now; }
  [[nodiscard]] MonotonicTime zero_at() const noexcept { return zero_at_; }

 private:
  MonotonicTime zero_at_{};
};

}  // namespace rtpm::gvd
