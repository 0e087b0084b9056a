#include <gtest/gtest.h>
#include <signal.h>

#include <atomic>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <vector>

#include "../unit/recording/recorded.hpp"
#include "programs.hpp"
#include "rtpm/gvd/consumer.hpp"
#include "rtpm/names/resolver.hpp"
#include "rtpm/rpc/node.hpp"
#include "rtpm/test/os.hpp"

/// Several devices at once: their events, their display, and the emergency stop of all.
namespace rtpm::system_test {
namespace {

class Devices : public WithRegistry {
 protected:
  [[nodiscard]] std::optional<Daemon> host(const std::string& devices,
                                           std::vector<std::string> options = {}) const {
    options.insert(options.end(), {"--devices", devices});
    return start_server("rtpm-deviced", options);
  }
  [[nodiscard]] std::vector<std::string> display_arguments(const std::string& devices,
                                                           const std::string& seconds) const {
    return {"--registry", registry_->url, "--devices", devices,
            "--seconds",  seconds,        "--live",    "lines"};
  }
  /// Whether the device's sample has the fault bit of the emergency stop.
  [[nodiscard]] bool is_stopped(const std::string& device) const {
    const auto read = rtpm({"call", device, "read"});
    return read.output.find("\"faults\": 8192") != std::string::npos;
  }
};

TEST_F(Devices, AreShownTogetherByTheirEvents) {
  const auto devices = host("arm0,gaze0,biometric0,knob0", {"--serve-events"});
  ASSERT_TRUE(devices);
  const auto shown = run_program(
      "rtpm-display", display_arguments("lab/arm0,lab/gaze0,lab/biometric0,lab/knob0", "2.5"));
  EXPECT_EQ(shown.exit_code, 0) << shown.errors;
  expect_text(shown.output, {"lab/arm0 ", " mm  force ", "lab/gaze0 ", "looks ", "lab/biometric0 ",
                             "pulse ", "lab/knob0 ", "dial ", "lab/knob0: "});
}

TEST_F(Devices, AreUsedByThePapersProgramInBothItsWays) {
  const auto devices = host("arm0", {"--serve-events", "--device-arm0-watchdog", "damp"});
  ASSERT_TRUE(devices);
  test::Process figure5({path_of("rtpm-figure5"), "--registry", registry_->url});
  ASSERT_TRUE(figure5.wait_for_output("new position = ", kPatience)) << figure5.errors();
  const auto read = rtpm({"call", "lab/arm0", "read"});
  EXPECT_EQ(read.output.find("\"force_newton\": {\"x\": 0.0, \"y\": 0.0"), std::string::npos)
      << "the client's force arrives: " << read.output;
  figure5.send_signal(SIGINT);
  const auto end = figure5.wait(kPatience);
  ASSERT_TRUE(end);
  EXPECT_EQ(end->exit_code, 0) << end->errors;
}

TEST_F(Devices, GoOnWhileTheirHubIsKilledAndComesBack) {
  auto hub = start_server("rtpm-eventd");
  ASSERT_TRUE(hub);
  const auto devices = host("knob0");
  ASSERT_TRUE(devices);
  std::vector<std::string> command = display_arguments("lab/knob0", "0");
  command.insert(command.begin(), path_of("rtpm-display"));
  test::Process display(command);
  ASSERT_TRUE(display.wait_for_output("dial ", kPatience)) << display.errors();
  const std::string port = std::to_string(hub->port());
  hub->process.send_signal(SIGKILL);
  ASSERT_TRUE(hub->process.wait(kPatience));
  ASSERT_TRUE(display.wait_for_output("no hub", kPatience)) << display.output();
  EXPECT_EQ(rtpm({"call", "lab/knob0", "read"}).exit_code, 0) << "the device does not notice";
  hub = start_server("rtpm-eventd", {"--port", port});
  ASSERT_TRUE(hub);
  const std::string before = display.output();
  ASSERT_TRUE(test::await(
      [&] {
        // A line without the mark follows the lines that have it.
        static_cast<void>(display.wait_for_output("never printed", std::chrono::milliseconds{100}));
        const std::string& output = display.output();
        return output.size() > before.size() && output.rfind("dial ") > output.rfind("no hub");
      },
      kPatience))
      << display.output();
  display.send_signal(SIGINT);
  const auto end = display.wait(kPatience);
  ASSERT_TRUE(end);
  EXPECT_NE(end->output.find("1 gaps"), std::string::npos) << end->output;
}

TEST_F(Devices, StopTogetherOnAllServers) {
  const auto first = host("arm0", {"--serve-events"});
  const auto second = host("gaze0,knob0");
  ASSERT_TRUE(first && second);
  ASSERT_TRUE(test::await(
      [&] {
        // The second server subscribes to the first's hub within its retry.
        const auto report = rtpm({"call", "rtpm/events", "report"});
        return report.output.find("emergency stop") != report.output.rfind("emergency stop");
      },
      kPatience));
  const auto stopped = rtpm({"estop", "lab/arm0", "system"});
  EXPECT_EQ(stopped.exit_code, 0) << stopped.errors;
  for (const std::string device : {"lab/arm0", "lab/gaze0", "lab/knob0"}) {
    EXPECT_TRUE(test::await([&] { return is_stopped(device); }, kPatience)) << device;
  }
  const auto rearmed = rtpm({"take-over", "lab/knob0", "rearm", "--for", "100ms"});
  EXPECT_EQ(rearmed.exit_code, 0) << rearmed.errors;
  EXPECT_FALSE(is_stopped("lab/knob0"));
  EXPECT_TRUE(is_stopped("lab/gaze0")) << "each is rearmed by itself";
}

TEST_F(Devices, ReportChangedParametersToConsumers) {
  const auto devices = host("knob0", {"--serve-events"});
  ASSERT_TRUE(devices);
  class Handler final : public gvd::DeviceEventHandler {
   public:
    void on_events(std::span<const gvd::DeviceEvent> events) override {
      for (const gvd::DeviceEvent& event : events) {
        const auto* const change = std::get_if<gvd::ConfigurationChange>(&event.what);
        if (change != nullptr && change->names == std::vector<std::string>{"safety.ramp_s"}) {
          has_come = true;
        }
      }
    }
    std::atomic<bool> has_come{false};
  } handler;
  rpc::Node node;
  names::RegistryResolver resolver(node, registry_->url);
  node.use(resolver);
  gvd::DeviceConsumerConfig config{.devices = {"lab/knob0"}};
  config.subscription.filter = gvd::changes_of("lab/knob0");
  config.subscription.realtime = rt::RealtimeMode::kOff;
  config.subscription.deadline = kPatience;
  const auto consumer = gvd::DeviceConsumer::start(node, config, handler);
  ASSERT_TRUE(consumer) << consumer.error().text();
  EXPECT_EQ(rtpm({"config", "set", "lab/knob0", "safety.ramp_s=0.01"}).exit_code, 0);
  EXPECT_TRUE(test::await([&] { return handler.has_come.load(); }, kPatience));
}

TEST_F(Devices, WriteAFlightRecordAtEachFault) {
  const auto folder = std::filesystem::path(testing::TempDir()) / "rtpm_flights";
  std::filesystem::remove_all(folder);
  std::filesystem::create_directory(folder);
  const auto devices = host("arm0", {"--events", "none", "--flight-records", folder.string()});
  ASSERT_TRUE(devices);
  expect_one_sentence(rtpm({"flight-record", "lab/arm0"}), 1, {"lab/arm0"});
  EXPECT_EQ(rtpm({"estop", "lab/arm0"}).exit_code, 0);
  const std::string file = (folder / "lab-arm0.1.mcap").string();
  ASSERT_TRUE(test::await([&] { return std::filesystem::exists(file); }, kPatience));
  const auto printed = rtpm({"flight-record", "lab/arm0"});
  EXPECT_EQ(printed.exit_code, 0) << printed.errors;
  EXPECT_EQ(printed.output.find("# fault 1: emergency stop in cycle "), 0u) << printed.output;
  const auto machine = rtpm({"flight-record", "lab/arm0", "--json"});
  const auto json = nlohmann::json::parse(machine.output, nullptr, false);
  EXPECT_EQ(json["cause"], "emergency stop") << machine.errors;
  const auto line_count = static_cast<std::size_t>(test::line_count(printed.output));
  EXPECT_EQ(json["cycles"].size(), line_count - 2) << "as many as the text has";
  EXPECT_EQ(json["cycles"].back()["faults"], "emergency stop");
  const std::string copy = (folder / "copy.mcap").string();
  const auto recorded = rtpm({"flight-record", "lab/arm0", "-o", copy, "--json"});
  EXPECT_EQ(nlohmann::json::parse(recorded.output, nullptr, false)["cycle_count"], line_count - 2)
      << recorded.errors;
  const auto by_server = recording::FileReader::open(file);
  const auto by_tool = recording::FileReader::open(copy);
  ASSERT_TRUE(by_server && by_tool);
  const auto messages = recording::read_all(**by_server);
  EXPECT_EQ(messages.size(), line_count - 2);
  const auto copied = recording::read_all(**by_tool);
  ASSERT_EQ(copied.size(), messages.size());
  for (std::size_t i = 0; i < messages.size(); ++i)
    ASSERT_EQ(copied[i].text, messages[i].text) << "the server and the tool record the same";
  EXPECT_EQ((*by_tool)->channels().at(1), (*by_server)->channels().at(1));
  expect_one_sentence(rtpm({"flight-record", "lab/arm0", "-o", copy}), 1, {copy, "exists"});
  const auto text = rtpm({"flight-record", "lab/arm0", "-o", copy + "2"});
  EXPECT_NE(text.output.find(" cycles around emergency stop in cycle "), std::string::npos);
  std::filesystem::remove_all(folder);
}

TEST_F(Devices, AreAllStoppedByOneCommand) {
  const auto devices = host("gaze0,knob0", {"--events", "none"});
  ASSERT_TRUE(devices);
  const auto stopped = rtpm({"estop"});
  EXPECT_EQ(stopped.exit_code, 0) << stopped.errors;
  expect_text(stopped.output, {"2 of 2 devices are stopped\n"});
  EXPECT_TRUE(is_stopped("lab/gaze0"));
  expect_one_sentence(rtpm({"estop", "lab/gaze0", "system"}), 1, {"takes no part"});
  EXPECT_EQ(rtpm({"estop", "lab/gaze0", "house"}).exit_code, 2);
}

TEST_F(Devices, StayStoppedWhenTheirServerIsKilledUntilTheyAreRearmed) {
  const std::string stops = testing::TempDir() + "rtpm_kept_stops";
  std::filesystem::remove_all(stops);
  const std::vector<std::string> options{"--events", "none", "--stops", stops};
  auto devices = host("arm0,knob0", options);
  ASSERT_TRUE(devices);
  EXPECT_EQ(rtpm({"estop", "lab/arm0"}).exit_code, 0);
  ASSERT_TRUE(devices->process.wait_for_errors("lab/arm0: emergency stop", kPatience));
  const auto start_again = [&] {
    devices->process.send_signal(SIGKILL);
    EXPECT_TRUE(devices->process.wait(kPatience));
    devices.reset();
    devices = host("arm0,knob0", options);
  };
  start_again();
  ASSERT_TRUE(devices);
  EXPECT_TRUE(is_stopped("lab/arm0"));
  EXPECT_FALSE(is_stopped("lab/knob0"));
  EXPECT_TRUE(
      devices->process.wait_for_errors("it was stopped before this program began", kPatience))
      << devices->process.errors();
  const auto rearmed = rtpm({"take-over", "lab/arm0", "rearm"});
  EXPECT_EQ(rearmed.exit_code, 0) << rearmed.errors;
  ASSERT_TRUE(devices->process.wait_for_errors("the device is rearmed", kPatience));
  start_again();
  ASSERT_TRUE(devices);
  EXPECT_FALSE(is_stopped("lab/arm0"));
  std::filesystem::remove_all(stops);
}

TEST_F(Devices, ConfirmTheRequestsOfAnOperator) {
  const auto devices = host("arm0", {"--events", "none"});
  ASSERT_TRUE(devices);
  EXPECT_EQ(rtpm({"estop", "lab/arm0"}).exit_code, 0);
  // Each stop ends by itself, and take-overs are at least a second apart.
  const auto transition = [&](const char* word) {
    test::Process::End end;
    EXPECT_TRUE(test::await(
        [&] {
          end = rtpm({"take-over", "lab/arm0", word});
          return end.errors.find("a moment ago") == std::string::npos;
        },
        kPatience));
    EXPECT_EQ(end.exit_code, 0) << end.errors;
    expect_text(end.output, {"lab/arm0 is free: the right to command was given back"});
    return end.output;
  };
  const auto recovered = rtpm({"take-over", "lab/arm0", "recover"});
  expect_one_sentence(recovered, 1, {"no fault is latched, but the emergency stop holds", "rearm"});
  EXPECT_NE(transition("rearm").find("lab/arm0 is rearmed"), std::string::npos);
  EXPECT_NE(transition("deactivate").find("lab/arm0 is inactive"), std::string::npos);
  EXPECT_NE(transition("activate").find("lab/arm0 is active"), std::string::npos);
}

// A device whose name is bound in two registries is stopped at both servers.
TEST_F(Devices, AreStoppedByANameThatIsBoundTwice) {
  const auto devices = host("arm0", {"--events", "none"});
  ASSERT_TRUE(devices);
  const auto other = start_daemon("rtpm-registryd", {"--port", "0", "--realtime", "off"});
  ASSERT_TRUE(other);
  const auto second =
      start_daemon("rtpm-deviced", {"--port", "0", "--registry", other->url, "--realtime", "off",
                                    "--devices", "arm0", "--events", "none"});
  ASSERT_TRUE(second);
  const auto stopped =
      run_program("rtpm", {"estop", "lab/arm0", "--registry", registry_->url + "," + other->url});
  EXPECT_EQ(stopped.exit_code, 0) << stopped.errors;
  EXPECT_EQ(test::line_count(stopped.output), 2) << stopped.output;
  EXPECT_TRUE(is_stopped("lab/arm0"));
  const auto sample = run_program("rtpm", {"call", "lab/arm0", "read", "--registry", other->url});
  EXPECT_NE(sample.output.find("\"faults\": 8192"), std::string::npos) << sample.output;
}

TEST_F(Devices, AreNamedWhileTheyHangAndStoppedAfterwards) {
  auto hung = host("arm0", {"--events", "none"});
  const auto well = host("knob0", {"--events", "none"});
  ASSERT_TRUE(hung && well);
  hung->process.send_signal(SIGSTOP);
  const auto at_once = rtpm({"estop", "--wait", "0s"});
  EXPECT_EQ(at_once.exit_code, 1) << at_once.output;
  EXPECT_NE(at_once.output.find("1 of 2 devices are stopped"), std::string::npos);
  expect_text(at_once.errors, {"lab/arm0 is NOT stopped", "use the hardware stop"});
  EXPECT_TRUE(is_stopped("lab/knob0"));

  test::Process tool({path_of("rtpm"), "estop", "--registry", registry_->url, "--wait", "60s"});
  ASSERT_TRUE(tool.wait_for_output("lab/knob0 is stopped", kPatience)) << tool.errors();
  hung->process.send_signal(SIGCONT);
  const auto end = tool.wait(kPatience);
  ASSERT_TRUE(end);
  EXPECT_EQ(end->exit_code, 0) << end->errors;
  EXPECT_NE(end->output.find("2 of 2 devices are stopped"), std::string::npos) << end->output;
  EXPECT_TRUE(is_stopped("lab/arm0"));
}

TEST_F(Devices, AreListedAsLostAfterACrashUntilDismissed) {
  auto devices = host("arm0", {"--events", "none"});
  ASSERT_TRUE(devices);
  EXPECT_EQ(rtpm({"estop"}).exit_code, 0);
  const auto top = rtpm({"top", "--once", "--interval", "100ms"});
  EXPECT_NE(top.output.find("EMERGENCY STOP"), std::string::npos) << top.output;
  devices->process.send_signal(SIGKILL);
  ASSERT_TRUE(test::await(
      [&] { return rtpm({"list"}).output.find("LOST for") != std::string::npos; }, kPatience));
  const auto list = nlohmann::json::parse(rtpm({"list", "--json"}).output, nullptr, false);
  const auto lost = std::ranges::find_if(
      list, [](const nlohmann::json& one) { return one["name"] == "lab/arm0"; });
  ASSERT_NE(lost, list.end()) << list;
  EXPECT_EQ((*lost)["is_lost"], true);
  expect_one_sentence(rtpm({"info", "lab/arm0"}), 3, {"lab/arm0", "LOST for", "unbind"});
  EXPECT_NE(rtpm({"top", "--once", "--interval", "100ms"}).output.find("LOST for"),
            std::string::npos);
  EXPECT_EQ(rtpm({"unbind", "lab/arm0"}).exit_code, 0);
  EXPECT_EQ(rtpm({"list"}).output.find("lab/arm0"), std::string::npos);
}

}  // namespace
}  // namespace rtpm::system_test
