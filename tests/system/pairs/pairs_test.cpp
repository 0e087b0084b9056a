#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <optional>
#include <ostream>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "programs.hpp"
#include "rtpm/test/temporary_folder.hpp"

/// The tool of one system with registry, device and hub of another, over UDP and TCP.
namespace rtpm::system_test {
namespace {

constexpr const char* kDevice = "lab/arm0";

struct System {
  const char* name;
  /// In RTPM's folder `build`; empty: this build.
  const char* folder;
  const char* ending;
  bool takes_wine;
};
void PrintTo(const System& system, std::ostream* out) {
  *out << system.name;
}
constexpr System kLinux{"Linux", "", "", false};
constexpr System kPortable{"Portable", "portable", "", false};
constexpr System kWindows{"Windows", "windows", ".exe", true};

std::string file_of(const System& system, const std::string& program) {
  if (*system.folder == '\0') return path_of(program);
  return std::string(RTPM_SOURCE) + "/build/" + system.folder + "/bin/" + program + system.ending;
}
std::vector<std::string> command_of(const System& system, const std::string& program) {
  std::vector<std::string> command;
  if (system.takes_wine) {
    command = {std::string(RTPM_SOURCE) + "/cmake/toolchains/wine.sh",
               std::string(RTPM_SOURCE) + "/build/windows/wine"};
  }
  command.push_back(file_of(system, program));
  return command;
}

class Pairs : public testing::TestWithParam<std::tuple<System, System>> {
 protected:
  void SetUp() override {
    for (const System& system : {server(), client()}) {
      for (const char* program : {"rtpm", "rtpm-registryd", "rtpm-deviced"}) {
        if (!std::filesystem::exists(file_of(system, program)))
          GTEST_SKIP() << file_of(system, program) << " is not there: run ./dev test-windows once";
      }
    }
  }
  void start_servers(const std::vector<std::string>& options) {
    registry_ = start("rtpm-registryd", options);
    ASSERT_TRUE(registry_);
    std::vector<std::string> further{"--registry", registry_->url, "--serve-events"};
    further.insert(further.end(), options.begin(), options.end());
    meet_registry();
    device_ = start("rtpm-deviced", further);
    ASSERT_TRUE(device_);
  }
  virtual void meet_registry() {}

  [[nodiscard]] std::vector<std::string> tool(const std::vector<std::string>& arguments) const {
    std::vector<std::string> command = command_of(client(), "rtpm");
    command.insert(command.end(), arguments.begin(), arguments.end());
    command.insert(command.end(), {"--deadline", "10s"});
    if (registry_) command.insert(command.end(), {"--registry", registry_->url});
    return command;
  }
  /// Runs the tool to its end.
  [[nodiscard]] test::Process::End rtpm(const std::vector<std::string>& arguments) const {
    auto end = test::run(tool(arguments), kPatience);
    if (end) return std::move(*end);
    ADD_FAILURE() << "rtpm " << arguments[0] << " did not end";
    return {};
  }
  void expect_output(const std::vector<std::string>& arguments,
                     const std::vector<std::string>& words) const {
    const auto end = rtpm(arguments);
    EXPECT_EQ(end.exit_code, 0) << arguments[0] << ": " << end.output << end.errors;
    expect_text(end.output, words);
  }
  /// Calls, their refusal, events, and the stop.
  void expect_use_of_the_device() const {
    expect_output({"list"}, {kDevice, "rtpm/events"});
    expect_output({"info", kDevice}, {"RTPM simulated arm", "lifecycle   active"});
    expect_output({"call", kDevice, "read"}, {"\"position_m\""});
    const auto refused = rtpm({"call", kDevice, "command", "{lease: 99}"});
    EXPECT_EQ(refused.exit_code, 1) << refused.output << refused.errors;
    test::Process events(tool({"echo", "--count", "2"}));
    EXPECT_TRUE(events.wait_for_output("\n", kPatience)) << events.errors();
    expect_output({"estop"}, {"lab/arm0 is stopped", "1 of 1 devices"});
    const auto end = events.wait(kPatience);
    EXPECT_TRUE(end && end->exit_code == 0) << events.errors();
    expect_output({"info", kDevice}, {"emergency stop"});
    // The stop outlives its device's program, and each system's devices are the same in all tests.
    expect_output({"take-over", kDevice, "rearm"}, {});
  }

  [[nodiscard]] static const System& server() { return std::get<0>(GetParam()); }
  [[nodiscard]] static const System& client() { return std::get<1>(GetParam()); }

  std::optional<Daemon> registry_{};
  std::optional<Daemon> device_{};

 private:
  [[nodiscard]] static std::optional<Daemon> start(const std::string& program,
                                                   std::vector<std::string> options) {
    options.insert(options.end(), {"--port", "0", "--realtime", "off"});
    std::vector<std::string> command = command_of(server(), program);
    command.insert(command.end(), options.begin(), options.end());
    return start_daemon(std::move(command));
  }
};

TEST_P(Pairs, CallAndHearEachOther) {
  start_servers({});
  if (!HasFatalFailure()) expect_use_of_the_device();
}

/// With the keys of one user, who may do all.
class SealedPairs : public Pairs {
 protected:
  void SetUp() override {
    if (server().folder == kLinux.folder && client().folder == kLinux.folder)
      GTEST_SKIP() << "a user's programs on Linux talk through memory, unsealed";
    ::setenv("RTPM_KEYS", keys_.path().c_str(), 1);
    Pairs::SetUp();
  }
  void TearDown() override { ::unsetenv("RTPM_KEYS"); }
  void meet_registry() override { expect_output({"key", "learn", registry_->url, "--yes"}, {}); }

  test::TemporaryFolder keys_{};
};

TEST_P(SealedPairs, CallAndHearEachOther) {
  const auto made = rtpm({"key", "new"});
  const std::size_t key = made.output.find("rtpm25519 ");
  ASSERT_NE(key, std::string::npos) << made.output << made.errors;
  const std::string line = made.output.substr(key, made.output.find_first_of("\r\n", key) - key);
  // Wine's files are for all users of Linux.
  std::filesystem::permissions(
      keys_.file("key"), std::filesystem::perms::owner_read | std::filesystem::perms::owner_write);
  const std::string authorized = keys_.file("authorized");
  expect_output({"key", "authorize", line, "--role", "administer", "--on", "**"}, {});
  start_servers({"--authorized", authorized});
  if (HasFatalFailure()) return;
  for (const char* name : {kDevice, "rtpm/events"})
    expect_output({"key", "learn", name, "--yes"}, {});
  expect_use_of_the_device();
  // A caller without the user's key is not served.
  ::setenv("RTPM_KEYS", keys_.file("none").c_str(), 1);
  const auto stranger = rtpm({"call", device_->url, "read"});
  EXPECT_NE(stranger.exit_code, 0) << stranger.output;
}

std::string name_of(const testing::TestParamInfo<std::tuple<System, System>>& tested) {
  return std::string(std::get<1>(tested.param).name) + "ToolWith" + std::get<0>(tested.param).name;
}
const auto kAll = testing::Combine(testing::Values(kLinux, kPortable, kWindows),
                                   testing::Values(kLinux, kPortable, kWindows));
INSTANTIATE_TEST_SUITE_P(Of, Pairs, kAll, name_of);
INSTANTIATE_TEST_SUITE_P(Of, SealedPairs, kAll, name_of);

}  // namespace
}  // namespace rtpm::system_test
