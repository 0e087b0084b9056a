#include <gtest/gtest.h>
#include <signal.h>

#include <string>

#include "fixture.hpp"

// The tool and a page change the wall of a running rtpm-servo.
namespace rtpm::system_test {
namespace {

class ServedWalls : public ConsoleSystem {
 protected:
  void SetUp() override {
    ConsoleSystem::SetUp();
    ASSERT_TRUE(registry_);
    servo_.emplace(std::vector<std::string>{path_of("rtpm-servo"), "--registry", registry_->url,
                                            "--realtime", "off", "--live", "lines", "--seconds",
                                            "0", "--serve", "lab/servo"});
    ASSERT_TRUE(servo_->wait_for_output("\n", kPatience)) << servo_->errors();
  }
  std::optional<test::Process> servo_{};
};

TEST_F(ServedWalls, AreParametersOfTheToolAndOfThePage) {
  const std::string stiffness = "lab/servo.wall.stiffness_newton_per_m";
  const auto client = connect();
  ASSERT_TRUE(client->await_service("lab/servo/config/apply"));
  const auto set = rtpm({"config", "set", "lab/servo", "wall.stiffness_newton_per_m=300"});
  EXPECT_EQ(set.exit_code, 0) << set.errors;
  EXPECT_EQ(set.output, "wall.stiffness_newton_per_m=300\n");
  client->send({{"op", "getParameters"}, {"parameterNames", {stiffness}}, {"id", "a"}});
  EXPECT_EQ(client->await_parameters("a")[stiffness], 300.0);
  client->send({{"op", "setParameters"},
                {"parameters", Json::array({{{"name", stiffness}, {"value", 500}}})},
                {"id", "b"}});
  EXPECT_EQ(client->await_parameters("b")[stiffness], 500.0);
  const auto listed = rtpm({"config", "list", "lab/servo", "--json"});
  EXPECT_EQ(Json::parse(listed.output)["parameters"][0]["value"], 500.0);
  expect_one_sentence(rtpm({"config", "set", "lab/servo", "wall.stiffness_newton_per_m=950"}), 1,
                      {"lab/servo", "950", "buzz", "800"});

  client->subscribe("console/state");
  const Json state = client->await_state([](const Json& one) { return is_live(one, "lab/arm0"); });
  EXPECT_TRUE(device_in(state, "lab/servo").is_null());
  EXPECT_EQ(device_in(state, "lab/arm0")["lease"]["state"], "held");
}

TEST_F(ServedWalls, LeaveNoNameBehind) {
  servo_->send_signal(SIGTERM);
  const auto end = servo_->wait(kPatience);
  ASSERT_TRUE(end);
  EXPECT_EQ(end->exit_code, 0) << end->errors;
  expect_one_sentence(rtpm({"config", "list", "lab/servo"}), 3, {"lab/servo", "not bound"});
}

}  // namespace
}  // namespace rtpm::system_test
