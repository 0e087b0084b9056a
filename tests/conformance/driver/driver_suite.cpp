#include "driver_suite.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <set>

#include "cycle.hpp"
#include "drivers.hpp"
#include "rtpm/rt/memory.hpp"
#include "rtpm/test/alloc_guard.hpp"

/// What rtpm/driver/driver.hpp promises of every driver, on a simulated time line.
namespace rtpm::test {
namespace {

using driver::Command;
using driver::CommandMode;
using driver::ExchangeStatus;
using driver::Sample;
using driver::Vector3;
using std::chrono::milliseconds;

constexpr Duration kPeriod = milliseconds{1};

double length(const Vector3& v) {
  return std::hypot(v.x, v.y, v.z);
}
bool is_finite(const Vector3& v) {
  return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}

class DriverConformance : public ::testing::TestWithParam<DriverUnderTest> {
 protected:
  void SetUp() override { driver_ = GetParam().make(); }

  void start() {
    const auto configured = driver_->configure({.period = kPeriod});
    ASSERT_TRUE(configured) << configured.error().text();
    const auto activated = driver_->activate();
    ASSERT_TRUE(activated) << activated.error().text();
  }
  ExchangeStatus exchange(CommandMode mode, const driver::Wrench& wrench) {
    now_ += kPeriod;
    Command command;
    command.mode = mode;
    command.sequence = ++sequence_;
    command.cycle_time = now_;
    command.deadline = now_ + 30 * kPeriod;
    command.wrench = wrench;
    sample_.faults = {};
    return driver_->exchange(command, sample_);
  }

  std::unique_ptr<driver::Driver> driver_;
  Sample sample_{};
  MonotonicTime now_{std::chrono::seconds{1000}};
  std::uint64_t sequence_ = 0;
};

TEST_P(DriverConformance, DescribesItselfWhole) {
  const driver::Descriptor descriptor = driver_->describe();
  EXPECT_FALSE(descriptor.model.empty());
  EXPECT_FALSE(descriptor.serial.empty());
  EXPECT_FALSE(descriptor.frame.empty());
  EXPECT_GT(descriptor.rate_hz, 0);
  EXPECT_LE(descriptor.buttons.size(), driver::kButtonCountMax);
  EXPECT_LE(descriptor.analogs.size(), driver::kAnalogCountMax);
  EXPECT_GE(descriptor.position_resolution_m, 0);
  EXPECT_LE(descriptor.workspace.low_m.x, descriptor.workspace.high_m.x);
  EXPECT_LE(descriptor.workspace.low_m.y, descriptor.workspace.high_m.y);
  EXPECT_LE(descriptor.workspace.low_m.z, descriptor.workspace.high_m.z);
  const driver::Limits& limits = descriptor.limits;
  for (const double limit : {limits.force_newton_max, limits.torque_newton_metre_max,
                             limits.stiffness_newton_per_m_max, limits.damping_newton_s_per_m}) {
    EXPECT_TRUE(std::isfinite(limit) && limit >= 0);
  }
  const std::set<std::string> axis_names{"x", "y", "z", "rx", "ry", "rz"};
  std::set<std::string> seen;
  bool is_actuated = false;
  for (const driver::Axis& axis : descriptor.axes) {
    EXPECT_TRUE(axis_names.contains(axis.name)) << axis.name;
    EXPECT_TRUE(seen.insert(axis.name).second) << axis.name << " twice";
    is_actuated = is_actuated || axis.is_actuated;
  }
  EXPECT_EQ(is_actuated, limits.force_newton_max > 0 || limits.torque_newton_metre_max > 0);
  const auto takes = [&](CommandMode mode) { return std::ranges::count(descriptor.modes, mode); };
  EXPECT_EQ(takes(CommandMode::kForce), is_actuated ? 1 : 0);
  EXPECT_LE(descriptor.joints.size(), driver::kJointCountMax);
  EXPECT_LE(descriptor.outputs.size(), driver::kOutputCountMax);
  for (const driver::Joint& joint : descriptor.joints) {
    EXPECT_FALSE(joint.name.empty());
    EXPECT_TRUE(joint.unit == "rad" || joint.unit == "m") << joint.unit;
    EXPECT_LE(joint.low, joint.high);
  }
  for (const driver::Output& output : descriptor.outputs) {
    EXPECT_FALSE(output.name.empty() || output.unit.empty());
    EXPECT_TRUE(output.low <= output.safe && output.safe <= output.high) << output.name;
  }
}

/// Joints and outputs, with which numbers ever.
TEST_P(DriverConformance, KeepsJointsAndOutputsWithinItsDescriptor) {
  start();
  const driver::Descriptor descriptor = driver_->describe();
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  for (const CommandMode mode : {CommandMode::kJointPosition, CommandMode::kJointVelocity,
                                 CommandMode::kJointEffort, CommandMode::kOutputs}) {
    for (const double value : {0.0, 0.01, -1e9, 1e308, kNan}) {
      Command command;
      command.mode = mode;
      command.cycle_time = now_ += kPeriod;
      command.joints.fill(value);
      command.outputs.fill(static_cast<float>(value));
      sample_.faults = {};
      ASSERT_EQ(driver_->exchange(command, sample_), ExchangeStatus::kOk);
      for (std::size_t i = 0; i < descriptor.joints.size(); ++i) {
        EXPECT_TRUE(std::isfinite(sample_.joints[i]) && std::isfinite(sample_.joint_velocities[i]));
        EXPECT_LE(std::abs(sample_.efforts_applied[i]), descriptor.joints[i].effort_max);
      }
      for (std::size_t i = 0; i < descriptor.outputs.size(); ++i) {
        EXPECT_GE(sample_.outputs_applied[i], descriptor.outputs[i].low);
        EXPECT_LE(sample_.outputs_applied[i], descriptor.outputs[i].high);
      }
      for (std::size_t i = 0; i < descriptor.analogs.size(); ++i) {
        EXPECT_GE(sample_.analogs[i], descriptor.analogs[i].low);
        EXPECT_LE(sample_.analogs[i], descriptor.analogs[i].high);
      }
    }
  }
}

TEST_P(DriverConformance, DescribesItselfTheSameInEveryState) {
  const driver::Descriptor before = driver_->describe();
  start();
  const driver::Descriptor during = driver_->describe();
  EXPECT_EQ(before.serial, during.serial);
  EXPECT_EQ(before.frame, during.frame);
  EXPECT_EQ(before.limits.force_newton_max, during.limits.force_newton_max);
  EXPECT_EQ(before.buttons, during.buttons);
}

TEST_P(DriverConformance, RefusesAPeriodOfNothingInWords) {
  const auto configured = driver_->configure({.period = Duration{0}});
  ASSERT_FALSE(configured);
  EXPECT_GT(configured.error().text().size(), 20u);
}

TEST_P(DriverConformance, GivesFiniteSamplesWithTimesThatGrow) {
  start();
  const driver::Descriptor descriptor = driver_->describe();
  MonotonicTime last_host_time{};
  Duration last_device_time{-1};
  std::array<std::uint16_t, driver::kButtonCountMax> edges{};
  std::uint32_t buttons = 0;
  for (int i = 0; i < 3000; ++i) {
    ASSERT_EQ(exchange(CommandMode::kOff, {}), ExchangeStatus::kOk);
    ASSERT_TRUE(is_finite(sample_.pose.position_m) && is_finite(sample_.twist.linear_m_per_s) &&
                is_finite(sample_.twist.angular_rad_per_s));
    const driver::Quaternion& turn = sample_.pose.orientation;
    ASSERT_NEAR(std::hypot(std::hypot(turn.x, turn.y), std::hypot(turn.z, turn.w)), 1, 1e-6);
    ASSERT_GE(sample_.host_time, last_host_time);
    ASSERT_LE(sample_.host_time, now_ + kPeriod);
    ASSERT_GE(sample_.device_time, std::min(last_device_time, sample_.device_time));
    ASSERT_EQ(sample_.buttons >> descriptor.buttons.size(), 0u) << "a button it does not have";
    for (std::size_t b = 0; b < driver::kButtonCountMax; ++b) {
      const bool changed = ((sample_.buttons ^ buttons) >> b & 1) != 0;
      const auto step = static_cast<std::uint16_t>(sample_.button_edges[b] - edges[b]);
      ASSERT_EQ(step % 2, changed ? 1 : 0) << "button " << b << ": edges do not fit its state";
    }
    last_host_time = sample_.host_time;
    last_device_time = sample_.device_time;
    edges = sample_.button_edges;
    buttons = sample_.buttons;
  }
}

TEST_P(DriverConformance, StaysInItsWorkspaceUnderFullForce) {
  start();
  const driver::Descriptor descriptor = driver_->describe();
  const double margin_m = descriptor.position_resolution_m;
  for (const double sign : {1.0, -1.0}) {
    for (int i = 0; i < 1000; ++i) {
      const double newton = sign * descriptor.limits.force_newton_max / 2;
      ASSERT_EQ(exchange(CommandMode::kForce, {{newton, newton, newton}, {}}), ExchangeStatus::kOk);
      const Vector3& at_m = sample_.pose.position_m;
      ASSERT_GE(at_m.x, descriptor.workspace.low_m.x - margin_m);
      ASSERT_LE(at_m.x, descriptor.workspace.high_m.x + margin_m);
      ASSERT_GE(at_m.y, descriptor.workspace.low_m.y - margin_m);
      ASSERT_LE(at_m.y, descriptor.workspace.high_m.y + margin_m);
      ASSERT_GE(at_m.z, descriptor.workspace.low_m.z - margin_m);
      ASSERT_LE(at_m.z, descriptor.workspace.high_m.z + margin_m);
    }
  }
}

TEST_P(DriverConformance, NeverAppliesMoreThanItsLimitsWhateverItIsTold) {
  start();
  const driver::Limits limits = driver_->describe().limits;
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  const std::array<double, 9> values{0, 1, -3, 50, -1e9, 1e308, kNan, kInfinity, -kInfinity};
  for (const double x : values) {
    for (const double y : values) {
      for (const double z : values) {
        static_cast<void>(exchange(CommandMode::kForce, {{x, y, z}, {z, x, y}}));
        ASSERT_TRUE(is_finite(sample_.wrench_applied.force_newton)) << x << ' ' << y << ' ' << z;
        ASSERT_LE(length(sample_.wrench_applied.force_newton),
                  limits.force_newton_max * (1 + 1e-9));
        ASSERT_LE(length(sample_.wrench_applied.torque_newton_metre),
                  limits.torque_newton_metre_max * (1 + 1e-9));
        ASSERT_TRUE(is_finite(sample_.pose.position_m));
      }
    }
  }
}

TEST_P(DriverConformance, AppliesNothingInModeOffAndInModesItDoesNotKnow) {
  start();
  const double newton = driver_->describe().limits.force_newton_max / 2;
  for (const CommandMode mode : {CommandMode::kOff, static_cast<CommandMode>(200)}) {
    ASSERT_EQ(exchange(CommandMode::kForce, {{newton, 0, 0}, {}}), ExchangeStatus::kOk);
    EXPECT_NEAR(sample_.wrench_applied.force_newton.x, newton, 1e-3 * newton + 1e-12);
    ASSERT_EQ(exchange(mode, {{newton, 0, 0}, {}}), ExchangeStatus::kOk);
    EXPECT_EQ(sample_.wrench_applied, driver::Wrench{});
  }
}

TEST_P(DriverConformance, IsGoneOutsideOfActiveAndLeavesTheSample) {
  sample_.pose.position_m.x = 0.0125;
  EXPECT_EQ(exchange(CommandMode::kOff, {}), ExchangeStatus::kGone);
  EXPECT_EQ(sample_.pose.position_m.x, 0.0125);
  start();
  EXPECT_EQ(exchange(CommandMode::kOff, {}), ExchangeStatus::kOk);
  driver_->deactivate();
  EXPECT_EQ(exchange(CommandMode::kOff, {}), ExchangeStatus::kGone);
}

TEST_P(DriverConformance, StartsAgainAfterItsEnd) {
  for (int round = 0; round < 3; ++round) {
    start();
    for (int i = 0; i < 20; ++i) {
      ASSERT_EQ(exchange(CommandMode::kOff, {}), ExchangeStatus::kOk);
    }
    driver_->deactivate();
    driver_->deactivate();
  }
  start();
  driver_.reset();
  SUCCEED() << "and may be destroyed while active";
}

TEST_P(DriverConformance, SurvivesPausesAndRepeatedTimes) {
  start();
  for (const Duration pause :
       {Duration{0}, Duration{1}, Duration{milliseconds{50}}, Duration{std::chrono::hours{1}}}) {
    now_ += pause - kPeriod;
    static_cast<void>(exchange(CommandMode::kForce, {{1, 0, 0}, {}}));
    ASSERT_TRUE(is_finite(sample_.pose.position_m));
    ASSERT_TRUE(is_finite(sample_.twist.linear_m_per_s));
  }
}

TEST_P(DriverConformance, ExchangesWithoutAllocating) {
  if (!is_alloc_guard_active()) GTEST_SKIP() << kAllocGuardInactive;
  start();
  const CountBreachesOnly counting;
  const std::uint64_t before = allocation_breach_count();
  {
    const rt::NoAllocationScope no_allocation;
    for (int i = 0; i < 1000; ++i) {
      static_cast<void>(exchange(CommandMode::kForce, {{1, 1, 1}, {}}));
    }
  }
  EXPECT_EQ(allocation_breach_count(), before);
}

double product(const Vector3& a, const Vector3& b) {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}

/// What a client that holds `lease` commands in every cycle, and what the device applied then.
Vector3 push(gvd::DeviceCycle& cycle, std::uint64_t lease, std::uint32_t sequence, double newton,
             MonotonicTime now) {
  const Vector3 force{newton, newton, newton};
  static_cast<void>(cycle.submit(
      {lease, sequence, milliseconds{10}, driver::Setpoint::with_wrench({force, {}})}, now));
  cycle.run(now, 0);
  return cycle.newest()->wrench_applied.force_newton;
}

TEST_P(DriverConformance, PassesThroughNoForceWhenAnOperatorTakesItOver) {
  const double newton = driver_->describe().limits.force_newton_max / 4;
  // Neither the wall nor the guard, whose forces are nobody's, for a device that flies away.
  gvd::CycleConfig config;
  config.safety = gvd::SafetyConfig::for_device(driver_->describe());
  config.safety->wall_newton_per_m = 0;
  config.safety->has_passivity_guard = false;
  gvd::DeviceCycle cycle(*driver_, config, SipKey{1, 2});
  ASSERT_TRUE(cycle.begin(now_));
  const auto client = cycle.lease().acquire();
  ASSERT_TRUE(client);
  Vector3 before{};
  for (std::uint32_t i = 1; i <= 300; ++i)
    before = push(cycle, *client, i, newton, now_ += kPeriod);
  if (length(before) == 0) GTEST_SKIP() << "a device without force";

  const auto taken = cycle.take_over(cycle.config().operator_priority);
  ASSERT_TRUE(taken);
  const int ramp_cycle_count = static_cast<int>(cycle.safety().ramp / kPeriod) + 1;
  int zero_at = 0;
  for (int i = 1; i <= 300; ++i) {
    EXPECT_FALSE(cycle.submit(
        {*client, 1000, milliseconds{10}, driver::Setpoint::with_wrench({before, {}})}, now_));
    const Vector3 force =
        push(cycle, *taken, static_cast<std::uint32_t>(i), -newton, now_ += kPeriod);
    if (zero_at == 0 && length(force) == 0) zero_at = i;
    if (zero_at == 0) {
      EXPECT_GT(product(force, before), 0) << "of the former holder alone, in cycle " << i;
    } else {
      EXPECT_LE(product(force, before), 0) << "of the operator alone, in cycle " << i;
    }
  }
  EXPECT_GT(zero_at, 0);
  EXPECT_LE(zero_at, ramp_cycle_count);
  cycle.end(now_);
}

INSTANTIATE_TEST_SUITE_P(Drivers, DriverConformance, ::testing::ValuesIn(drivers_under_test()),
                         [](const auto& test) { return test.param.name; });

}  // namespace
}  // namespace rtpm::test
