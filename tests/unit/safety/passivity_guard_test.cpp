#include "rtpm/safety/passivity_guard.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <deque>

#include "rtpm/safety/filter.hpp"

namespace rtpm::gvd {
namespace {

using driver::Wrench;
using std::chrono::milliseconds;
using std::chrono::seconds;

/// A mass with slight damping on a simulated time line of 1 kHz. A hand presses it with a constant
/// force against a virtual wall at zero, which is rendered with a delay.
class Rig {
 public:
  static constexpr double kMassKg = 0.1;
  static constexpr double kDampingNewtonSPerM = 0.5;
  static constexpr double kPressNewton = 1;
  static constexpr double kPeriodS = 0.001;
  static constexpr int kStepCount = 20;

  Rig(SafetyConfig safety, double stiffness_newton_per_m, int delay_ms)
      : filter_(safety), stiffness_(stiffness_newton_per_m), delay_ms_(delay_ms) {}

  void run(int ms) {
    for (int i = 0; i < ms; ++i)
      cycle();
  }
  /// Runs for `ms`; returns the greatest speed.
  double greatest_speed(int ms) {
    double greatest = 0;
    for (int i = 0; i < ms; ++i) {
      cycle();
      greatest = std::max(greatest, std::abs(velocity_m_per_s_));
    }
    return greatest;
  }
  [[nodiscard]] double force_newton() const { return applied_newton_; }
  [[nodiscard]] const SafetyFilter& filter() const { return filter_; }

 private:
  void cycle() {
    now_ += milliseconds{1};
    seen_m_.push_back(position_m_);
    const double seen_m = seen_m_.front();
    if (seen_m_.size() > static_cast<std::size_t>(delay_ms_)) seen_m_.pop_front();
    const double wall_newton = seen_m < 0 ? -stiffness_ * seen_m : 0;
    const Motion motion{.position_m = {position_m_, 0, 0},
                        .twist = {{velocity_m_per_s_, 0, 0}, {}},
                        .wrench_applied = {{applied_newton_, 0, 0}, {}}};
    applied_newton_ =
        filter_
            .step(now_, WrenchCommand{{{wall_newton, 0, 0}, {}}, now_, now_ + milliseconds{10}},
                  motion)
            .force_newton.x;
    // Between two cycles the mechanics move on, but the force stays.
    for (int step = 0; step < kStepCount; ++step) {
      const double total_newton =
          applied_newton_ - kPressNewton - kDampingNewtonSPerM * velocity_m_per_s_;
      velocity_m_per_s_ += kPeriodS / kStepCount * total_newton / kMassKg;
      position_m_ += kPeriodS / kStepCount * velocity_m_per_s_;
    }
  }

  SafetyFilter filter_;
  double stiffness_;
  int delay_ms_;
  MonotonicTime now_{seconds{1000}};
  std::deque<double> seen_m_{};
  double position_m_ = 0.002;
  double velocity_m_per_s_ = 0;
  double applied_newton_ = 0;
};

SafetyConfig safety(bool has_guard) {
  driver::Descriptor device;
  device.limits.force_newton_max = 9;
  device.limits.damping_newton_s_per_m = Rig::kDampingNewtonSPerM;
  device.workspace = {{-0.1, -0.1, -0.1}, {0.1, 0.1, 0.1}};
  SafetyConfig config = SafetyConfig::for_device(device);
  config.has_passivity_guard = has_guard;
  return config;
}

/// The stiffest wall at which the mass comes to rest without the guard.
double stable_stiffness(int delay_ms) {
  double stable = 1;
  double unstable = 5000;
  while (unstable - stable > 1) {
    const double stiffness = (stable + unstable) / 2;
    Rig rig(safety(false), stiffness, delay_ms);
    rig.run(8000);
    (rig.greatest_speed(500) < 0.01 ? stable : unstable) = stiffness;
  }
  return stable;
}

class DelayedWall : public ::testing::TestWithParam<int> {};

TEST_P(DelayedWall, OscillatesAtTwiceTheStableStiffnessWithoutTheGuard) {
  Rig rig(safety(false), 2 * stable_stiffness(GetParam()), GetParam());
  rig.run(20'000);
  EXPECT_GT(rig.greatest_speed(1000), 0.19);
}

TEST_P(DelayedWall, StaysBoundedAtTwiceTheStableStiffnessWithTheGuard) {
  Rig rig(safety(true), 2 * stable_stiffness(GetParam()), GetParam());
  rig.run(20'000);
  EXPECT_LT(rig.greatest_speed(1000), 0.1);
  EXPECT_GT(rig.filter().counters().braked_count, 0u);
}

TEST_P(DelayedWall, IsUnchangedAtHalfTheStableStiffness) {
  Rig rig(safety(true), stable_stiffness(GetParam()) / 2, GetParam());
  rig.run(20'000);
  EXPECT_LT(rig.greatest_speed(1000), 1e-3);
  EXPECT_NEAR(rig.force_newton(), Rig::kPressNewton, 1e-3);
}

INSTANTIATE_TEST_SUITE_P(DelaysInMs, DelayedWall, ::testing::Values(0, 1, 2, 5, 10));

TEST(PassivityGuard, BrakesByJustWhatIsMissing) {
  SafetyConfig config;
  config.has_passivity_guard = true;
  config.passivity_reserve_joule = 0;
  config.passivity_watt = 0;
  config.passivity_newton_s_per_m_max = 100;
  PassivityGuard guard;
  // The reserve is empty, so the guard removes a force that would give energy.
  Wrench wrench{{2, 0, 0}, {}};
  EXPECT_TRUE(guard.apply(config, milliseconds{1}, {.twist = {{0.1, 0, 0}, {}}}, wrench));
  EXPECT_NEAR(wrench.force_newton.x, 0, 1e-12);
  // The device may return the energy that it absorbed.
  wrench = {};
  const Motion pressed{.twist = {{-0.1, 0, 0}, {}}, .wrench_applied = {{2, 0, 0}, {}}};
  EXPECT_FALSE(guard.apply(config, milliseconds{10}, pressed, wrench));
  EXPECT_NEAR(guard.energy_joule(), 0, 1e-12) << "the least of the axes";
  wrench = {{2, 0, 0}, {}};
  EXPECT_FALSE(guard.apply(config, milliseconds{1}, {.twist = {{0.1, 0, 0}, {}}}, wrench));
  EXPECT_EQ(wrench.force_newton.x, 2);
}

TEST(PassivityGuard, LetsASlowPullThroughByItsRefill) {
  SafetyConfig config;
  config.has_passivity_guard = true;
  config.passivity_newton_s_per_m_max = 100;
  config.passivity_watt = 0.02;
  PassivityGuard guard;
  for (int ms = 0; ms < 60'000; ++ms) {
    Wrench wrench{{0.5, 0, 0}, {}};
    const Motion pulled{.twist = {{0.03, 0, 0}, {}}, .wrench_applied = {{0.5, 0, 0}, {}}};
    ASSERT_FALSE(guard.apply(config, milliseconds{1}, pulled, wrench)) << "15 mW at " << ms;
  }
}

}  // namespace
}  // namespace rtpm::gvd
