#include <poll.h>
#include <rtpm/rtpm.h>

#include <array>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <thread>

#include "programs.hpp"

namespace rtpm::system_test {
namespace {

using Json = nlohmann::json;

/// A text that the library gave.
std::string taken(char* text) {
  std::string copy(text);
  rtpm_free(text);
  return copy;
}

#define EXPECT_OK(call) EXPECT_EQ(call, RTPM_OK) << rtpm_last_error()
#define ASSERT_OK(call) ASSERT_EQ(call, RTPM_OK) << rtpm_last_error()

/// A laboratory with events, and a node of C beside it.
class InC : public WithRegistry {
 protected:
  void SetUp() override {
    WithRegistry::SetUp();
    if (HasFatalFailure()) return;
    device_ = start_server("rtpm-deviced", {"--serve-events", "--stops", "none", "--settings", ""});
    ASSERT_TRUE(device_);
    rtpm_node_options options RTPM_NODE_OPTIONS_INIT;
    options.registry = registry_->url.c_str();
    ASSERT_OK(rtpm_node_open(&options, &node_));
  }
  void TearDown() override { rtpm_node_close(node_); }

  [[nodiscard]] rtpm_device* open_arm() const {
    rtpm_device_options options RTPM_DEVICE_OPTIONS_INIT;
    options.timeout_us = 5'000'000;
    options.hold_us = 100'000;
    rtpm_device* device = nullptr;
    EXPECT_OK(rtpm_device_open(node_, "lab/arm0", &options, &device));
    return device;
  }
  /// Commands again and again until a sample shows a force along y of so many newton.
  [[nodiscard]] static bool is_felt(rtpm_device* device, double newton) {
    for (int i = 0; i < 5000; ++i) {
      const std::array force{0.0, newton, 0.0};
      if (rtpm_device_set_wrench(device, force.data(), nullptr) != RTPM_OK) return false;
      rtpm_sample sample RTPM_SAMPLE_INIT;
      const bool is_read = rtpm_device_read(device, &sample) == RTPM_OK;
      if (is_read && std::abs(sample.force_newton[1] - newton) < 1e-6) return true;
      std::this_thread::sleep_for(std::chrono::milliseconds{1});
    }
    return false;
  }

  std::optional<Daemon> device_{};
  rtpm_node* node_ = nullptr;
};

TEST_F(InC, NamesAreListed) {
  char* text = nullptr;
  ASSERT_OK(rtpm_node_names(node_, nullptr, &text));
  const Json list = Json::parse(taken(text));
  const auto is_arm = [](const Json& entry) {
    return entry["name"] == "lab/arm0" && entry["interface"] == "rtpm.device.Device" &&
           entry["url"].get<std::string>().starts_with("rtpm://");
  };
  EXPECT_TRUE(std::ranges::any_of(list, is_arm)) << list;
}

TEST_F(InC, ADeviceIsDescribedReadAndCommanded) {
  rtpm_device* const arm = open_arm();
  rtpm_description description RTPM_DESCRIPTION_INIT;
  ASSERT_OK(rtpm_device_describe(arm, &description));
  EXPECT_STREQ(description.model, "RTPM simulated arm");
  EXPECT_EQ(description.rate_hz, 1000);
  EXPECT_GT(description.force_newton_max, 1);
  EXPECT_GT(description.force_end_us, 0);

  const std::array force{0.0, 0.5, 0.0};
  EXPECT_EQ(rtpm_device_set_wrench(arm, force.data(), nullptr), RTPM_NOT_HOLDER);
  expect_text(rtpm_last_error(), {"lab/arm0", "acquire"});
  ASSERT_OK(rtpm_device_acquire(arm, 5'000'000));
  EXPECT_TRUE(is_felt(arm, 0.5)) << rtpm_last_error();
  EXPECT_OK(rtpm_device_renew(arm));
  EXPECT_OK(rtpm_device_deactivate(arm));
  EXPECT_EQ(rtpm_device_set_wrench(arm, force.data(), nullptr), RTPM_NOT_ACTIVE);
  EXPECT_OK(rtpm_device_activate(arm));
  EXPECT_OK(rtpm_device_release(arm));
  rtpm_device_close(arm);
}

TEST_F(InC, OneClientAtATimeCommandsADevice) {
  rtpm_device* const arm = open_arm();
  rtpm_device* const other = open_arm();
  ASSERT_OK(rtpm_device_acquire(arm, 5'000'000));
  EXPECT_EQ(rtpm_device_acquire(other, 0), RTPM_HELD);
  ASSERT_OK(rtpm_device_take_over(other));
  EXPECT_EQ(rtpm_device_renew(arm), RTPM_NOT_HOLDER);
  EXPECT_OK(rtpm_device_take_over(arm)) << "waits for the second that a device asks for";
  rtpm_device_close(other);
  rtpm_device_close(arm);
}

TEST_F(InC, AStopHoldsUntilItIsRearmed) {
  rtpm_device* const arm = open_arm();
  ASSERT_OK(rtpm_device_emergency_stop(arm));
  ASSERT_OK(rtpm_device_acquire(arm, 5'000'000));
  const std::array force{0.0, 0.5, 0.0};
  EXPECT_EQ(rtpm_device_set_wrench(arm, force.data(), nullptr), RTPM_STOPPED);
  EXPECT_OK(rtpm_device_rearm(arm));
  EXPECT_OK(rtpm_device_recover(arm));
  EXPECT_TRUE(is_felt(arm, 0.5)) << rtpm_last_error();
  const std::array broken{0.0, std::nan(""), 0.0};
  EXPECT_EQ(rtpm_device_set_wrench(arm, broken.data(), nullptr), RTPM_INVALID);
  EXPECT_OK(rtpm_device_recover(arm));
  EXPECT_TRUE(is_felt(arm, 0.5)) << rtpm_last_error();
  rtpm_device_close(arm);
}

TEST_F(InC, AnyObjectIsCalledByJson) {
  rtpm_object* arm = nullptr;
  ASSERT_OK(rtpm_object_open(node_, "lab/arm0/config", &arm));
  char* text = nullptr;
  ASSERT_OK(rtpm_object_call(arm, "get", "{names: [\"safety.ramp_s\"]}", 5'000'000, &text));
  const Json reply = Json::parse(taken(text));
  EXPECT_EQ(reply["settings"][0]["name"], "safety.ramp_s");
  EXPECT_EQ(rtpm_object_call(arm, "get", "{names: 7}", 0, &text), RTPM_INVALID);
  expect_text(rtpm_last_error(), {"names"});
  EXPECT_EQ(rtpm_object_call(arm, "grab", "", 0, &text), RTPM_REFUSED);
  expect_text(rtpm_last_error(), {"no method 'grab'"});
  void* bytes = nullptr;
  std::size_t size = 0;
  ASSERT_OK(rtpm_object_call_bytes(arm, "list", nullptr, 0, 5'000'000, &bytes, &size));
  EXPECT_GT(size, 100u);
  rtpm_free(bytes);
  rtpm_object_close(arm);
}

TEST_F(InC, EventsWaitAtADescriptor) {
  rtpm_events* events = nullptr;
  EXPECT_EQ(rtpm_events_open(node_, nullptr, "type(nothing)", 16, &events), RTPM_INVALID);
  expect_text(rtpm_last_error(), {"nothing"});
  ASSERT_OK(rtpm_events_open(node_, nullptr, "type(rtpm.device.Sampled)", 16, &events));
  pollfd wanted{rtpm_events_descriptor(events), POLLIN, 0};
  ASSERT_EQ(::poll(&wanted, 1, 30'000), 1);
  rtpm_event event RTPM_EVENT_INIT;
  ASSERT_OK(rtpm_events_next(events, 0, &event));
  EXPECT_STREQ(event.type_name, "rtpm.device.Sampled");
  const Json sample = Json::parse(event.json);
  EXPECT_TRUE(sample.contains("position_m")) << sample;
  EXPECT_GT(event.payload_size, 100u);
  // The program's queue keeps the newest 16.
  std::this_thread::sleep_for(std::chrono::milliseconds{200});
  ASSERT_OK(rtpm_events_next(events, 0, &event));
  EXPECT_GT(event.lost_count, 0u);
  rtpm_events_close(events);
}

TEST_F(InC, RecordingsAreMadeAndReadByTheTool) {
  const std::filesystem::path file =
      std::filesystem::path(testing::TempDir()) / ("in_c_" + std::to_string(::getpid()) + ".mcap");
  std::filesystem::remove(file);
  rtpm_recording* recording = nullptr;
  const char* const devices[] = {"lab/arm0"};
  ASSERT_OK(rtpm_recording_start(node_, file.c_str(), nullptr, devices, 1, &recording));
  EXPECT_OK(rtpm_recording_annotate(recording, "soft"));
  std::this_thread::sleep_for(std::chrono::milliseconds{500});
  std::uint64_t count = 0;
  ASSERT_OK(rtpm_recording_stop(recording, &count, nullptr));
  EXPECT_GT(count, 50u);
  EXPECT_EQ(rtpm({"bag", "info", file.string()}).exit_code, 0);
  EXPECT_EQ(rtpm_recording_start(node_, file.c_str(), nullptr, devices, 1, &recording),
            RTPM_FAILED);
  std::filesystem::remove(file);
}

TEST_F(InC, TheExampleRunsItsWall) {
  ASSERT_EQ(::setenv("RTPM_REGISTRY", registry_->url.c_str(), 1), 0);
  const auto end = test::run({RTPM_C_WALL, "lab/arm0", "2"}, kPatience);
  ASSERT_TRUE(end);
  EXPECT_EQ(end->exit_code, 0) << end->errors;
  expect_text(end->output, {"of 2000 cycles in the wall"});
}

TEST_F(InC, TheExampleInCSharpReadsPositions) {
  const std::string folder = testing::TempDir() + "rtpm_c_sharp_" + std::to_string(::getpid());
  if (std::system("command -v mcs mono > /dev/null") != 0)
    GTEST_SKIP() << "needs the Debian packages mono-mcs and mono-runtime";
  std::filesystem::create_directories(folder);
  const std::string program = folder + "/Position.exe";
  ASSERT_EQ(std::system(("mcs -out:" + program + " " RTPM_C_SHARP).c_str()), 0);
  ASSERT_EQ(::setenv("RTPM_REGISTRY", registry_->url.c_str(), 1), 0);
  const std::string library = std::filesystem::path(RTPM_C_LIBRARY).parent_path();
  ASSERT_EQ(::setenv("LD_LIBRARY_PATH", library.c_str(), 1), 0);
  const auto end = test::run({"/usr/bin/mono", program, "lab/arm0", "20"}, kPatience);
  ASSERT_TRUE(end);
  EXPECT_EQ(end->exit_code, 0) << end->errors;
  EXPECT_GT(test::line_count(end->output), 3) << end->output;
  expect_text(end->output, {"sample ", " m"});
  std::filesystem::remove_all(folder);
}

TEST_F(InC, TheExampleInOctaveReadsPositions) {
  if (std::system("command -v mkoctfile octave-cli > /dev/null") != 0)
    GTEST_SKIP() << "needs the Debian package octave-dev";
  const std::string folder = testing::TempDir() + "rtpm_octave_" + std::to_string(::getpid());
  std::filesystem::create_directories(folder);
  const std::string library = std::filesystem::path(RTPM_C_LIBRARY).parent_path();
  ASSERT_EQ(std::system(("cd " + folder +
                         " && mkoctfile --mex " RTPM_C_OCTAVE " -I" RTPM_C_HEADERS " -L" + library +
                         " -lrtpm-c")
                            .c_str()),
            0);
  ASSERT_EQ(::setenv("RTPM_REGISTRY", registry_->url.c_str(), 1), 0);
  ASSERT_EQ(::setenv("LD_LIBRARY_PATH", library.c_str(), 1), 0);
  const auto octave = [&folder](const std::string& line) {
    return test::run({"/usr/bin/octave-cli", "--quiet", "--path", folder, "--eval", line},
                     kPatience);
  };
  auto end = octave("for i = 1:3, [p, f] = rtpm_position('lab/arm0'); printf('%f m\\n', p); end");
  ASSERT_TRUE(end);
  EXPECT_EQ(end->exit_code, 0) << end->errors;
  EXPECT_EQ(test::line_count(end->output), 9) << end->output;
  end = octave("rtpm_position('lab/nothing')");
  ASSERT_TRUE(end);
  EXPECT_NE(end->exit_code, 0);
  expect_text(end->errors, {"lab/nothing"});
  std::filesystem::remove_all(folder);
}

TEST_F(InC, ProgramsOfAnotherHeaderGetTheFieldsThatTheyKnow) {
  rtpm_device* const arm = open_arm();
  // An older header ended behind the sequence; what follows is not the library's.
  std::array<std::byte, sizeof(rtpm_sample)> memory{};
  memory.fill(std::byte{0x55});
  const std::uint32_t size = offsetof(rtpm_sample, host_time_ns);
  std::memcpy(memory.data(), &size, sizeof size);
  rtpm_sample* const sample = static_cast<rtpm_sample*>(static_cast<void*>(memory.data()));
  ASSERT_OK(rtpm_device_read(arm, sample));
  EXPECT_GT(sample->sequence, 0u);
  EXPECT_EQ(memory[size], std::byte{0x55});
  rtpm_device_close(arm);
}

TEST(InCAlone, WrongUsesAreRefusedInWords) {
  rtpm_node_options options RTPM_NODE_OPTIONS_INIT;
  options.transport = "carrier pigeon";
  rtpm_node* node = nullptr;
  EXPECT_EQ(rtpm_node_open(&options, &node), RTPM_INVALID);
  expect_text(rtpm_last_error(), {"udp", "carrier pigeon"});
  EXPECT_EQ(rtpm_node_open(nullptr, nullptr), RTPM_INVALID);
  options.transport = nullptr;
  options.registry = "rtpm://127.0.0.1:1/rtpm/names";
  ASSERT_OK(rtpm_node_open(&options, &node));
  EXPECT_STREQ(rtpm_last_error(), "");
  rtpm_device* device = nullptr;
  EXPECT_EQ(rtpm_device_open(node, "lab/arm0", nullptr, &device), RTPM_UNREACHABLE);
  expect_text(rtpm_last_error(), {"registry", "Remedy"});
  rtpm_sample blank{};
  EXPECT_EQ(rtpm_device_read(device, &blank), RTPM_INVALID);
  rtpm_node_close(node);
  rtpm_node_close(nullptr);
  EXPECT_STREQ(rtpm_status_name(RTPM_HELD), "held");
  EXPECT_STREQ(rtpm_status_name(99), "unknown");
}

}  // namespace
}  // namespace rtpm::system_test
