#include "rtpm/safety/watchdog.hpp"

#include <gtest/gtest.h>

#include "rtpm/safety/filter.hpp"

namespace rtpm::gvd {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

MonotonicTime at(int ms) {
  return MonotonicTime{seconds{1000}} + milliseconds{ms};
}

SafetyConfig config_of(WatchdogPolicy policy) {
  SafetyConfig config;
  config.force_newton_max = 9;
  config.force_newton_per_s_max = 1e9;
  config.soft_start = Duration{0};
  config.watchdog = policy;
  config.watchdog_span = milliseconds{50};
  config.watchdog_newton_s_per_m = 2;
  config.ramp = milliseconds{20};
  return config;
}

/// A filter that applied 6 N along x until 0 ms, when the command ended.
SafetyFilter lost(const SafetyConfig& config, WrenchCommand& last) {
  SafetyFilter filter{config};
  last = {{{6, 0, 0}, {}}, at(-10), at(0)};
  static_cast<void>(filter.step(at(-10), last));
  static_cast<void>(filter.step(at(-1), last));
  EXPECT_EQ(filter.step(at(-1), last).force_newton.x, 6);
  return filter;
}

/// The force along x at each millisecond from 0 on.
std::vector<double> after_the_loss(WatchdogPolicy policy, double velocity_m_per_s, int count) {
  WrenchCommand last;
  SafetyFilter filter = lost(config_of(policy), last);
  std::vector<double> forces;
  for (int ms = 0; ms < count; ++ms) {
    const Motion motion{.twist = {{velocity_m_per_s, 0, 0}, {}}};
    forces.push_back(filter.step(at(ms), last, motion).force_newton.x);
  }
  return forces;
}

TEST(WatchdogPolicy, RampsToZero) {
  const auto forces = after_the_loss(WatchdogPolicy::kRamp, 0, 30);
  EXPECT_NEAR(forces[10], 3, 1e-9);
  EXPECT_EQ(forces[20], 0);
}

TEST(WatchdogPolicy, HoldsThenRamps) {
  const auto forces = after_the_loss(WatchdogPolicy::kHold, 0, 80);
  EXPECT_EQ(forces[49], 6);
  EXPECT_NEAR(forces[60], 3, 1e-9);
  EXPECT_EQ(forces[70], 0);
}

TEST(WatchdogPolicy, BrakesTheMotionThenIsOff) {
  const auto forces = after_the_loss(WatchdogPolicy::kDamp, 0.5, 60);
  EXPECT_EQ(forces[0], -1);
  EXPECT_EQ(forces[49], -1);
  EXPECT_EQ(forces[50], 0);
  // The force is within the limit, at any speed.
  EXPECT_EQ(after_the_loss(WatchdogPolicy::kDamp, -100, 1)[0], 9);
}

TEST(WatchdogPolicy, IsOffAtOnce) {
  EXPECT_EQ(after_the_loss(WatchdogPolicy::kOff, 0, 1)[0], 0);
}

TEST(WatchdogPolicy, IsTheRampAtMostWhenALeaseEnds) {
  for (const WatchdogPolicy policy : {WatchdogPolicy::kHold, WatchdogPolicy::kDamp}) {
    WrenchCommand last;
    SafetyFilter filter = lost(config_of(policy), last);
    static_cast<void>(filter.step(at(10), std::nullopt));
    EXPECT_NEAR(filter.step(at(20), std::nullopt).force_newton.x, 3, 1e-9) << to_string(policy);
    EXPECT_EQ(filter.step(at(30), std::nullopt), driver::Wrench{}) << to_string(policy);
  }
}

TEST(WatchdogPolicy, KeepsItsBound) {
  for (const WatchdogPolicy policy : {WatchdogPolicy::kRamp, WatchdogPolicy::kHold,
                                      WatchdogPolicy::kDamp, WatchdogPolicy::kOff}) {
    const SafetyConfig config = config_of(policy);
    WrenchCommand last;
    SafetyFilter filter = lost(config, last);
    const MonotonicTime bound = at(0) + config.rest();
    const Motion motion{.twist = {{1, 0, 0}, {}}};
    for (int ms = 0; ms < 200; ++ms) {
      const driver::Wrench output = filter.step(at(ms), last, motion);
      if (at(ms) >= bound) {
        EXPECT_EQ(output, driver::Wrench{}) << to_string(policy);
      }
    }
    EXPECT_EQ(filter.zero_at(), bound) << to_string(policy);
  }
}

}  // namespace
}  // namespace rtpm::gvd
