#include <gtest/gtest.h>
#include <signal.h>
#include <unistd.h>

#include <chrono>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iterator>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "programs.hpp"
#include "rtpm/test/os.hpp"

// Devices that rtpm-deviced hosts side by side, and drivers from plug-ins.
namespace rtpm::system_test {
namespace {

std::vector<std::string> alone(std::vector<std::string> arguments) {
  arguments.insert(arguments.end(), {"--port", "0", "--registry", "none", "--realtime", "off"});
  return arguments;
}

/// Checks that rtpm-deviced refuses `arguments`.
void expect_refusal(const std::vector<std::string>& arguments, int exit_code,
                    const std::vector<std::string_view>& words) {
  const auto end = run_program("rtpm-deviced", alone(arguments));
  SCOPED_TRACE(arguments.back());
  expect_one_sentence(end, exit_code, words);
  EXPECT_EQ(end.output, "") << "it must not say that it serves";
}

TEST(BadDevices, AreRefusedForAnInvalidName) {
  const std::string bytes_65(65, 'a');
  for (const std::string& names :
       {std::string("arm0,arm0"), std::string("arm-0,Arm_0"), std::string("cell/arm0"), bytes_65,
        std::string(), std::string(","), std::string("arm:0")}) {
    expect_refusal({"--devices", names}, 2,
                   {"rtpm-deviced: --devices '" + names + "'", "different names",
                    "letters, digits, '.', '_' and '-'", "64 bytes"});
  }
}

TEST(BadDevices, AreRefusedForOptionsOfAnUnknownDevice) {
  expect_refusal({"--devices", "arm0", "--device-arm1-rate", "500"}, 2,
                 {"--device-arm1-rate", "--device-arm0-rate"});
}

TEST(BadDevices, AreRefusedForAnImpossibleRate) {
  expect_refusal({"--device-arm0-rate", "5"}, 1, {"lab/arm0", "--device-arm0-rate is 5", "10 to"});
  expect_refusal({"--device-arm0-rate", "50001"}, 2, {"--device-arm0-rate", "50001"});
}

TEST(BadDevices, AreRefusedForAnUnknownDriverWithTheKnownOnes) {
  expect_refusal({"--devices", "lever", "--device-lever-driver", "gripper"}, 1,
                 {"lab/lever", "'gripper'", "arm, biometric, gaze, knob, player", "plug-in"});
}

TEST(Inventory, ListsDriversAndDevicesAndEnds) {
  const auto listed = run_program("rtpm-deviced", {"--list-drivers"});
  EXPECT_EQ(listed.exit_code, 0) << listed.errors;
  for (const std::string_view name : {"arm", "mpv", "evdev", "falcon", "hid", "serial"})
    EXPECT_NE(("\n" + listed.output).find("\n" + std::string(name) + " "), std::string::npos)
        << name;
  const auto probed = run_program("rtpm-deviced", {"--probe"});
  EXPECT_EQ(probed.exit_code, 0) << probed.errors;
  EXPECT_NE(probed.output, "") << "what is here, or that nothing is";
}

TEST(PluginCheck, PassesTheTemplate) {
  const auto end = run_program("rtpm-deviced", {"--check", RTPM_LEVER});
  EXPECT_EQ(end.exit_code, 0) << end.output << end.errors;
  EXPECT_NE(end.output.find("ok      DescribesItselfWhole\n"), std::string::npos) << end.output;
  EXPECT_TRUE(end.output.ends_with("0 of 15 promises are broken\n")) << end.output;
}

TEST(PluginCheck, NamesBrokenPromises) {
  const auto end = run_program("rtpm-deviced", {"--check", RTPM_STUBBORN});
  EXPECT_EQ(end.exit_code, 1) << end.output << end.errors;
  expect_text(end.output,
              {"broken  RefusesAPeriodOfNothingInWords\n        configure() takes a period of 0\n",
               "broken  IsGoneOutsideOfActiveAndLeavesTheSample\n", "promises are broken\n"});
  expect_refusal({"--check", "/nowhere/lever.so"}, 1, {"/nowhere/lever.so", "Remedy"});
}

std::vector<std::string> stubborn(const std::string& behaviour) {
  return {
      "--devices", "arm0,lever", "--device-lever-driver", RTPM_STUBBORN, "--device-lever-arguments",
      behaviour};
}

TEST(BadDevices, AreRefusedWithoutADriver) {
  expect_refusal({"--devices", "lever"}, 2,
                 {"the device lever has no driver", "--device-lever-driver", "arm, biometric"});
}

/// Checks that the device is not served, but the arm beside it is.
void expect_own_device_is_lost(const std::string& behaviour,
                               const std::vector<std::string>& words) {
  SCOPED_TRACE(behaviour);
  auto daemon = start_daemon("rtpm-deviced", alone(stubborn(behaviour)));
  ASSERT_TRUE(daemon);
  EXPECT_NE(daemon->url.find("lab/arm0"), std::string::npos) << daemon->url;
  const auto sample = run_program("rtpm", {"call", daemon->url, "read"});
  EXPECT_EQ(sample.exit_code, 0) << sample.errors;
  daemon->process.send_signal(SIGTERM);
  const auto end = daemon->process.wait(kPatience);
  ASSERT_TRUE(end);
  EXPECT_EQ(end->exit_code, 1) << "it served less than it was told";
  EXPECT_EQ(end->output.find("lab/lever"), std::string::npos) << end->output;
  for (const std::string& word : words)
    EXPECT_NE(end->errors.find(word), std::string::npos) << word << " is not in " << end->errors;
}

TEST(BadDevices, DoNotAffectTheOtherDevices) {
  expect_own_device_is_lost("error", {"lab/lever", "it will not", "ask it nicely"});
  expect_own_device_is_lost("timeless", {"lab/lever", "rate", "--device-lever-rate"});
  expect_own_device_is_lost("buttons", {"lab/lever", "more buttons", "second device"});
  expect_own_device_is_lost("describe", {"lab/lever", "describe()", "it threw: it is shy"});
}

/// The example of rtpm-deviced's README.
std::string readme_configuration() {
  std::ifstream file(RTPM_DEVICED_README);
  const std::string text{std::istreambuf_iterator<char>(file), {}};
  const std::string begin = "```toml\n";
  const std::size_t from = text.find(begin) + begin.size();
  return text.substr(from, text.find("```", from) - from);
}

TEST(ConfigurationFile, HostsTheDevicesOfTheReadme) {
  const auto folder = std::filesystem::path(testing::TempDir()) / "rtpm_cell";
  std::filesystem::create_directory(folder);
  std::string text = readme_configuration();
  const std::size_t file = text.find("./lever.so");
  ASSERT_NE(file, std::string::npos) << text;
  text.replace(file, std::string("./lever.so").size(), RTPM_STUBBORN);
  std::ofstream(folder / "cell.toml") << text;
  const auto config = (folder / "cell.toml").string();

  const auto dumped = run_program("rtpm-deviced", {"--config", config, "--dump-config"});
  EXPECT_EQ(dumped.exit_code, 0) << dumped.errors;
  expect_text(dumped.output,
              {"[device.arm0]\n", "\nrate = 2000\n", "\nramp = \"10ms\"\n", "[device.gaze0]\n",
               "\ndriver = \"gaze\"\n", "\narguments = \"/dev/ttyACM0\"\n"});
  auto daemon = start_daemon("rtpm-deviced", alone({"--config", config}));
  ASSERT_TRUE(daemon);
  for (const std::string_view name : {"cell/arm0", "cell/gaze0", "cell/lever"}) {
    EXPECT_TRUE(daemon->process.wait_for_output("serving " + std::string(name), kPatience)) << name;
  }
  const auto described = run_program("rtpm", {"call", daemon->url, "describe"});
  EXPECT_NE(described.output.find("\"rate_hz\": 2000.0"), std::string::npos) << described.output;
  std::filesystem::remove_all(folder);
}

TEST(ConfigurationFile, NamesAWrongLineOfADevice) {
  const auto file = std::filesystem::path(testing::TempDir()) / "rtpm_wrong_cell.toml";
  std::ofstream(file) << "[device.arm1]\nrate = 'fast'\n";
  expect_refusal({"--config", file.string()}, 2,
                 {"rtpm_wrong_cell.toml:2:8: device.arm1.rate 'fast' is not"});
  std::ofstream(file, std::ios::trunc) << "devices = ['arm0']\n[device.arm1]\nrate = 500\n";
  expect_refusal({"--config", file.string()}, 2,
                 {"rtpm_wrong_cell.toml:2:", "unknown key 'device.arm1'"});
  std::filesystem::remove(file);
}

/// A registry, and a server with the simulated arm and a stubborn lever.
class BlockedDriver : public WithRegistry {
 protected:
  void serve(const std::string& behaviour) {
    device_ = start_server("rtpm-deviced", stubborn(behaviour));
    ASSERT_TRUE(device_);
  }
  [[nodiscard]] std::string run_tool(std::vector<std::string> arguments) const {
    const auto end = rtpm(std::move(arguments));
    EXPECT_EQ(end.exit_code, 0) << end.errors;
    return end.output;
  }
  void expect_arm_serves() const {
    const auto end = run_program("rtpm-servo", {"--registry", registry_->url, "--live", "off",
                                                "--realtime", "off", "--seconds", "0.3"});
    EXPECT_EQ(end.exit_code, 0) << end.errors;
  }
  /// Checks that the server ends in bounded time on SIGTERM, and names the lever.
  void expect_bounded_end() {
    device_->process.send_signal(SIGTERM);
    const auto end = device_->process.wait(std::chrono::seconds{15});
    ASSERT_TRUE(end) << "it waits for the driver";
    EXPECT_EQ(end->exit_code, 3);
    expect_text(end->errors, {"rtpm-deviced: lab/lever can't be deactivated and may still apply a "
                              "force: the driver has not returned for 2 s. Remedy: "});
    EXPECT_EQ(end->errors.find("lab/arm0"), std::string::npos) << end->errors;
    EXPECT_EQ(run_tool({"list"}).find("lab/"), std::string::npos) << "its names are gone";
  }

  std::optional<Daemon> device_{};
};

TEST_F(BlockedDriver, IsShownInExchangeAndDoesNotBlockItsServer) {
  serve("exchange");
  EXPECT_TRUE(test::await([&] {
    return run_tool({"call", "lab/lever", "read"}).find("\"faults\": 1,") != std::string::npos;
  })) << "device late";
  expect_arm_serves();
  expect_bounded_end();
}

TEST_F(BlockedDriver, IsLoggedAndLowersItsSuccessRate) {
  const std::string hold = testing::TempDir() + "rtpm_hold_" + std::to_string(::getpid());
  serve("hold:" + hold);
  const auto await_lever = [&](const std::function<bool(double)>& is_so) {
    EXPECT_TRUE(test::await([&] {
      const std::string sample = run_tool({"call", "lab/lever", "read"});
      const std::string_view key = "\"success_rate\": ";
      const std::size_t at = sample.find(key);
      return at != std::string::npos && is_so(std::stod(sample.substr(at + key.size())));
    }));
  };
  await_lever([](double rate) { return rate > 0.9; });
  std::ofstream(hold).put(' ');
  EXPECT_TRUE(device_->process.wait_for_errors(
      "rtpm-deviced: lab/lever: its driver has not returned for ", kPatience));
  await_lever([](double rate) { return rate == 0; });
  std::filesystem::remove(hold);
  EXPECT_TRUE(device_->process.wait_for_errors(
      "rtpm-deviced: lab/lever: its driver has returned, after about ", kPatience));
  await_lever([](double rate) { return rate > 0.9; });
  EXPECT_EQ(device_->process.errors().find("lab/arm0: its driver"), std::string::npos);
  device_->process.send_signal(SIGTERM);
  const auto end = device_->process.wait(kPatience);
  ASSERT_TRUE(end);
  EXPECT_EQ(end->exit_code, 0) << end->errors;
}

TEST_F(BlockedDriver, BlocksNoOtherInItsFirstExchange) {
  serve("first");
  EXPECT_TRUE(device_->process.wait_for_errors("lab/lever: its driver has not", kPatience));
  EXPECT_NE(run_tool({"call", "lab/lever", "read"}).find("\"sequence\": 0,"), std::string::npos);
  expect_arm_serves();
  expect_bounded_end();
}

TEST_F(BlockedDriver, BlocksNoOtherInConfigure) {
  serve("configure");
  EXPECT_TRUE(device_->process.wait_for_errors("lab/lever: its driver has not", kPatience));
  expect_arm_serves();
  expect_bounded_end();
}

/// A server with the simulated arm and a lever whose driver crashes once a file exists.
class CrashingDriver : public testing::Test {
 protected:
  void SetUp() override {
    const std::string test = testing::UnitTest::GetInstance()->current_test_info()->name();
    trigger_ = testing::TempDir() + "rtpm_crash_" + test;
    std::filesystem::remove(trigger_);
  }
  void serve(const std::vector<std::string>& more, const std::string& behaviour = "crash:") {
    std::vector<std::string> arguments = alone(stubborn(behaviour + trigger_));
    arguments.insert(arguments.end(), more.begin(), more.end());
    device_ = start_daemon("rtpm-deviced", std::move(arguments));
    ASSERT_TRUE(device_);
    lever_ = device_->url;
    lever_.replace(lever_.rfind("arm0"), 4, "lever");
  }
  void crash() const { std::ofstream(trigger_).put(' '); }
  [[nodiscard]] static std::string read(const std::string& url) {
    const auto end = run_program("rtpm", {"call", url, "read"});
    EXPECT_EQ(end.exit_code, 0) << end.errors;
    return end.output;
  }

  std::string trigger_{};
  std::string lever_{};
  std::optional<Daemon> device_{};
};

TEST_F(CrashingDriver, IsNamedWithItsThreadAndDevice) {
  serve({});
  crash();
  const auto end = device_->process.wait(kPatience);
  ASSERT_TRUE(end);
  EXPECT_NE(end->exit_code, 0);
  expect_text(
      end->errors,
      {std::string("rtpm-deviced: signal 11 (segmentation fault) ends the process: thread "
                   "dev-lever, in exchange(), in the plug-in "),
       std::string(RTPM_STUBBORN) + " of lab/lever", std::string("--device-NAME-isolated")});
}

/// The isolated driver also deactivates its device when the server is killed.
TEST_F(CrashingDriver, DeactivatesItsDeviceWhenItsServerIsKilled) {
  serve({"--device-lever-isolated"}, "mark:");
  EXPECT_FALSE(std::filesystem::exists(trigger_));
  device_->process.send_signal(SIGKILL);
  EXPECT_TRUE(test::await([&] { return std::filesystem::exists(trigger_); }));
}

TEST_F(CrashingDriver, CostsItsOwnDeviceOnlyInAProcessOfItsOwn) {
  serve({"--device-lever-isolated"});
  EXPECT_NE(read(lever_).find("\"lifecycle\": 2}"), std::string::npos);
  crash();
  EXPECT_TRUE(device_->process.wait_for_errors("the device is active again", kPatience));
  const std::string& errors = device_->process.errors();
  expect_text(errors,
              {"thread drv-lever, in exchange(), in the plug-in ",
               "lab/lever: the driver failed in exchange(): its process ",
               "signal 11 (Segmentation fault)", "lab/lever: the device does not answer any more"});
  EXPECT_NE(read(lever_).find("\"lifecycle\": 2}"), std::string::npos);
  EXPECT_NE(read(device_->url).find("\"lifecycle\": 2}"), std::string::npos) << "the arm";
  device_->process.send_signal(SIGTERM);
  const auto end = device_->process.wait(kPatience);
  ASSERT_TRUE(end);
  EXPECT_EQ(end->exit_code, 0);
}

}  // namespace
}  // namespace rtpm::system_test
