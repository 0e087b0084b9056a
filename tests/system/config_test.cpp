#include <gtest/gtest.h>
#include <signal.h>
#include <sys/stat.h>
#include <unistd.h>

#include <filesystem>
#include <optional>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "../unit/gvd/configuration/samples.hpp"
#include "programs.hpp"
#include "rtpm/configuration/client.hpp"
#include "rtpm/configuration/manager.hpp"
#include "rtpm/rpc/server.hpp"

// `rtpm config` against a real device server: changes, saving, calibrations, and every refusal.
namespace rtpm::system_test {
namespace {

/// A device server with an arm at rest and a gaze tracker, which saves its settings.
class Configured : public WithRegistry {
 protected:
  Configured() {
    folder_ =
        std::filesystem::path(testing::TempDir()) / ("rtpm-config-" + std::to_string(getpid()));
    std::filesystem::remove_all(folder_);
    std::filesystem::create_directory(folder_);
  }
  void SetUp() override {
    WithRegistry::SetUp();
    start_device();
  }

  void TearDown() override { std::filesystem::remove_all(folder_); }

  [[nodiscard]] std::vector<std::string> device_arguments(
      const std::string& devices = "arm0,gaze0") const {
    return {"--settings", settings(), "--devices", devices, "--device-arm0-free"};
  }
  void start_device(const std::vector<std::string>& more = {}) {
    auto arguments = device_arguments();
    arguments.insert(arguments.end(), more.begin(), more.end());
    device_ = start_server("rtpm-deviced", arguments);
    ASSERT_TRUE(device_);
  }
  void stop_device() {
    device_->process.send_signal(SIGTERM);
    const auto end = device_->process.wait(kPatience);
    ASSERT_TRUE(end);
    EXPECT_EQ(end->exit_code, 0) << end->errors;
  }
  [[nodiscard]] std::string settings() const { return (folder_ / "settings").string(); }

  [[nodiscard]] std::vector<std::string> with_common(std::vector<std::string> arguments) const {
    arguments.insert(arguments.begin(), "config");
    arguments.insert(arguments.end(), {"--registry", registry_->url, "--deadline", "20s"});
    return arguments;
  }
  /// Runs `rtpm config …`; repeats it while the machine did not run the device's thread in time.
  [[nodiscard]] test::Process::End config(const std::vector<std::string>& arguments) const {
    test::Process::End end;
    for (int i = 0; i < 20; ++i) {
      end = run_program("rtpm", with_common(arguments));
      if (end.errors.find("had no time for it") == std::string::npos) break;
    }
    return end;
  }
  /// The output of a `rtpm config …` that must succeed.
  [[nodiscard]] std::string output_of(const std::vector<std::string>& arguments) const {
    const auto end = config(arguments);
    EXPECT_EQ(end.exit_code, 0) << end.errors;
    EXPECT_EQ(end.errors, "");
    return end.output;
  }
  /// Runs `rtpm config …` with an operator's input.
  [[nodiscard]] test::Process::End typed(const std::string& lines,
                                         const std::vector<std::string>& arguments) const {
    std::vector<std::string> command{"sh", "-c", "printf '" + lines + "' | \"$0\" \"$@\"",
                                     path_of("rtpm")};
    const auto rest = with_common(arguments);
    command.insert(command.end(), rest.begin(), rest.end());
    auto end = test::run(command, kPatience);
    EXPECT_TRUE(end) << "it does not end";
    return end.value_or(test::Process::End{});
  }

  std::filesystem::path folder_;
  std::optional<Daemon> device_{};
};

std::size_t column_of(const std::string& line, std::string_view word) {
  return line.find(word);
}

TEST_F(Configured, ListsEveryParameterInATable) {
  const std::string output = output_of({"list", "lab/arm0"});
  std::istringstream lines(output);
  std::string first;
  std::string head;
  std::getline(lines, first);
  expect_text(first, {"RTPM simulated arm, serial sim-arm0, active, revision "});
  std::getline(lines, head);
  std::getline(lines, head);
  for (std::string line; std::getline(lines, line);) {
    if (!line.starts_with("safety.ramp_s")) continue;
    EXPECT_EQ(column_of(line, "0.02"), column_of(head, "VALUE"));
    EXPECT_EQ(column_of(line, "0 to 0.02"), column_of(head, "RANGE"));
    EXPECT_EQ(column_of(line, "any time"), column_of(head, "CHANGES"));
    EXPECT_EQ(column_of(line, "Time from full force"), column_of(head, "DESCRIPTION"));
  }
  expect_text(output, {"encoder.offset_m", "3 of -0.02 to 0.02", "read-only", "inactive",
                       "safety.force_newton_max", "0 to 9"});
}

TEST_F(Configured, ShowsEveryParameterInItsDescription) {
  for (const char* device : {"lab/arm0", "lab/gaze0"}) {
    const auto described = rtpm({"info", device, "--schema"});
    EXPECT_EQ(described.exit_code, 0) << described.errors;
    std::istringstream values(output_of({"get", device}));
    int count = 0;
    for (std::string line; std::getline(values, line); ++count) {
      const std::string name = line.substr(0, line.find('='));
      EXPECT_NE(described.output.find("//   " + name + " "), std::string::npos) << name;
    }
    EXPECT_GE(count, 9) << device;
  }
}

TEST_F(Configured, SetsAllOrNothingAndReadsBack) {
  EXPECT_EQ(output_of({"set", "lab/arm0", "safety.ramp_s=0.01", "encoder.offset_m=0.001,0,-0.002"}),
            "safety.ramp_s=0.01\nencoder.offset_m=0.001,0,-0.002\n");
  EXPECT_EQ(output_of({"get", "lab/arm0", "safety.ramp_s"}), "safety.ramp_s=0.01\n");
  expect_one_sentence(config({"set", "lab/arm0", "safety.ramp_s=0.02", "safety.hold_max_s=9"}), 1,
                      {"lab/arm0", "safety.hold_max_s", "0 to 0.1"});
  EXPECT_EQ(output_of({"get", "lab/arm0", "safety.ramp_s"}), "safety.ramp_s=0.01\n");
  EXPECT_EQ(output_of({"reset", "lab/arm0", "safety.ramp_s"}), "safety.ramp_s=0.02\n");
  EXPECT_EQ(output_of({"get", "lab/arm0", "encoder.offset_m"}),
            "encoder.offset_m=0.001,0,-0.002\n");
  EXPECT_EQ(output_of({"reset", "lab/arm0"}), "encoder.offset_m=0,0,0\n");
  EXPECT_TRUE(device_->process.wait_for_errors("lab/arm0: parameters have changed", kPatience));
}

TEST_F(Configured, RefusesInvalidValuesWithTheReason) {
  const auto expect = [&](const std::string& setting, int exit_code,
                          const std::vector<std::string_view>& words) {
    expect_one_sentence(config({"set", "lab/arm0", setting}), exit_code, words);
  };
  expect("safety.force_newton_max=10", 1, {"out of range", "0 to 9"});
  expect("safety.force_newton_max=much", 1, {"'much'", "type real", "a number such as"});
  expect("encoder.offset_m=1,2", 1, {"encoder.offset_m", "out of range"});
  expect("velocity.cycle_count=3", 1, {"the device is active", "deactivate the device first"});
  expect("encoder.resolution_m=1", 1, {"read-only"});
  expect("safety.ramp_s", 2, {"NAME=VALUE", "rtpm config set --help"});
  expect_one_sentence(config({"lits", "lab/arm0"}), 2, {"'lits'", "did you mean 'list'"});
}

TEST_F(Configured, ReportsADriversRefusal) {
  expect_one_sentence(
      config({"set", "lab/arm0", "workspace.low_m=0.05,0,0", "workspace.high_m=0.01,0,0"}), 1,
      {"workspace.low_m is above workspace.high_m", "give both corners"});
}

TEST_F(Configured, AppliesSomeParametersOnlyWhileInactive) {
  const auto stopped = rtpm({"take-over", "lab/arm0", "deactivate", "--for", "300ms"});
  ASSERT_EQ(stopped.exit_code, 0) << stopped.errors;
  EXPECT_EQ(output_of({"set", "lab/arm0", "velocity.cycle_count=3"}), "velocity.cycle_count=3\n");
}

TEST_F(Configured, RefusesTheSecondOfTwoWriters) {
  const std::string listed = output_of({"list", "lab/arm0"});
  const std::string mark = "revision ";
  const std::size_t begin = listed.find(mark) + mark.size();
  const std::string revision =
      listed.substr(begin, listed.find_first_not_of("0123456789", begin) - begin);
  const auto set_to = [&](const char* value) {
    return config(
        {"set", "lab/arm0", std::string("safety.ramp_s=") + value, "--revision", revision});
  };
  EXPECT_EQ(set_to("0.01").exit_code, 0);
  expect_one_sentence(set_to("0.015"), 1, {"another client has changed", "read them again"});
  EXPECT_EQ(output_of({"get", "lab/arm0", "safety.ramp_s"}), "safety.ramp_s=0.01\n");
}

TEST_F(Configured, RestoresSavedValuesAfterARestart) {
  ASSERT_EQ(config({"set", "lab/arm0", "safety.ramp_s=0.01"}).exit_code, 0);
  EXPECT_NE(output_of({"list", "lab/arm0"}).find(", not saved\n"), std::string::npos);
  EXPECT_EQ(output_of({"save", "lab/arm0"}), "saved\n");
  EXPECT_EQ(output_of({"list", "lab/arm0"}).find("not saved"), std::string::npos);
  ASSERT_EQ(config({"set", "lab/arm0", "safety.hold_max_s=0.05"}).exit_code, 0) << "not saved";
  stop_device();
  start_device();
  EXPECT_EQ(output_of({"get", "lab/arm0", "safety.ramp_s", "safety.hold_max_s"}),
            "safety.hold_max_s=0.1\nsafety.ramp_s=0.01\n");
}

TEST_F(Configured, IgnoresASavedLimitWhereTheServerHasATighterOne) {
  ASSERT_EQ(
      config({"set", "lab/arm0", "safety.force_newton_max=8", "safety.ramp_s=0.01"}).exit_code, 0);
  ASSERT_EQ(config({"save", "lab/arm0"}).exit_code, 0);
  stop_device();
  start_device({"--device-arm0-force-max", "5"});
  EXPECT_EQ(output_of({"get", "lab/arm0", "safety.force_newton_max", "safety.ramp_s"}),
            "safety.force_newton_max=5\nsafety.ramp_s=0.01\n");
  EXPECT_TRUE(device_->process.wait_for_errors("safety.force_newton_max = 8", kPatience));
}

TEST_F(Configured, RefusesToStartWithABrokenOrForeignFile) {
  ASSERT_EQ(config({"set", "lab/arm0", "safety.ramp_s=0.01"}).exit_code, 0);
  ASSERT_EQ(config({"save", "lab/arm0"}).exit_code, 0);
  stop_device();
  std::filesystem::path path;
  for (const auto& entry : std::filesystem::directory_iterator(settings()))
    path = entry.path();
  ASSERT_NE(path.string().find("sim-arm0"), std::string::npos) << path;
  std::string other = path.string();
  other.replace(other.find("sim-arm0"), 8, "sim-arm7");
  std::filesystem::copy_file(path, other);
  auto arguments = device_arguments("arm0");
  arguments.insert(arguments.end(),
                   {"--port", "0", "--registry", registry_->url, "--realtime", "off"});
  auto foreign = arguments;
  foreign.insert(foreign.end(), {"--device-arm0-serial", "sim-arm7"});
  expect_one_sentence(run_program("rtpm-deviced", foreign), 1,
                      {"lab/arm0", "sim-arm7.json", "sim-arm0", "Remedy"});
  std::filesystem::resize_file(path, std::filesystem::file_size(path) / 2);
  expect_one_sentence(run_program("rtpm-deviced", arguments), 1,
                      {"lab/arm0", "sim-arm0.json", "Remedy"});
}

TEST_F(Configured, SavesNothingWithoutAFolder) {
  const auto device =
      start_daemon("rtpm-deviced", {"--port", "0", "--registry", "none", "--realtime", "off"});
  ASSERT_TRUE(device);
  expect_one_sentence(config({"save", device->url}), 1, {"no folder", "--settings"});
  EXPECT_EQ(config({"list", device->url}).exit_code, 0) << "by URL, without a registry";
}

TEST_F(Configured, RunsACalibrationAsADialogue) {
  EXPECT_NE(output_of({"calibrate", "lab/arm0"}).find("encoder_offset  "), std::string::npos);
  const auto kept = typed("what\\nready\\nkeep\\n", {"calibrate", "lab/arm0", "encoder_offset"});
  EXPECT_EQ(kept.exit_code, 0) << kept.errors;
  expect_text(kept.output, {"Put the arm at rest", "[ready]", "Answer ready", "%",
                            "The encoders' offset is", "[keep | discard]", "kept"});
  const std::string offset = output_of({"get", "lab/arm0", "encoder.offset_m"});
  EXPECT_NE(offset, "encoder.offset_m=0,0,0\n");
  EXPECT_NE(kept.output.find(offset), std::string::npos) << offset;
}

TEST_F(Configured, CalibratesTheTrackerWithNinePointsFromAScript) {
  const auto discarded =
      config({"calibrate", "lab/gaze0", "nine_points", "--answer", "ready", "--discard"});
  EXPECT_EQ(discarded.exit_code, 0) << discarded.errors;
  EXPECT_EQ(output_of({"get", "lab/gaze0", "correction.gain"}), "correction.gain=1,1\n");
  const auto kept =
      config({"calibrate", "lab/gaze0", "nine_points", "--answer", "ready", "--keep"});
  EXPECT_EQ(kept.exit_code, 0) << kept.errors;
  EXPECT_NE(kept.output.find("lower right"), std::string::npos) << kept.output;
  EXPECT_NE(output_of({"get", "lab/gaze0", "correction.gain"}), "correction.gain=1,1\n");
}

TEST_F(Configured, ChangesNothingWhenACalibrationFailsOrIsAbandoned) {
  expect_one_sentence(config({"calibrate", "lab/arm0", "workspace", "--answer", "done"}), 1,
                      {"the calibration failed", "move it through all corners"});
  expect_one_sentence(config({"calibrate", "lab/arm0", "encoder_offset", "--answer", "no"}), 1,
                      {"nothing has changed", "answer ready"});
  expect_one_sentence(typed("", {"calibrate", "lab/arm0", "encoder_offset"}), 1,
                      {"standard input ended", "--answer"});
  EXPECT_EQ(output_of({"get", "lab/arm0", "encoder.offset_m"}), "encoder.offset_m=0,0,0\n");
}

TEST_F(Configured, CancelsACalibrationAtCtrlC) {
  const std::string pipe = (folder_ / "keyboard").string();
  ASSERT_EQ(mkfifo(pipe.c_str(), 0600), 0);
  std::vector<std::string> command{"sh", "-c", "exec \"$0\" \"$@\" <>" + pipe, path_of("rtpm")};
  const auto rest = with_common({"calibrate", "lab/arm0", "encoder_offset"});
  command.insert(command.end(), rest.begin(), rest.end());
  test::Process dialogue(command);
  ASSERT_TRUE(dialogue.wait_for_output("[ready]", kPatience)) << dialogue.errors();
  expect_one_sentence(config({"calibrate", "lab/arm0", "workspace"}), 1, {"is not over"});
  dialogue.send_signal(SIGINT);
  const auto end = dialogue.wait(kPatience);
  ASSERT_TRUE(end) << "it does not end";
  expect_one_sentence(*end, 1, {"nothing has changed", "it was cancelled"});
  const auto next =
      config({"calibrate", "lab/arm0", "encoder_offset", "--answer", "ready", "--discard"});
  EXPECT_EQ(next.exit_code, 0) << "it is free at once: " << next.errors;
}

/// A device whose texts would clear a terminal's screen.
class HostileDevice final : public test::SampleDevice {
 public:
  HostileDevice() {
    described.model = kHostile;
    specs[0].description = kHostile;
    specs[0].unit = kHostile;
    active = true;
    sample.emplace();
    sample->sequence = 1;
    sample->lifecycle = driver::Lifecycle::kActive;
  }
  [[nodiscard]] std::vector<driver::CalibrationInfo> calibrations() const override {
    return {{"offset", kHostile}};
  }
  [[nodiscard]] expected<std::unique_ptr<driver::Calibration>, gvd::ConfigurationError>
  make_calibration(std::string_view) override {
    struct Words final : driver::Calibration {
      driver::CalibrationState step(const driver::Sample&,
                                    std::optional<std::string_view>) override {
        return driver::CalibrationPrompt{0, kHostile, {kHostile}};
      }
    };
    return std::unique_ptr<driver::Calibration>(std::make_unique<Words>());
  }

  static constexpr const char* kHostile = "\x1b[2J\nall is \xe2\x80\xaewell";
};

TEST(ConfigOfAHostileServer, PrintsItsTextEscaped) {
  HostileDevice device;
  const auto manager = gvd::ConfigurationManager::create(device);
  ASSERT_TRUE(manager) << manager.error().text();
  rpc::ServerConfig config;
  config.realtime = rt::RealtimeMode::kOff;
  const auto server = rpc::Server::create(config);
  ASSERT_TRUE(server);
  ASSERT_TRUE((*server)->add(gvd::configuration_path("arm"), (*manager)->servant()));
  ASSERT_TRUE((*server)->start());
  const std::string url = (*server)->url("arm");
  const auto expect_escaped = [&](std::vector<std::string> arguments) {
    arguments.insert(arguments.end(), {"--deadline", "20s"});
    const auto end = run_program("rtpm", arguments);
    const std::string all = end.output + end.errors;
    EXPECT_NE(all.find("\\x1b[2J\\n"), std::string::npos) << all;
    EXPECT_EQ(all.find('\x1b'), std::string::npos) << all;
    EXPECT_EQ(all.find("\xe2\x80\xae"), std::string::npos) << all;
  };
  expect_escaped({"config", "list", url});
  expect_escaped({"config", "calibrate", url});
  expect_escaped({"config", "calibrate", url, "offset"});
  expect_escaped({"config", "calibrate", url, "offset", "--answer", "no"});
  (*server)->stop();
}

}  // namespace
}  // namespace rtpm::system_test
