#include "rtpm/safety/limits.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "rtpm/safety/filter.hpp"

/// Each mechanism alone, and the whole chain, with the device's motion.
namespace rtpm::gvd {
namespace {

using driver::Fault;
using driver::Wrench;
using std::chrono::milliseconds;
using std::chrono::seconds;

Wrench force(double x, double y = 0, double z = 0) {
  return {{x, y, z}, {}};
}

Motion moving(double x_m_per_s, double applied_newton = 0) {
  return {.twist = {{x_m_per_s, 0, 0}, {}}, .wrench_applied = force(applied_newton)};
}

SafetyConfig config() {
  SafetyConfig config;
  config.force_newton_max = 10;
  config.force_newton_per_s_max = 1e9;
  config.soft_start = Duration{0};
  return config;
}

TEST(PowerLimit, ShortensForcesOfTooMuchPower) {
  SafetyConfig limits = config();
  limits.power_watt_max = 2;
  Wrench wrench = force(8);
  EXPECT_FALSE(PowerLimit::apply(limits, moving(0.25), wrench)) << "2 W are allowed";
  EXPECT_TRUE(PowerLimit::apply(limits, moving(1), wrench));
  EXPECT_DOUBLE_EQ(wrench.force_newton.x, 2);
  wrench = force(-8);
  EXPECT_FALSE(PowerLimit::apply(limits, moving(1), wrench)) << "a brake takes power";
  limits.power_watt_max = 0;
  wrench = force(8);
  EXPECT_FALSE(PowerLimit::apply(limits, moving(100), wrench)) << "no limit";
}

TEST(PowerLimit, CountsTurning) {
  SafetyConfig limits = config();
  limits.power_watt_max = 1;
  Wrench wrench{{}, {0, 0.5, 0}};
  EXPECT_TRUE(PowerLimit::apply(limits, {.twist = {{}, {0, 4, 0}}}, wrench));
  EXPECT_DOUBLE_EQ(wrench.torque_newton_metre.y, 0.25);
}

TEST(VelocityTrip, LatchesUntilRecovery) {
  SafetyConfig limits = config();
  limits.velocity_m_per_s_max = 3;
  VelocityTrip trip;
  EXPECT_FALSE(trip.take(limits, moving(-3)));
  EXPECT_TRUE(trip.take(limits, moving(-3.1)));
  EXPECT_FALSE(trip.take(limits, moving(-3.1))) << "set once";
  EXPECT_TRUE(trip.is_set());
  trip.recover();
  EXPECT_FALSE(trip.is_set());
}

class Wall : public ::testing::Test {
 protected:
  Wall() {
    limits_.workspace = {{-0.1, -0.1, 0}, {0.1, 0.1, 0}};
    limits_.wall_newton_per_m = 100;
    limits_.wall_newton_s_per_m = 1;
  }
  Wrench at(double x_m, double velocity_m_per_s, const Wrench& wanted) {
    Wrench wrench = wanted;
    is_outside_ = SoftWall::apply(
        limits_, {.position_m = {x_m, 0, 0.5}, .twist = {{velocity_m_per_s, 0, 0}, {}}}, wrench);
    return wrench;
  }
  SafetyConfig limits_ = config();
  bool is_outside_ = false;
};

TEST_F(Wall, IsNotThereInside) {
  EXPECT_EQ(at(0.1, 1, force(5)), force(5));
  EXPECT_FALSE(is_outside_);
}

TEST_F(Wall, PushesBackAndRemovesOutwardForce) {
  EXPECT_NEAR(at(0.12, 0, force(5)).force_newton.x, -2, 1e-12);
  EXPECT_TRUE(is_outside_);
  EXPECT_NEAR(at(-0.12, 0, force(-5)).force_newton.x, 2, 1e-12);
  EXPECT_NEAR(at(0.12, 0, force(-1)).force_newton.x, -3, 1e-12) << "what pushes in stays";
  EXPECT_NEAR(at(0.12, 1, force(0)).force_newton.x, -3, 1e-12) << "it damps the way out";
  EXPECT_NEAR(at(0.12, -5, force(0)).force_newton.x, 0, 1e-12) << "and never pulls out";
  EXPECT_NEAR(at(1, 0, force(0)).force_newton.x, -5, 1e-12) << "at most half of the maximum";
}

TEST_F(Wall, IsNotThereOnAnAxisWithoutExtent) {
  EXPECT_EQ(at(0, 0, force(0, 0, 3)), force(0, 0, 3));
}

TEST(HeatLimit, FallsToTheContinuousForceAndCoolsDown) {
  SafetyConfig limits = config();
  limits.force_newton_continuous = 6;
  limits.heat_time = seconds{10};
  HeatLimit heat;
  const auto hold = [&](double wanted_newton, int ms) {
    double newton = 0;
    for (int i = 0; i < ms; ++i) {
      Wrench wrench = force(wanted_newton);
      static_cast<void>(heat.apply(limits, milliseconds{1}, moving(0, newton), wrench));
      newton = wrench.force_newton.x;
      EXPECT_GE(newton, std::min(wanted_newton, 6.0)) << "never below the continuous force";
    }
    return newton;
  };
  EXPECT_EQ(hold(6, 60'000), 6) << "the continuous force lasts for ever";
  EXPECT_EQ(heat.fill(), 0);
  EXPECT_EQ(hold(10, 4900), 10) << "half of the store is free";
  EXPECT_LT(hold(10, 5000), 10);
  EXPECT_NEAR(hold(10, 100'000), 6, 0.1);
  static_cast<void>(hold(0, 30'000));
  EXPECT_EQ(heat.fill(), 0);
  EXPECT_EQ(hold(10, 100), 10);
}

/// The filter with every mechanism enabled.
class Chain : public ::testing::Test {
 protected:
  static SafetyConfig defaults() {
    driver::Descriptor device;
    device.limits.force_newton_max = 10;
    device.limits.stiffness_newton_per_m_max = 400;
    device.limits.damping_newton_s_per_m = 1;
    device.workspace = {{-0.1, -0.1, -0.1}, {0.1, 0.1, 0.1}};
    return SafetyConfig::for_device(device);
  }
  Wrench run(double x_newton, const Motion& motion, int ms) {
    Wrench output;
    for (int i = 0; i < ms; ++i) {
      now_ += milliseconds{1};
      output =
          filter_.step(now_, WrenchCommand{force(x_newton), now_, now_ + milliseconds{10}}, motion);
    }
    return output;
  }
  MonotonicTime now_{seconds{1000}};
  SafetyFilter filter_{defaults()};
};

TEST_F(Chain, LeavesAModestCommandAlone) {
  EXPECT_EQ(run(2, moving(0.1, 0), 500), force(2));
  EXPECT_TRUE(filter_.faults().empty()) << to_text(filter_.faults());
}

TEST_F(Chain, TripsAndStaysOffUntilRecovery) {
  static_cast<void>(run(2, moving(0), 500));
  EXPECT_EQ(run(2, moving(6), 1), Wrench{});
  EXPECT_TRUE(filter_.faults().has(Fault::kTooFast));
  EXPECT_EQ(run(2, moving(0), 500), Wrench{});
  EXPECT_EQ(filter_.counters().tripped_count, 1u);
  filter_.recover();
  EXPECT_EQ(run(2, moving(0), 500), force(2));
}

TEST_F(Chain, ReportsTheActiveMechanism) {
  static_cast<void>(run(8, moving(0), 500));
  static_cast<void>(run(8, moving(2), 1));
  EXPECT_TRUE(filter_.faults().has(Fault::kPowerLimited));
  EXPECT_EQ(filter_.counters().power_limited_count, 1u);
  static_cast<void>(run(8, {.position_m = {0.2, 0, 0}}, 1));
  EXPECT_TRUE(filter_.faults().has(Fault::kSoftWall));
  static_cast<void>(run(8, moving(0, 10), 40'000));
  EXPECT_TRUE(filter_.faults().has(Fault::kHeatLimited));
}

TEST_F(Chain, KeepsTheLimitForAllMechanismsTogether) {
  // The command pushes in with its maximum, and the wall pushes, too.
  EXPECT_EQ(run(10, {.position_m = {-0.5, 0, 0}}, 500), force(10));
}

TEST_F(Chain, MovesToLowerLimitsAtThePermittedRate) {
  static_cast<void>(run(8, moving(0), 500));
  SafetyConfig lower = defaults();
  lower.force_newton_max = 2;
  filter_.configure(lower);
  EXPECT_NEAR(run(8, moving(0), 1).force_newton.x, 7, 1e-9) << "1000 N/s";
  EXPECT_EQ(run(8, moving(0), 10), force(2));
}

}  // namespace
}  // namespace rtpm::gvd
