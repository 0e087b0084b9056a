#include "rtpm/ros2/device_messages.hpp"

#include <gtest/gtest.h>

namespace rtpm::ros2 {
namespace {

driver::Descriptor pad() {
  return {.device_class = driver::DeviceClass::kHaptic,
          .model = "Pad",
          .serial = "7",
          .frame = "pad/base",
          .axes = {{.name = "x", .is_actuated = true}, {.name = "rz", .is_sensed = false}},
          .buttons = {"a", "b"},
          .analogs = {{.name = "stick", .unit = "1", .low = -2, .high = 2},
                      {.name = "trigger", .unit = "1"}},
          .joints = {{.name = "elbow", .unit = "rad"}}};
}

TEST(DeviceMessages, FollowTheDevicesParts) {
  const Subjects all = subjects_of(pad());
  EXPECT_TRUE(all.has_pose && all.has_wrench && all.has_joints && all.has_joy);
  EXPECT_FALSE(all.has_imu);
  const Subjects none = subjects_of({});
  EXPECT_FALSE(none.has_pose || none.has_wrench || none.has_joints || none.has_joy || none.has_imu);
}

TEST(DeviceMessages, SplitTimes) {
  EXPECT_EQ(time_of(1'500'000'000).sec, 1);
  EXPECT_EQ(time_of(1'500'000'000).nanosec, 500'000'000u);
  EXPECT_EQ(time_of(-1).sec, -1);
  EXPECT_EQ(time_of(-1).nanosec, 999'999'999u);
}

TEST(DeviceMessages, HaveTheSamplesValues) {
  driver::Sample sample;
  sample.pose = {{1, 2, 3}, {0, 0, 1, 0}};
  sample.twist = {{4, 5, 6}, {7, 8, 9}};
  sample.wrench_applied = {{10, 11, 12}, {13, 14, 15}};
  sample.joints[0] = 16;
  sample.joint_velocities[0] = 17;
  sample.efforts_applied[0] = 18;
  const PoseStamped pose = pose_of(pad(), sample, time_of(5));
  EXPECT_EQ(pose.header.frame_id, "pad/base");
  EXPECT_EQ(pose.header.stamp.nanosec, 5u);
  EXPECT_EQ(pose.pose.position.z, 3);
  EXPECT_EQ(pose.pose.orientation.z, 1);
  EXPECT_EQ(transform_of(pad(), sample, {}, "tip").child_frame_id, "tip");
  EXPECT_EQ(twist_of(pad(), sample, {}).twist.angular.x, 7);
  EXPECT_EQ(applied_wrench_of(pad(), sample, {}).wrench.torque.z, 15);
  const JointState joints = joint_state_of(pad(), sample, {});
  EXPECT_EQ(joints.name, std::vector<std::string>{"elbow"});
  EXPECT_EQ(joints.position, std::vector<double>{16});
  EXPECT_EQ(joints.velocity, std::vector<double>{17});
  EXPECT_EQ(joints.effort, std::vector<double>{18});
}

TEST(DeviceMessages, ScaleAnalogsByTheirRange) {
  driver::Sample sample;
  sample.analogs[0] = 1;
  sample.analogs[1] = 5;
  sample.buttons = 2;
  const Joy joy = joy_of(pad(), sample, {});
  EXPECT_EQ(joy.axes, (std::vector<float>{0.5f, 1}));
  EXPECT_EQ(joy.buttons, (std::vector<std::int32_t>{0, 1}));
}

TEST(DeviceMessages, MarkMissingPartsOfAnImu) {
  driver::Descriptor sensor;
  for (const char* name : {"x", "y", "z"})
    sensor.analogs.push_back({.name = name, .unit = "m/s^2", .low = -20, .high = 20});
  driver::Sample sample;
  sample.analogs[2] = 9.5f;
  ASSERT_TRUE(subjects_of(sensor).has_imu);
  const Imu imu = imu_of(sensor, sample, {});
  EXPECT_EQ(imu.linear_acceleration.z, 9.5);
  EXPECT_EQ(imu.linear_acceleration_covariance[0], 0);
  EXPECT_EQ(imu.angular_velocity_covariance[0], -1);
  EXPECT_EQ(imu.orientation_covariance[0], -1);
}

TEST(DeviceMessages, GradeTheStatus) {
  driver::Sample sample;
  sample.lifecycle = driver::Lifecycle::kActive;
  EXPECT_EQ(status_of("lab/pad", pad(), sample).level, DiagnosticStatus::kOk);
  sample.faults.set(driver::Fault::kForceClamped);
  EXPECT_EQ(status_of("lab/pad", pad(), sample).level, DiagnosticStatus::kWarn);
  sample.faults.set(driver::Fault::kEmergencyStop);
  const DiagnosticStatus stopped = status_of("lab/pad", pad(), sample);
  EXPECT_EQ(stopped.level, DiagnosticStatus::kError);
  EXPECT_EQ(stopped.hardware_id, "Pad 7");
  sample.faults = {};
  sample.lifecycle = driver::Lifecycle::kInactive;
  EXPECT_EQ(status_of("lab/pad", pad(), sample).level, DiagnosticStatus::kStale);
}

}  // namespace
}  // namespace rtpm::ros2
