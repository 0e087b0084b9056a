#include <gtest/gtest.h>

#include <limits>
#include <optional>

#include "cycle.hpp"
#include "rtpm/gvd/setpoint_limiter.hpp"
#include "scripted_driver.hpp"

/// Commands other than forces (motion, joints and outputs), and the emergency stop.
namespace rtpm::gvd {
namespace {

using driver::CommandMode;
using driver::Fault;
using driver::Setpoint;
using std::chrono::milliseconds;
using std::chrono::seconds;

driver::Descriptor all_modes() {
  driver::Descriptor descriptor = test::ScriptedDriver().describe();
  descriptor.joints = {{"elbow", "rad", -1, 2, 3, 0.5}, {"dial", "rad", 0, 0, 10, 0.1}};
  descriptor.outputs = {{"lamp", "1", 0, 1, 0.25}, {"valve", "Pa", -5, 5, 0}};
  descriptor.limits.velocity_m_per_s_max = 2;
  descriptor.limits.velocity_rad_per_s_max = 4;
  for (std::uint8_t mode = 1; mode < driver::kCommandModeCount; ++mode)
    descriptor.modes.push_back(static_cast<CommandMode>(mode));
  return descriptor;
}

Setpoint joints(CommandMode mode, double elbow, double dial) {
  Setpoint setpoint;
  setpoint.mode = mode;
  setpoint.joints = {elbow, dial};
  return setpoint;
}

TEST(SetpointLimiter, KeepsMotionWithinTheDescriptor) {
  const SetpointLimiter limiter(all_modes());
  Setpoint setpoint;
  setpoint.mode = CommandMode::kPose;
  setpoint.pose = {{5, -5, 1}, {0, 0, 3, 4}};
  setpoint.twist = {{3, 0, 4}, {0, -1, 0}};
  const Setpoint limited = limiter.limit(setpoint);
  EXPECT_EQ(limited.pose.position_m, (driver::Vector3{1, -2, 1})) << "the workspace";
  EXPECT_EQ(limited.pose.orientation, (driver::Quaternion{0, 0, 0.6, 0.8})) << "a unit quaternion";
  EXPECT_NEAR(limited.twist.linear_m_per_s.x, 1.2, 1e-12) << "2 m/s in the same direction";
  EXPECT_NEAR(limited.twist.linear_m_per_s.z, 1.6, 1e-12);
  EXPECT_EQ(limited.twist.angular_rad_per_s, (driver::Vector3{0, -1, 0})) << "below its limit";
}

TEST(SetpointLimiter, KeepsJointsAndOutputsInTheirRanges) {
  const SetpointLimiter limiter(all_modes());
  const auto at = [&](CommandMode mode, double elbow, double dial) {
    return limiter.limit(joints(mode, elbow, dial)).joints;
  };
  EXPECT_EQ(at(CommandMode::kJointPosition, 9, 1000)[0], 2);
  EXPECT_EQ(at(CommandMode::kJointPosition, 9, 1000)[1], 1000) << "a dial turns without end";
  EXPECT_EQ(at(CommandMode::kJointVelocity, -9, 9)[0], -3);
  EXPECT_EQ(at(CommandMode::kJointVelocity, -9, 9)[1], 9);
  EXPECT_EQ(at(CommandMode::kJointEffort, 9, -9)[1], -0.1);
  EXPECT_EQ(at(CommandMode::kForce, 1, 1)[0], 0) << "joints do not count in this mode";
  const Setpoint outputs = limiter.limit(Setpoint::with_outputs({7, -9, 3}));
  EXPECT_EQ(outputs.outputs[0], 1);
  EXPECT_EQ(outputs.outputs[1], -5);
  EXPECT_EQ(outputs.outputs[2], 0) << "no such output";
  EXPECT_EQ(limiter.safe_outputs()[0], 0.25F);
}

TEST(SetpointLimiter, TakesTheModesOfTheDescriptorAndOff) {
  const SetpointLimiter force_only(test::ScriptedDriver().describe());
  EXPECT_TRUE(force_only.takes(CommandMode::kOff));
  EXPECT_TRUE(force_only.takes(CommandMode::kForce));
  EXPECT_FALSE(force_only.takes(CommandMode::kOutputs));
  EXPECT_FALSE(force_only.takes(static_cast<CommandMode>(200)));
}

class Commanded : public ::testing::Test {
 protected:
  explicit Commanded(const driver::Descriptor& descriptor = all_modes()) {
    driver_.descriptor = descriptor;
    cycle_.emplace(driver_, CycleConfig{}, SipKey{1, 2});
    EXPECT_TRUE(cycle_->begin(now_));
    lease_ = cycle_->lease().acquire().value_or(Lease::kNobody);
  }
  expected<void, DeviceOutcome> command(const Setpoint& setpoint) {
    return cycle_->submit({lease_, ++sequence_, milliseconds{10}, setpoint}, now_);
  }
  void run(int count = 1) {
    for (int i = 0; i < count; ++i)
      cycle_->run(now_ += milliseconds{1}, 0);
  }
  /// Sends `setpoint` until the soft start is over.
  void reach(const Setpoint& setpoint) {
    for (int i = 0; i < 300; ++i) {
      ASSERT_TRUE(command(setpoint));
      run();
    }
  }
  const driver::Command& last() const { return driver_.last_command; }
  driver::Sample sample() const { return *cycle_->newest(); }

  test::ScriptedDriver driver_;
  std::optional<DeviceCycle> cycle_;
  MonotonicTime now_{seconds{1000}};
  std::uint64_t lease_ = Lease::kNobody;
  std::uint32_t sequence_ = 0;
};

TEST_F(Commanded, MotionGoesToTheDriverAndStopsWithTheCommands) {
  reach(joints(CommandMode::kJointVelocity, 1, 2));
  EXPECT_EQ(last().mode, CommandMode::kJointVelocity);
  EXPECT_EQ(last().joints[1], 2);
  run(11);
  EXPECT_EQ(last().mode, CommandMode::kOff) << "at the end of the hold";
  EXPECT_EQ(last().joints[1], 0);
  EXPECT_TRUE(sample().faults.has(Fault::kCommandLost));
}

TEST_F(Commanded, OutputsGoToTheirSafeValuesWithoutACommand) {
  run();
  EXPECT_EQ(last().outputs[0], 0.25F) << "before the first command";
  reach(Setpoint::with_outputs({1, 3}));
  EXPECT_EQ(last().mode, CommandMode::kOutputs);
  EXPECT_EQ(last().outputs[0], 1);
  EXPECT_EQ(last().outputs[1], 3);
  EXPECT_EQ(last().deadline, now_ + milliseconds{9}) << "the driver keeps them as long as the hold";
  run(11);
  EXPECT_EQ(last().outputs[0], 0.25F);
  EXPECT_EQ(last().outputs[1], 0);
}

TEST_F(Commanded, ForceAndOutputsDoNotAffectEachOther) {
  const auto force = Setpoint::with_wrench({{2, 0, 0}, {}});
  reach(force);
  ASSERT_TRUE(command(Setpoint::with_outputs({1, 3})));
  for (int i = 0; i < 100; ++i) {
    ASSERT_TRUE(command(force));
    run();
    ASSERT_EQ(last().outputs[0], 1) << i;
    ASSERT_NEAR(last().wrench.force_newton.x, 2, 1e-9) << i;
  }
  EXPECT_EQ(last().mode, CommandMode::kForce);
  ASSERT_TRUE(cycle_->submit(
      {lease_, ++sequence_, milliseconds{100}, Setpoint::with_outputs({1, 3})}, now_));
  run();
  EXPECT_LT(last().deadline, now_ + milliseconds{50}) << "the force's, which ends first";
  Setpoint both = force;
  both.outputs = {0.5F, 2};
  ASSERT_TRUE(command(both));
  run();
  EXPECT_EQ(last().outputs[0], 0.5F) << "one command may set both";
  ASSERT_TRUE(command(Setpoint::with_outputs({})));
  ASSERT_TRUE(command(force));
  run();
  EXPECT_EQ(last().outputs[0], 0) << "both commands of a cycle count";
  EXPECT_EQ(last().outputs[1], 0);
}

TEST_F(Commanded, OutputsDoNotKeepAForceAlive) {
  reach(Setpoint::with_wrench({{2, 0, 0}, {}}));
  for (int i = 0; i < 40; ++i) {
    ASSERT_TRUE(command(Setpoint::with_outputs({1, 3})));
    run();
  }
  EXPECT_EQ(last().wrench.force_newton.x, 0) << "its thread is gone";
  EXPECT_EQ(last().mode, CommandMode::kOutputs);
  EXPECT_EQ(last().outputs[0], 1);
  EXPECT_TRUE(sample().faults.has(Fault::kCommandLost));
  cycle_->emergency_stop();
  run();
  EXPECT_EQ(last().outputs[0], 0.25F) << "safe";
}

TEST_F(Commanded, EffortsRiseBySoftStartAndFallByTheRamp) {
  ASSERT_TRUE(command(joints(CommandMode::kJointEffort, 0.4, 0)));
  run(2);
  EXPECT_LT(last().joints[0], 0.1) << "soft start";
  reach(joints(CommandMode::kJointEffort, 0.4, 0));
  EXPECT_NEAR(last().joints[0], 0.4, 1e-9);
  run(15);
  EXPECT_EQ(last().mode, CommandMode::kJointEffort);
  EXPECT_GT(last().joints[0], 0);
  EXPECT_LT(last().joints[0], 0.4);
  run(15);
  EXPECT_EQ(last().mode, CommandMode::kOff) << "hold and ramp are over";
}

TEST_F(Commanded, ANumberThatIsNotFiniteInAnyFieldLatches) {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(command(joints(CommandMode::kJointPosition, kNan, 0)).error(),
            DeviceOutcome::kNotFinite);
  run();
  EXPECT_TRUE(sample().faults.has(Fault::kCommandNotFinite));
  ASSERT_TRUE(command(joints(CommandMode::kJointPosition, 1, 0)));
  run();
  EXPECT_EQ(last().mode, CommandMode::kOff) << "till recovery";
}

class ForceOnly : public Commanded {
 protected:
  ForceOnly() : Commanded(test::ScriptedDriver().describe()) {}
};

TEST_F(ForceOnly, AModeThatTheDeviceLacksIsRefused) {
  EXPECT_EQ(command(Setpoint::with_outputs({1})).error(), DeviceOutcome::kWrongMode);
  run();
  EXPECT_EQ(last().mode, CommandMode::kOff);
}

TEST_F(Commanded, AnEmergencyStopTakesTheForceAtOnceAndLatches) {
  reach(Setpoint::with_wrench({{4, 0, 0}, {}}));
  ASSERT_NEAR(last().wrench.force_newton.x, 4, 1e-9);
  cycle_->emergency_stop();
  run();
  EXPECT_EQ(last().mode, CommandMode::kOff) << "without a ramp";
  EXPECT_TRUE(sample().faults.has(Fault::kEmergencyStop));
  EXPECT_EQ(command(Setpoint::with_wrench({{4, 0, 0}, {}})).error(), DeviceOutcome::kEmergencyStop);
  run(3);
  EXPECT_TRUE(sample().faults.has(Fault::kEmergencyStop)) << "latched";
  EXPECT_FALSE(cycle_->request(lease_ ^ 1, Release::kRearm)) << "not the holder";
  ASSERT_TRUE(cycle_->request(lease_, Release::kRearm));
  run();
  EXPECT_FALSE(sample().faults.has(Fault::kEmergencyStop));
  ASSERT_TRUE(command(Setpoint::with_wrench({{4, 0, 0}, {}})));
  run(2);
  EXPECT_LT(last().wrench.force_newton.x, 1) << "soft start";
}

TEST_F(Commanded, ARearmAndARecoveryWithinACycleBothTakePlace) {
  cycle_->emergency_stop();
  run();
  ASSERT_TRUE(cycle_->request(lease_, Release::kRearm));
  ASSERT_TRUE(cycle_->request(lease_, Release::kRecover));
  run();
  EXPECT_FALSE(cycle_->is_stopped());
  Setpoint broken = Setpoint::with_wrench({{4, 0, 0}, {}});
  broken.wrench.force_newton.x = std::numeric_limits<double>::quiet_NaN();
  ASSERT_EQ(command(broken).error(), DeviceOutcome::kNotFinite);
  run();
  ASSERT_TRUE(sample().faults.has(Fault::kCommandNotFinite));
  ASSERT_TRUE(cycle_->request(lease_, Release::kRecover));
  ASSERT_TRUE(cycle_->request(lease_, Release::kRearm));
  run();
  EXPECT_FALSE(sample().faults.has(Fault::kCommandNotFinite));
}

TEST_F(Commanded, AStopBehindTheRequestToRearmStands) {
  cycle_->emergency_stop();
  run();
  ASSERT_TRUE(cycle_->request(lease_, Release::kRearm));
  cycle_->emergency_stop();
  run(2);
  EXPECT_TRUE(cycle_->is_stopped()) << "the operator who rearmed did not know of it";
  EXPECT_TRUE(sample().faults.has(Fault::kEmergencyStop));
  ASSERT_TRUE(cycle_->request(lease_, Release::kRearm));
  run();
  EXPECT_FALSE(cycle_->is_stopped());
}

}  // namespace
}  // namespace rtpm::gvd
