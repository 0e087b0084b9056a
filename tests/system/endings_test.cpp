#include <gtest/gtest.h>
#include <signal.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <string>
#include <utility>
#include <vector>

#include "programs.hpp"
#include "rtpm/test/os.hpp"

// How programs end: in order on every signal that asks for it, and with an exit code that shows
// whether all output was written.
namespace rtpm::system_test {
namespace {

class EndSignal : public Laboratory, public testing::WithParamInterface<int> {
 protected:
  static void expect_orderly_end(test::Process& process, std::string_view name,
                                 std::string_view last_words = {}) {
    process.send_signal(GetParam());
    const auto end = process.wait(kPatience);
    ASSERT_TRUE(end) << name << " does not end";
    EXPECT_EQ(end->exit_code, 0) << name << ": " << end->errors;
    EXPECT_NE(end->output.find(last_words), std::string::npos) << name << ": " << end->output;
  }
  [[nodiscard]] test::Process start(std::vector<std::string> command) const {
    command.front() = path_of(command.front());
    command.insert(command.end(), {"--registry", registry_->url});
    return test::Process(command);
  }
};

TEST_P(EndSignal, EndsServersInOrder) {
  auto hub = start_server("rtpm-eventd");
  ASSERT_TRUE(hub);
  expect_orderly_end(hub->process, "rtpm-eventd");
  expect_orderly_end(device_->process, "rtpm-deviced");
  const auto names = rtpm({"list"});
  EXPECT_EQ(names.output.find("lab/arm0"), std::string::npos) << "its name is left";
  expect_orderly_end(registry_->process, "rtpm-registryd");
}

TEST_P(EndSignal, EndsClientsInOrder) {
  auto servo = start_servo(60);
  ASSERT_TRUE(servo);
  expect_orderly_end(*servo, "rtpm-servo", "p99.99");
  test::Process echo = start({"rtpm", "echo", "lab/arm0"});
  ASSERT_TRUE(echo.wait_for_output("\n", kPatience)) << echo.errors();
  expect_orderly_end(echo, "rtpm echo");
  test::Process ping = start({"rtpm", "ping", "lab/arm0"});
  ASSERT_TRUE(ping.wait_for_output("\n", kPatience)) << ping.errors();
  expect_orderly_end(ping, "rtpm ping", "0 lost");
}

TEST_P(EndSignal, EndsALaboratoryInOrder) {
  const auto file = std::filesystem::path(testing::TempDir()) / "endings.toml";
  std::ofstream(file) << "[laboratory]\nname = \"endings\"\n[[program]]\nname = \"devices\"\n"
                      << "run = [\"rtpm-deviced\", \"--port\", \"0\", \"--realtime\", \"off\", "
                         "\"--registry\", \""
                      << registry_->url << "\", \"--devices\", \"arm7\"]\n";
  test::Process up({path_of("rtpm"), "up", file.string()});
  ASSERT_TRUE(up.wait_for_output("endings is up", kPatience)) << up.output() << up.errors();
  expect_orderly_end(up, "rtpm up", "devices: ended");
  std::filesystem::remove(file);
}

INSTANTIATE_TEST_SUITE_P(Signals, EndSignal, testing::Values(SIGHUP, SIGINT, SIGTERM, SIGQUIT),
                         [](const auto& parameter) {
                           return "Signal" + std::to_string(parameter.param);
                         });

/// Runs `program` with its standard output redirected there.
test::Process::End run_into(const std::string& output, const std::string& program,
                            const std::vector<std::string>& arguments) {
  std::vector<std::string> command{"sh", "-c", "exec \"$0\" \"$@\" " + output, path_of(program)};
  command.insert(command.end(), arguments.begin(), arguments.end());
  const auto end = test::run(command, kPatience);
  EXPECT_TRUE(end) << program << " does not end";
  return end.value_or(test::Process::End{});
}

class LostOutput : public testing::TestWithParam<const char*> {};

TEST_P(LostOutput, FailsTheProgram) {
  const std::string program = GetParam();
  std::vector<std::string> options{"--help", "--version"};
  if (program != "rtpm" && program != "rtpmc") options.emplace_back("--dump-config");
  for (const std::string& option : options) {
    SCOPED_TRACE(option);
    expect_one_sentence(
        run_into(">/dev/full", program, {option}), 1,
        {program, "standard output can't be written: No space left on device. Remedy"});
    // The output must not go into the first file or socket that the program opens.
    expect_one_sentence(run_into(">&-", program, {option}), 1, {"Bad file descriptor"});
  }
}

INSTANTIATE_TEST_SUITE_P(Programs, LostOutput,
                         testing::Values("rtpm", "rtpmc", "rtpm-registryd", "rtpm-eventd",
                                         "rtpm-deviced", "rtpm-display", "rtpm-servo"),
                         [](const auto& parameter) {
                           std::string name = parameter.param;
                           name.erase(std::remove(name.begin(), name.end(), '-'), name.end());
                           return name;
                         });

class LostOutputInALaboratory : public Laboratory {};

TEST_F(LostOutputInALaboratory, EndsPrintingProgramsButNotServers) {
  const std::string reader = "--registry " + registry_->url + " | head -n 1";
  const auto echo =
      test::run({"sh", "-c", path_of("rtpm") + " echo lab/arm0 " + reader}, kPatience);
  ASSERT_TRUE(echo) << "it prints on, for nobody";
  EXPECT_EQ(test::line_count(echo->output), 1) << echo->output;
  EXPECT_EQ(echo->errors, "") << "head has what it wanted";

  test::Process device({"sh", "-c",
                        "exec " + path_of("rtpm-deviced") + " --devices arm1 --port 0 --registry " +
                            registry_->url + " --realtime off >/dev/full"});
  ASSERT_TRUE(test::await([&] { return rtpm({"call", "lab/arm1", "read"}).exit_code == 0; }));
  device.send_signal(SIGTERM);
  const auto end = device.wait(kPatience);
  ASSERT_TRUE(end);
  expect_one_sentence(*end, 1, {"rtpm-deviced", "standard output can't be written"});
}

}  // namespace
}  // namespace rtpm::system_test
