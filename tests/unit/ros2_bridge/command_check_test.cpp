#include "command_check.hpp"

#include <gtest/gtest.h>

#include <limits>
#include <vector>

#include "rtpm/ros2/message.hpp"
#include "rtpm/ros2/messages.hpp"

// Which messages become commands.
namespace rtpm::ros2 {
namespace {

using driver::CommandMode;
using namespace std::chrono_literals;

constexpr std::int64_t kNow = 1'700'000'000'000'000'000;
constexpr CommandTime kTime{.now_ns = kNow, .age_max = 200ms};

driver::Descriptor device() {
  driver::Descriptor descriptor;
  descriptor.frame = "arm0/base";
  descriptor.joints = {{"shoulder", "rad"}, {"elbow", "rad"}};
  descriptor.modes = {CommandMode::kForce, CommandMode::kPose, CommandMode::kJointPosition};
  return descriptor;
}

Header header(Duration age = 0ns, std::string frame = {}) {
  const std::int64_t ns = kNow - age.count();
  return {.stamp = {static_cast<std::int32_t>(ns / 1'000'000'000),
                    static_cast<std::uint32_t>(ns % 1'000'000'000)},
          .frame_id = std::move(frame)};
}

template <class M>
expected<driver::Setpoint, CommandDrop> read(CommandKind kind, const M& message) {
  std::vector<std::byte> bytes;
  encode(message, bytes);
  return read_command(kind, bytes, device(), kTime);
}

template <class M>
void expect_drop(CommandKind kind, const M& message, CommandDrop why) {
  const auto setpoint = read(kind, message);
  ASSERT_FALSE(setpoint);
  EXPECT_EQ(to_string(setpoint.error()), to_string(why));
}

WrenchStamped wrench(Header head) {
  return {.header = std::move(head), .wrench = {.force = {1, 2, 3}, .torque = {4, 5, 6}}};
}

TEST(CommandCheck, TakesAWrenchInTheDevicesFrame) {
  for (const char* frame : {"", "arm0/base"}) {
    const auto setpoint = read(CommandKind::kWrench, wrench(header(0ns, frame)));
    ASSERT_TRUE(setpoint);
    EXPECT_EQ(setpoint->mode, CommandMode::kForce);
    EXPECT_EQ(setpoint->wrench, (driver::Wrench{{1, 2, 3}, {4, 5, 6}}));
  }
  expect_drop(CommandKind::kWrench, wrench(header(0ns, "map")), CommandDrop::kOtherFrame);
}

TEST(CommandCheck, DropsOldFutureAndMissingStamps) {
  EXPECT_TRUE(read(CommandKind::kWrench, wrench(header(200ms))));
  EXPECT_TRUE(read(CommandKind::kWrench, wrench(header(-200ms))));
  expect_drop(CommandKind::kWrench, wrench(header(201ms)), CommandDrop::kStale);
  expect_drop(CommandKind::kWrench, wrench(header(-201ms)), CommandDrop::kFuture);
  expect_drop(CommandKind::kWrench, wrench({}), CommandDrop::kStale);
}

TEST(CommandCheck, DropsWhatIsNotFinite) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double infinity = std::numeric_limits<double>::infinity();
  WrenchStamped message = wrench(header());
  message.wrench.torque.z = nan;
  expect_drop(CommandKind::kWrench, message, CommandDrop::kNotFinite);
  TwistStamped twist{.header = header()};
  twist.twist.linear.x = infinity;
  expect_drop(CommandKind::kTwist, twist, CommandDrop::kNotFinite);
  PoseStamped pose{.header = header()};
  pose.pose.orientation = {.x = 0, .y = 0, .z = 0, .w = 0};
  expect_drop(CommandKind::kPose, pose, CommandDrop::kNotFinite);
  pose.pose.orientation = {.x = nan, .y = 0, .z = 0, .w = 1};
  expect_drop(CommandKind::kPose, pose, CommandDrop::kNotFinite);
}

TEST(CommandCheck, MakesQuaternionsUnitLength) {
  PoseStamped pose{.header = header()};
  pose.pose.orientation = {.x = 0, .y = 0, .z = 0, .w = 1.0005};
  const auto setpoint = read(CommandKind::kPose, pose);
  ASSERT_TRUE(setpoint);
  EXPECT_EQ(setpoint->pose.orientation.w, 1);
}

TEST(CommandCheck, MatchesJointsByName) {
  JointState state{.header = header(), .name = {"elbow", "shoulder"}, .position = {0.5, 0.25}};
  const auto setpoint = read(CommandKind::kJoints, state);
  ASSERT_TRUE(setpoint);
  EXPECT_EQ(setpoint->mode, CommandMode::kJointPosition);
  EXPECT_EQ(setpoint->joints[0], 0.25);
  EXPECT_EQ(setpoint->joints[1], 0.5);
}

TEST(CommandCheck, DropsJointsThatDoNotFit) {
  const JointState good{.header = header(), .name = {"elbow", "shoulder"}, .position = {1, 2}};
  std::vector<JointState> odd(6, good);
  odd[0].name[0] = "wrist";
  odd[1].name.pop_back();
  odd[2].velocity = {1, 2};
  odd[3].position = {};
  odd[4].position = {};
  odd[4].effort = {1, 2};  // The device has no such mode.
  odd[5].name = {"elbow", "elbow"};
  for (const JointState& state : odd)
    expect_drop(CommandKind::kJoints, state, CommandDrop::kOddJoints);
}

TEST(CommandCheck, DropsOtherBytes) {
  const std::vector<std::byte> bytes(11, std::byte{0xff});
  const auto setpoint = read_command(CommandKind::kWrench, bytes, device(), kTime);
  ASSERT_FALSE(setpoint);
  EXPECT_EQ(setpoint.error(), CommandDrop::kUnreadable);
}

TEST(CommandCheck, HasTopicsForTheDevicesModes) {
  EXPECT_EQ(command_kinds_of(device()),
            (std::vector{CommandKind::kWrench, CommandKind::kPose, CommandKind::kJoints}));
  EXPECT_TRUE(command_kinds_of({}).empty());
}

}  // namespace
}  // namespace rtpm::ros2
