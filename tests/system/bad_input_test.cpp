#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "programs.hpp"

// Whatever is wrong around a program, it says so in one sentence with the remedy, and ends.
namespace rtpm::system_test {
namespace {

class EveryProgram : public testing::TestWithParam<const char*> {};

TEST_P(EveryProgram, RefusesAnUnknownFlag) {
  const auto end = run_program(GetParam(), {"--no-such-flag"});
  expect_one_sentence(end, 2, {GetParam(), "--no-such-flag", "--help"});
  EXPECT_EQ(end.output, "");
}

TEST_P(EveryProgram, RefusesAnUnknownKeyInItsFile) {
  const auto file = std::filesystem::path(testing::TempDir()) / (std::string(GetParam()) + ".conf");
  std::ofstream(file) << "no-such-key = 1\n";
  const auto end = run_program(GetParam(), {"--config", file.string()});
  expect_one_sentence(end, 2, {GetParam(), "no-such-key"});
  std::filesystem::remove(file);
}

TEST_P(EveryProgram, HelpsAndTellsItsVersion) {
  const auto help = run_program(GetParam(), {"--help"});
  EXPECT_EQ(help.exit_code, 0);
  EXPECT_NE(help.output.find("--config"), std::string::npos) << help.output;
  EXPECT_EQ(help.errors, "");
  const auto version = run_program(GetParam(), {"--version"});
  EXPECT_EQ(version.exit_code, 0);
  EXPECT_NE(version.output.find("0.1.0"), std::string::npos) << version.output;
}

INSTANTIATE_TEST_SUITE_P(Programs, EveryProgram,
                         testing::Values("rtpm-registryd", "rtpm-deviced", "rtpm-servo"),
                         [](const auto& parameter) {
                           const std::string name = parameter.param;
                           return name.substr(name.find('-') + 1);
                         });

TEST(BadSurroundings, ABusyPortIsNamed) {
  const auto registry = start_daemon("rtpm-registryd", {"--port", "0", "--realtime", "off"});
  ASSERT_TRUE(registry);
  const std::string port = std::to_string(registry->port());
  const auto end = run_program("rtpm-registryd", {"--port", port, "--realtime", "off"});
  expect_one_sentence(end, 1, {"rtpm-registryd", port, "in use"});
}

TEST(BadSurroundings, AMissingRegistryIsNamed) {
  // A port that was free a moment ago; nobody serves it.
  const std::string url = [] {
    const auto registry = start_daemon("rtpm-registryd", {"--port", "0", "--realtime", "off"});
    return registry ? registry->url : std::string();
  }();
  ASSERT_NE(url, "");
  const std::string address = url.substr(7, url.find('/', 7) - 7);
  const auto device =
      run_program("rtpm-deviced", {"--port", "0", "--registry", url, "--realtime", "off"});
  expect_one_sentence(device, 1, {"rtpm-deviced", address, "registry"});
  const auto servo = run_program("rtpm-servo", {"--registry", url, "--realtime", "off"});
  expect_one_sentence(servo, 1, {"rtpm-servo", address, "registry"});
}

TEST(BadSurroundings, AnUnknownNameIsNamed) {
  const auto registry = start_daemon("rtpm-registryd", {"--port", "0", "--realtime", "off"});
  ASSERT_TRUE(registry);
  const auto end = run_program(
      "rtpm-servo", {"--registry", registry->url, "--device", "lab/nobody", "--realtime", "off"});
  expect_one_sentence(end, 1, {"rtpm-servo", "lab/nobody"});
}

TEST(BadSurroundings, ABrokenRecordingIsNamedWithItsLine) {
  const auto file = std::filesystem::path(testing::TempDir()) / "rtpm_broken_hand.csv";
  std::ofstream(file) << "t_s,x_m,y_m,z_m\n0,0,0,0\n0.1,zero,0,0\n";
  const auto end = run_program("rtpm-deviced", {"--port", "0", "--registry", "none", "--realtime",
                                                "off", "--hand", file.string()});
  expect_one_sentence(end, 1, {"rtpm-deviced", "rtpm_broken_hand.csv:3"});
  std::filesystem::remove(file);
}

/// A command in front of a program that takes its right to SCHED_FIFO and to lock memory away.
std::vector<std::string> without_rights(const std::vector<std::string>& command) {
  std::vector<std::string> whole;
  if (geteuid() == 0) {
    whole = {"setpriv", "--bounding-set=-sys_nice,-ipc_lock,-sys_resource",
             "--inh-caps=-sys_nice,-ipc_lock,-sys_resource"};
  }
  whole.insert(whole.end(), {"prlimit", "--rtprio=0:0", "--memlock=65536:65536"});
  whole.insert(whole.end(), command.begin(), command.end());
  return whole;
}

class WithoutRealtimeRights : public testing::Test {
 protected:
  void SetUp() override {
    const auto tried = test::run(without_rights({"true"}), kPatience);
    if (!tried || tried->exit_code != 0) {
      GTEST_SKIP() << "the right to take rights away (CAP_SETPCAP) is missing";
    }
  }
};

TEST_F(WithoutRealtimeRights, PreferWarnsWithTheRemedyAndServes) {
  test::Process process(
      without_rights({path_of("rtpm-registryd"), "--port", "0", "--realtime", "prefer"}));
  ASSERT_TRUE(process.wait_for_output("rtpm://", kPatience)) << process.errors();
  process.send_signal(SIGTERM);
  const auto end = process.wait(kPatience);
  ASSERT_TRUE(end);
  EXPECT_EQ(end->exit_code, 0);
  // One warning for the scheduling, one for the memory, however many threads there are.
  EXPECT_EQ(test::line_count(end->errors), 2) << end->errors;
  for (const std::string_view word : {"SCHED_FIFO", "rtprio", "memory", "ulimit -l"}) {
    EXPECT_NE(end->errors.find(word), std::string::npos) << word << " is not in: " << end->errors;
  }
}

TEST_F(WithoutRealtimeRights, RequireRefusesWithTheRemedy) {
  const auto end =
      test::run(without_rights({path_of("rtpm-registryd"), "--port", "0", "--realtime", "require"}),
                kPatience);
  ASSERT_TRUE(end);
  expect_one_sentence(*end, 1, {"rtpm-registryd", "Remedy"});
  EXPECT_EQ(end->output, "") << "it must not say that it serves";
}

}  // namespace
}  // namespace rtpm::system_test
