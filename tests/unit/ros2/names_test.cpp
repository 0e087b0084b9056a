#include "rtpm/ros2/names.hpp"

#include <gtest/gtest.h>

namespace rtpm::ros2 {
namespace {

TEST(RosNames, HaveLettersDigitsAndUnderscores) {
  EXPECT_EQ(ros_name("lab/arm0"), "lab/arm0");
  EXPECT_EQ(ros_name("lab.1/arm-0"), "lab_1/arm_0");
  EXPECT_EQ(ros_name("lab/3dof"), "lab/_3dof");
  EXPECT_EQ(ros_name("/lab//arm/"), "lab/arm");
  EXPECT_EQ(ros_name("lab/\xc3\xa9"), "lab/__");
  EXPECT_EQ(topic_name("lab/arm-0", "pose"), "/rtpm/lab/arm_0/pose");
}

TEST(RosNames, ReportCollisions) {
  GivenNames names;
  EXPECT_EQ(*names.give("lab/arm-0"), "lab/arm_0");
  EXPECT_EQ(*names.give("lab/arm-0"), "lab/arm_0");
  EXPECT_EQ(names.give("lab/arm.0").error().what,
            "'lab/arm-0' and 'lab/arm.0' have the same name in ROS 2, 'lab/arm_0'");
}

TEST(RosNames, RefuseWhatHasNone) {
  GivenNames names;
  EXPECT_FALSE(names.give("//"));
  EXPECT_FALSE(names.give(std::string(kTopicSizeMax, 'a')));
}

TEST(RosNames, HaveDdsTypes) {
  EXPECT_EQ(dds_type("geometry_msgs/msg/PoseStamped"), "geometry_msgs::msg::dds_::PoseStamped_");
}

}  // namespace
}  // namespace rtpm::ros2
