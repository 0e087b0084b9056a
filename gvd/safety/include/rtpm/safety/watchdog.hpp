#pragma once

#include "rtpm/base/time.hpp"
#include "rtpm/driver/geometry.hpp"
#include "rtpm/safety/config.hpp"
#include "rtpm/safety/motion.hpp"

namespace rtpm::gvd {

/// Removes the force when commands stop, by the policy SafetyConfig::watchdog. If the last command
/// ended at t, the force is zero from zero_at() on: t for kOff, t + ramp for kRamp, t +
/// watchdog_span for kDamp, t + watchdog_span + ramp for kHold.
/// @ownership a value
/// @realtime alloc-free
class Watchdog {
 public:
  /// Records a live command that ends at `ends`.
  void follow(const SafetyConfig& config, MonotonicTime ends) noexcept;
  /// Turns `output` into the force that remains at `now`; live commands ended at `ends`. Without a
  /// client, because its lease has ended, the force lasts at most for the ramp, whatever the
  /// policy.
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
