#include <gtest/gtest.h>

#include <cstdlib>
#include <string>

#include "cyclone/domain.hpp"
#include "description_text.hpp"
#include "topic_events.hpp"

// Settings of the bridge by users and environment, and the text of a device.
namespace rtpm::ros2 {
namespace {

class DomainOfEnvironment : public testing::Test {
 protected:
  void SetUp() override { set("", ""); }
  void TearDown() override {
    ::unsetenv("ROS_DOMAIN_ID");
    ::unsetenv("ROS_AUTOMATIC_DISCOVERY_RANGE");
  }
  static void set(const char* id, const char* range) {
    ::setenv("ROS_DOMAIN_ID", id, 1);
    ::setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", range, 1);
  }
};

TEST_F(DomainOfEnvironment, IsTheOneOfRos) {
  EXPECT_EQ(domain_of_environment()->id, 0u);
  EXPECT_EQ(domain_of_environment()->range, DiscoveryRange::kSubnet);
  set("101", "LOCALHOST");
  EXPECT_EQ(domain_of_environment()->id, 101u);
  EXPECT_EQ(domain_of_environment()->range, DiscoveryRange::kLocalhost);
}

TEST_F(DomainOfEnvironment, IsRefusedWithATextIfItIsNone) {
  for (const char* id : {"102", "-1", "1 ", "x", "99999999999"}) {
    set(id, "");
    const auto domain = domain_of_environment();
    ASSERT_FALSE(domain) << id;
    EXPECT_NE(domain.error().text().find("from 0 to 101"), std::string::npos);
  }
  set("", "OFF");
  EXPECT_FALSE(domain_of_environment());
}

TEST(TopicOfAnEvent, HasANameAndAType) {
  const auto topic = parse_topic("/camera/trigger:std_msgs/msg/Header");
  ASSERT_TRUE(topic);
  EXPECT_EQ(topic->name, "/camera/trigger");
  EXPECT_EQ(topic->type, "std_msgs/msg/Header");
  EXPECT_EQ(parse_topic("/a:std_msgs/Bool")->type, "std_msgs/msg/Bool");
  for (const char* text : {"", "/a", "a:std_msgs/msg/Bool", "/a:Bool", "/a b:std_msgs/msg/Bool",
                           "/a:std_msgs/msg/Bool-x"})
    EXPECT_FALSE(parse_topic(text)) << text;
}

TEST(DescriptionText, IsYamlThatSurvivesAnyName) {
  driver::Descriptor descriptor;
  descriptor.model = "Arm \"7\"\n\\";
  descriptor.buttons = {"stylus"};
  descriptor.joints = {{"elbow", "rad", -1, 1.5}};
  const std::string text = description_text("lab/arm0", descriptor);
  EXPECT_NE(text.find("device: \"lab/arm0\"\n"), std::string::npos) << text;
  EXPECT_NE(text.find("model: \"Arm \\\"7\\\" \\\\\"\n"), std::string::npos) << text;
  EXPECT_NE(text.find("buttons:\n- \"stylus\"\n"), std::string::npos) << text;
  EXPECT_NE(text.find("- {name: \"elbow\", unit: \"rad\", low: -1, high: 1.5"), std::string::npos)
      << text;
}

}  // namespace
}  // namespace rtpm::ros2
