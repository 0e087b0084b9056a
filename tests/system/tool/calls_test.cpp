#include <gtest/gtest.h>
#include <signal.h>

#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "../../unit/recording/recorded.hpp"
#include "introspection_generated.h"
#include "programs.hpp"
#include "rtpm/test/os.hpp"

// `rtpm record --calls` beside a device server.
namespace rtpm::system_test {
namespace {

using Json = nlohmann::json;

class Calls : public WithRegistry {
 protected:
  void SetUp() override {
    WithRegistry::SetUp();
    device_ = start_server("rtpm-deviced", {"--devices", "arm0", "--serve-events"});
    ASSERT_TRUE(device_);
  }
  /// Calls until the recording has calls, calls once more, and ends it by Ctrl-C.
  [[nodiscard]] test::Process::End record_calls(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), {path_of("rtpm"), "record", file_});
    arguments.insert(arguments.end(), {"--registry", registry_->url, "--deadline", "10s"});
    test::Process process(arguments);
    EXPECT_TRUE(test::await([&] {
      EXPECT_EQ(rtpm({"call", "lab/arm0", "read"}).exit_code, 0);
      return has_calls();
    }));
    // The server may have no record to return.
    static_cast<void>(rtpm({"call", "lab/arm0", "read_flight_record", "{}"}));
    process.send_signal(SIGINT);
    const auto end = process.wait(kPatience);
    EXPECT_TRUE(end);
    return end.value_or(test::Process::End{});
  }
  /// Whether the file has calls, which are written to it each second.
  [[nodiscard]] bool has_calls() const {
    const auto reader = recording::FileReader::open(file_, recording::Incomplete::kRead);
    if (!reader) return false;
    for (const auto& [number, count] : (*reader)->statistics().message_counts) {
      if (count > 0 && (*reader)->channels().at(number).topic == "lab/arm0/calls") return true;
    }
    return false;
  }

  recording::Folder folder_{};
  std::string file_ = folder_.fresh("calls");
  std::optional<Daemon> device_{};
};

TEST_F(Calls, AreRecordedAndReadBack) {
  const auto end = record_calls({"--calls", "lab/arm0", "--json"});
  EXPECT_EQ(end.exit_code, 0) << end.errors;
  const Json said = Json::parse(end.output, nullptr, false);
  EXPECT_EQ(said["lost_before_count"], 0) << end.output;
  EXPECT_EQ(said["unreadable_payload_count"], 0) << end.output;
  const auto reader = recording::FileReader::open(file_);
  ASSERT_TRUE(reader);
  std::map<std::string, std::uint16_t> numbers;
  for (const auto& [number, channel] : (*reader)->channels())
    numbers[channel.topic] = number;
  const auto of = [&](const std::string& topic) {
    return recording::read_all(**reader, {.channel_ids = {numbers.at(topic)}});
  };
  const auto requests = of("lab/arm0/read/request");
  const auto responses = of("lab/arm0/read/response");
  const auto calls = of("lab/arm0/calls");
  ASSERT_GE(requests.size(), 1U);
  ASSERT_EQ(responses.size(), requests.size());
  ASSERT_EQ(calls.size(), requests.size() + 1) << "the flight record's, too";
  EXPECT_EQ(said["call_count"], calls.size()) << end.output;
  for (std::size_t i = 0; i < requests.size(); ++i) {
    EXPECT_EQ(requests[i].sequence, responses[i].sequence);
    const auto* const call = flatbuffers::GetRoot<introspection::CallRecord>(calls[i].text.data());
    EXPECT_EQ(call->number(), requests[i].sequence);
    EXPECT_EQ(call->method()->str(), "read");
    EXPECT_EQ(call->status(), introspection::CallStatus::ok);
    EXPECT_GT(call->duration_ns(), 0);
    EXPECT_GT(call->reply_size(), 0U);
  }
  const recording::Channel& channel = (*reader)->channels().at(numbers["lab/arm0/read/response"]);
  EXPECT_EQ((*reader)->schemas().at(channel.schema_id).name, "rtpm.device.ReadReply");
  EXPECT_EQ(channel.metadata.at("rtpm.kind"), "call");
  EXPECT_EQ(channel.metadata.at("rtpm.method_id"), "2");
  EXPECT_EQ(channel.metadata.at("rtpm.object"), "lab/arm0");
  const Json info = Json::parse(rtpm({"bag", "info", file_, "--json"}).output, nullptr, false);
  EXPECT_EQ(info["message_count"], said["message_count"]);
}

TEST_F(Calls, AreRecordedWithEvents) {
  const auto end = record_calls({"--calls", "lab/arm0", "--hub", "rtpm/events"});
  EXPECT_EQ(end.exit_code, 0) << end.errors;
  EXPECT_NE(end.output.find(" calls, "), std::string::npos) << end.output;
  const auto info = rtpm({"bag", "info", file_});
  expect_text(info.output, {"lab/arm0/read/request", "lab/arm0/sampled"});
}

TEST_F(Calls, AreNotRecordedForAnUnknownObject) {
  expect_one_sentence(rtpm({"record", file_, "--calls", "lab/arm1"}), 3,
                      {"'lab/arm1'", "most like it: lab/arm0"});
  const std::string server = device_->url.substr(0, device_->url.find("/lab/"));
  expect_one_sentence(rtpm({"record", file_, "--calls", server + "/lab/arm1"}), 3,
                      {"lab/arm1", "lab/arm0"});
  EXPECT_FALSE(std::filesystem::exists(file_));
}

TEST_F(Calls, AreRecordedByOneRecorderAtATimeUntilTheirServerEnds) {
  test::Process process(
      {path_of("rtpm"), "record", file_, "--calls", "lab/arm0", "--registry", registry_->url});
  EXPECT_TRUE(test::await([&] {
    EXPECT_EQ(rtpm({"call", "lab/arm0", "read"}).exit_code, 0);
    return has_calls();
  }));
  const auto second = rtpm({"record", folder_.fresh("second"), "--calls", "lab/arm0"});
  expect_one_sentence(second, 1, {"tapped already", "end that tap"});
  device_.reset();
  const auto end = process.wait(kPatience);
  ASSERT_TRUE(end);
  EXPECT_EQ(end->exit_code, 1);
  EXPECT_NE(end->errors.find("the tap ended"), std::string::npos) << end->errors;
  EXPECT_TRUE(recording::FileReader::open(file_)) << "it is whole";
}

}  // namespace
}  // namespace rtpm::system_test
