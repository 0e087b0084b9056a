#include <gtest/gtest.h>

#include <cstddef>
#include <map>
#include <string>
#include <vector>

#include "../../unit/exports/example_recording.hpp"
#include "rtpm/exports/export.hpp"
#include "rtpm/test/npm_peer.hpp"

/// An export for ROS 2, read by the parsers of Foxglove.
namespace rtpm::recording {
namespace {

using nlohmann::json;

TEST(Ros2Peer, ReadsTheExportsMessages) {
  if (!test::install_peer())
    GTEST_SKIP() << "npm is not installed, or can't install @foxglove/rosmsg";
  const Folder folder;
  const std::string file = folder.fresh("run");
  const std::string out = folder.fresh("ros2");
  exports::test::Example example(file);
  example.put_arm(5);
  example.put_trials({R"({"number":1,"response":"ja \u00fc"})"});
  example.end();
  auto reader = FileReader::open(file);
  ASSERT_TRUE(reader);
  ASSERT_TRUE(exports::export_ros2(**reader, out));

  const json read = test::run_peer("read_ros2.mjs '" + out + "'");
  EXPECT_EQ(read["profile"], "ros2");
  std::map<std::string, std::vector<json>> by_topic;
  for (const json& message : read["messages"])
    by_topic[message["topic"]].push_back(message["value"]);
  const std::string arm = "/rtpm/lab/arm_0/";
  for (int i = 0; i < 5; ++i) {
    const driver::Sample sample = exports::test::arm_sample(i);
    const auto at = static_cast<std::size_t>(i);
    const json pose = by_topic[arm + "pose"].at(at);
    EXPECT_EQ(pose["header"]["frame_id"], "arm/base");
    EXPECT_EQ(pose["header"]["stamp"]["sec"], 1'700'000'000);
    EXPECT_EQ(pose["pose"]["position"]["x"], sample.pose.position_m.x);
    EXPECT_EQ(pose["pose"]["position"]["y"], sample.pose.position_m.y);
    EXPECT_EQ(pose["pose"]["orientation"]["w"], 1);
    const json wrench = by_topic[arm + "applied_wrench"].at(at);
    EXPECT_EQ(wrench["wrench"]["force"]["x"], sample.wrench_applied.force_newton.x);
    EXPECT_EQ(by_topic[arm + "twist"].at(at)["twist"]["linear"]["x"], 0);
    EXPECT_EQ(by_topic[arm + "joint_states"].at(at)["name"], json({"elbow"}));
    EXPECT_EQ(by_topic[arm + "joint_states"].at(at)["position"], json({0.5}));
    EXPECT_EQ(by_topic[arm + "joy"].at(at)["buttons"], json({1}));
  }
  EXPECT_EQ(by_topic["/diagnostics"].at(0)["status"][0]["hardware_id"], "Arm 1");
  const std::string trial = by_topic["/rtpm/lab_Trial/_3"].at(0)["data"];
  EXPECT_EQ(json::parse(trial)["response"], "ja \u00fc");
}

}  // namespace
}  // namespace rtpm::recording
