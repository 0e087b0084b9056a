#include <gtest/gtest.h>
#include <signal.h>

#include <algorithm>
#include <cstring>
#include <device.rtpm.hpp>
#include <device_events.rtpm.events.hpp>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include "../../unit/recording/recorded.hpp"
#include "programs.hpp"
#include "rtpm/gvd/device_event.hpp"
#include "rtpm/names/resolver.hpp"
#include "rtpm/rpc/node.hpp"
#include "rtpm/rpc/tables.hpp"
#include "rtpm/test/os.hpp"

// Devices recorded by `rtpm record` and served again by `rtpm play`.
namespace rtpm::system_test {
namespace {

using Json = nlohmann::json;

class Play : public WithRegistry {
 protected:
  /// An arm in a simulated hand and a gaze tracker.
  void start_devices() {
    devices_ = start_server("rtpm-deviced", {"--devices", "arm0,gaze0", "--serve-events"});
    ASSERT_TRUE(devices_);
  }
  /// Ends the device server, so that its names are free.
  void end_devices() {
    devices_->process.send_signal(SIGTERM);
    ASSERT_TRUE(devices_->process.wait(kPatience));
    devices_.reset();
  }
  void record(const std::string& duration) {
    start_devices();
    const auto end = rtpm({"record", file_, "--for", duration});
    ASSERT_EQ(end.exit_code, 0) << end.errors;
    end_devices();
  }
  /// Plays until it is ended. If that fails, the test fails, and so must its caller.
  [[nodiscard]] std::optional<Daemon> start_play(std::vector<std::string> arguments) const {
    arguments.insert(arguments.begin(), {"play", file_});
    arguments.insert(arguments.end(), {"--registry", registry_->url});
    return start_daemon("rtpm", arguments);
  }
  static test::Process::End end(Daemon& daemon) {
    daemon.process.send_signal(SIGINT);
    const auto end = daemon.process.wait(kPatience);
    EXPECT_TRUE(end);
    return end ? *end : test::Process::End{};
  }
  /// The messages of a topic, in order.
  static std::vector<recording::Read> messages_of(const std::string& file,
                                                  const std::string& topic) {
    const auto reader = recording::FileReader::open(file);
    EXPECT_TRUE(reader) << reader.error().text();
    if (!reader) return {};
    for (const auto& [number, channel] : (*reader)->channels()) {
      if (channel.topic == topic) {
        return recording::read_all(**reader, {.channel_ids = {number}});
      }
    }
    ADD_FAILURE() << file << " has no topic " << topic;
    return {};
  }
  /// The sample in a recorded message, by FlatBuffers.
  static std::string sample_in(const recording::Read& message) {
    const auto* const table = flatbuffers::GetRoot<device::Sampled>(message.text.data());
    return recording::text_of(rpc::struct_bytes(*table->sample()));
  }

  std::optional<Daemon> devices_{};
  recording::Folder folder_;
  std::string file_ = folder_.fresh("run");
};

TEST_F(Play, ShowsTheRecordedSamplesBitByBit) {
  record("500ms");
  const auto messages = messages_of(file_, "lab/arm0/sampled");
  ASSERT_GT(messages.size(), 100u);
  auto play = start_play({"--step", "--devices", "lab/arm0", "--hub", "none"});
  ASSERT_TRUE(play);
  rpc::Node node{{.default_deadline = kPatience}};
  auto arm = device::DeviceClient::bind(node, play->url);
  ASSERT_TRUE(arm) << arm.error().text();
  for (std::size_t i = 0; i < messages.size(); ++i) {
    const auto sample = arm->read({}, {.deadline = kPatience});
    ASSERT_TRUE(sample);
    ASSERT_EQ(recording::text_of(rpc::struct_bytes(*sample)), sample_in(messages[i])) << i;
  }
  const auto described = arm->describe();
  ASSERT_TRUE(described);
  EXPECT_EQ((*described)->serial()->str(),
            flatbuffers::GetRoot<device::Description>(
                messages_of(file_, "lab/arm0/description").at(0).text.data())
                ->serial()
                ->str());
  const auto ended = play->process.wait(kPatience);
  ASSERT_TRUE(ended) << "in steps it ends behind the last sample";
  EXPECT_EQ(ended->exit_code, 0) << ended->errors;
}

/// The forces that a servo commanded, by the sample's sequence number, as bytes.
using Forces = std::map<std::uint32_t, std::string>;

TEST_F(Play, LetsAServoCommandTheSameForcesAgain) {
  record("1s");
  const std::size_t sample_count = messages_of(file_, "lab/arm0/sampled").size();
  ASSERT_GT(sample_count, 500u);
  std::vector<Forces> runs;
  for (const std::string name : {"a", "b"}) {
    const std::string output = folder_.fresh(name);
    auto play =
        start_play({"--step", "--devices", "lab/arm0", "--hub", "none", "--output", output});
    ASSERT_TRUE(play);
    const auto servo =
        run_program("rtpm-servo", {"--registry", registry_->url, "--realtime", "off", "--live",
                                   "off", "--seconds", "60", "--deadline", "1s", "--cycles",
                                   std::to_string(sample_count - 1)});
    ASSERT_EQ(servo.exit_code, 0) << servo.errors;
    const auto ended = play->process.wait(kPatience);
    ASSERT_TRUE(ended);
    ASSERT_EQ(ended->exit_code, 0) << ended->errors;
    Forces forces;
    for (const recording::Read& message : messages_of(output, "lab/arm0/command")) {
      const auto* const request = flatbuffers::GetRoot<device::CommandRequest>(message.text.data());
      forces[message.sequence] = recording::text_of(rpc::struct_bytes(*request->command()));
    }
    runs.push_back(std::move(forces));
  }
  // The first sample is read before the loop; each other one is answered by one command.
  EXPECT_EQ(runs[0].size(), sample_count - 1);
  EXPECT_EQ(runs[0], runs[1]);
  std::set<std::string> different;
  for (const auto& [sequence, force] : runs[0])
    different.insert(force);
  EXPECT_GT(different.size(), sample_count / 2) << "the hand has pressed into the wall";
}

TEST_F(Play, PlaysToTheEndAndPrintsASummary) {
  record("300ms");
  const auto text = rtpm({"play", file_, "--speed", "10", "--hub", "none"});
  EXPECT_EQ(text.exit_code, 0) << text.errors;
  expect_text(text.output, {"serving lab/arm0 at rtpm://", " reads, 0 commands, 0 events"});
  const auto json = rtpm({"play", file_, "--speed", "10", "--json", "--folder", "again"});
  EXPECT_EQ(json.exit_code, 0) << json.errors;
  const Json told = Json::parse(json.output, nullptr, false);
  ASSERT_EQ(told["devices"].size(), 2u) << json.output;
  EXPECT_EQ(told["devices"][0]["name"], "again/lab/arm0");
  EXPECT_GT(told["length_s"], 0.1);
  EXPECT_EQ(told["at_s"], told["length_s"]);
}

TEST_F(Play, ServesTheNamesUntilCtrlC) {
  record("300ms");
  auto play = start_play({"--hold", "--hub", "none"});
  ASSERT_TRUE(play);
  const Json names = Json::parse(rtpm({"list", "--json"}).output, nullptr, false);
  ASSERT_EQ(names.size(), 2u);
  EXPECT_EQ(names[0]["name"], "lab/arm0");
  EXPECT_EQ(names[0]["interface"], "rtpm.device.Device");
  const auto echo = rtpm({"echo", "lab/arm0", "--count", "1", "--json"});
  EXPECT_EQ(Json::parse(echo.output, nullptr, false)["sample"]["lifecycle"], 2) << echo.errors;
  const auto ended = end(*play);
  EXPECT_EQ(ended.exit_code, 0) << ended.errors;
  EXPECT_TRUE(Json::parse(rtpm({"list", "--json"}).output, nullptr, false).empty());
}

TEST_F(Play, PushesTheEventsToAHub) {
  record("300ms");
  const auto hub = start_server("rtpm-eventd");
  ASSERT_TRUE(hub);
  auto play = start_play({"--loop"});
  ASSERT_TRUE(play);
  const std::string source = std::to_string(gvd::source_of("lab/gaze0"));
  const auto echo = rtpm({"echo", "--json", "--count", "20", "--filter",
                          "type(rtpm.device.Sampled) and source(" + source + ")"});
  EXPECT_EQ(echo.exit_code, 0) << echo.errors;
  std::istringstream lines(echo.output);
  std::size_t count = 0;
  for (std::string line; std::getline(lines, line); ++count) {
    const Json event = Json::parse(line, nullptr, false);
    EXPECT_EQ(event["priority"], 12000);
    EXPECT_GT(event["payload"]["sequence"], 0) << line;
  }
  EXPECT_EQ(count, 20u);
  EXPECT_EQ(end(*play).exit_code, 0);
}

TEST_F(Play, RefusesUnplayableRecordings) {
  expect_one_sentence(rtpm({"play", folder_.fresh("none")}), 1, {"none.mcap", "No such file"});
  expect_one_sentence(rtpm({"play", file_, "--speed", "0"}), 2, {"--speed"});
  expect_one_sentence(rtpm({"play", file_, "--speed", "2", "--step"}), 2, {"--step"});
  record("300ms");
  expect_one_sentence(rtpm({"play", file_, "--devices", "lab/arm"}), 1,
                      {"no device 'lab/arm'", "did you mean 'lab/arm0'?"});
  expect_one_sentence(rtpm({"play", file_, "--topics", "lab/arm0/samples"}), 1,
                      {"did you mean 'lab/arm0/sampled'?"});
  expect_one_sentence(rtpm({"play", file_, "--from", "2s", "--to", "1s"}), 2, {"--to is before"});
  const std::string content = recording::content_of(file_);
  const std::string cut = folder_.fresh("cut");
  recording::put_content(cut, std::string_view(content).substr(0, content.size() / 2));
  expect_one_sentence(rtpm({"play", cut}), 1, {"rtpm bag recover"});
}

TEST_F(Play, RefusesANameThatIsBoundAndAMissingRegistry) {
  record("300ms");
  start_devices();
  const std::string output = folder_.fresh("commands");
  expect_one_sentence(
      rtpm({"play", file_, "--devices", "lab/arm0", "--hub", "none", "--output", output}), 1,
      {"lab/arm0", devices_->url.substr(0, devices_->url.rfind("/lab"))});
  EXPECT_FALSE(std::filesystem::exists(output));
  expect_one_sentence(run_program("rtpm", {"play", file_, "--hub", "none", "--registry",
                                           "rtpm://127.0.0.1:1/rtpm/names"}),
                      3, {"no registry answers"});
}

/// On one host no registry is needed: the player serves its names itself.
TEST_F(Play, ServesItsNamesItselfWhereNoRegistryRuns) {
  record("300ms");
  registry_->process.send_signal(SIGTERM);
  ASSERT_TRUE(registry_->process.wait(kPatience));
  auto play = start_daemon("rtpm", {"play", file_, "--hub", "none", "--hold"});
  ASSERT_TRUE(play);
  EXPECT_EQ(run_program("rtpm", {"call", "lab/arm0", "read"}).exit_code, 0);
  EXPECT_EQ(end(*play).exit_code, 0);
}

TEST_F(Play, RecordsADeviceByPolling) {
  start_devices();
  const std::string polled = folder_.fresh("polled");
  const auto text = rtpm({"record", polled, "--devices", "lab/gaze0", "--poll-rate", "200", "--for",
                          "300ms", "--filter", "type(rtpm.device.ButtonChanged)"});
  EXPECT_EQ(text.exit_code, 0) << text.errors;
  EXPECT_NE(text.output.find(" messages, "), std::string::npos) << text.output;
  const auto messages = messages_of(polled, "lab/gaze0/sampled");
  ASSERT_GT(messages.size(), 5u);
  for (std::size_t i = 1; i < messages.size(); ++i)
    EXPECT_GT(messages[i].sequence, messages[i - 1].sequence);
  EXPECT_EQ(messages_of(polled, "lab/gaze0/description").size(), 1u);
  const auto json =
      rtpm({"record", folder_.fresh("json"), "--devices", "lab/gaze0", "--for", "200ms", "--json"});
  EXPECT_GT(Json::parse(json.output, nullptr, false)["message_count"], 3) << json.errors;
  end_devices();
  file_ = polled;
  auto play = start_play({"--hold"});
  ASSERT_TRUE(play);
  const auto echo = rtpm({"echo", "lab/gaze0", "--count", "1"});
  EXPECT_EQ(echo.exit_code, 0) << echo.errors;
  EXPECT_EQ(end(*play).exit_code, 0);
}

TEST_F(Play, RecordsADeviceWhereThereIsNoHub) {
  const auto alone = start_server("rtpm-deviced", {"--devices", "knob0", "--events", "none"});
  ASSERT_TRUE(alone);
  const auto end = rtpm({"record", file_, "--devices", "lab/knob0", "--for", "200ms"});
  EXPECT_EQ(end.exit_code, 0) << end.errors;
  EXPECT_GT(messages_of(file_, "lab/knob0/sampled").size(), 3u);
  const std::string none = folder_.fresh("none");
  expect_one_sentence(rtpm({"record", none, "--devices", "lab/knob"}), 3, {"lab/knob"});
  EXPECT_FALSE(std::filesystem::exists(none));
  expect_one_sentence(rtpm({"record", none, "--poll-rate", "0"}), 2, {"--poll-rate"});
}

TEST_F(Play, EchoesTheSamplesOfADevice) {
  start_devices();
  const auto text = rtpm({"echo", "lab/arm0", "--count", "3", "--rate", "200"});
  EXPECT_EQ(text.exit_code, 0) << text.errors;
  EXPECT_EQ(test::line_count(text.output), 3);
  expect_text(text.output, {"  lab/arm0  #", "\"position_m\":{\"x\":"});
  const auto json = rtpm({"echo", "lab/arm0", "--count", "2", "--json"});
  const Json first = Json::parse(json.output.substr(0, json.output.find('\n')), nullptr, false);
  EXPECT_EQ(first["device"], "lab/arm0") << json.errors;
  EXPECT_EQ(first["sequence"], first["sample"]["sequence"]);
  expect_one_sentence(rtpm({"echo", "lab/arm1"}), 3, {"lab/arm1"});
  expect_one_sentence(rtpm({"echo", "lab/arm0", "--filter", "all"}), 2, {"--filter"});
}

}  // namespace
}  // namespace rtpm::system_test
