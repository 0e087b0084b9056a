#include <gtest/gtest.h>
#include <signal.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include "../../unit/recording/recorded.hpp"
#include "programs.hpp"
#include "rtpm/test/os.hpp"

// `rtpm echo` and `rtpm hz` beside a device server that publishes its samples at its own hub.
namespace rtpm::system_test {
namespace {

using Json = nlohmann::json;

class Events : public WithRegistry {
 protected:
  void SetUp() override {
    WithRegistry::SetUp();
    device_ = start_server("rtpm-deviced", {"--devices", "arm0,gaze0", "--serve-events"});
    ASSERT_TRUE(device_);
  }
  [[nodiscard]] static std::vector<Json> documents(const std::string& text) {
    std::vector<Json> list;
    std::istringstream lines(text);
    for (std::string line; std::getline(lines, line);)
      list.push_back(Json::parse(line, nullptr, false));
    return list;
  }

  std::optional<Daemon> device_{};
};

constexpr const char* kSampled = "type(rtpm.device.Sampled)";

TEST_F(Events, AreEchoedWithTheirNumbersByName) {
  const auto end = rtpm({"echo", "--filter", kSampled, "--count", "5"});
  EXPECT_EQ(end.exit_code, 0) << end.errors;
  EXPECT_EQ(test::line_count(end.output), 5) << end.output;
  EXPECT_NE(end.output.find("  rtpm.device.Sampled  lab/"), std::string::npos) << end.output;
  EXPECT_EQ(end.output.find("source "), std::string::npos) << "a number tells nobody the device";
  EXPECT_NE(end.output.find("\"position_m\":{\"x\":"), std::string::npos) << end.output;
}

TEST_F(Events, AreEchoedInJsonInTheirOrder) {
  const auto first = rtpm({"echo", "--json", "--filter", kSampled, "--count", "1"});
  const std::string source = documents(first.output).at(0)["source"].dump();
  const auto end = rtpm({"echo", "--json", "--filter",
                         std::string(kSampled) + " and source(" + source + ")", "--count", "20"});
  const auto events = documents(end.output);
  ASSERT_EQ(events.size(), 20u) << end.errors;
  for (std::size_t i = 0; i < events.size(); ++i) {
    EXPECT_EQ(events[i]["type"], "rtpm.device.Sampled");
    EXPECT_TRUE(events[i].value("source_name", "").starts_with("lab/")) << events[i];
    EXPECT_EQ(events[i]["sequence"], events[0]["sequence"].get<std::uint64_t>() + i);
    EXPECT_EQ(events[i]["payload"]["position_m"]["x"].is_number(), true);
    EXPECT_LE(events[i]["origin_ns"], events[i]["hub_sent_ns"]);
  }
}

TEST_F(Events, AreThinnedOutAndFilteredByTheirNumbers) {
  const auto end = rtpm({"echo", "--json", "--every", "10", "--count", "5", "--filter",
                         std::string(kSampled) + " and lifecycle == 2 and not sequence < 5"});
  const auto events = documents(end.output);
  ASSERT_EQ(events.size(), 5u) << end.errors;
  const auto none =
      rtpm({"echo", "--for", "100ms", "--filter", std::string(kSampled) + " and sequence < 1"});
  EXPECT_EQ(none.exit_code, 0) << none.errors;
  EXPECT_EQ(none.output, "");
}

TEST_F(Events, PointAtTheWrongCharacterOfAFilter) {
  const auto end = rtpm({"echo", "--filter", "type(rtpm.device.Sampeld)"});
  EXPECT_EQ(end.exit_code, 2);
  EXPECT_EQ(end.errors,
            "rtpm: type(rtpm.device.Sampeld)\n"
            "rtpm:      ^ no type is named 'rtpm.device.Sampeld' (did you mean "
            "'rtpm.device.Sampled'?)\n");
  const auto json = rtpm({"hz", "--json", "--filter", "source(x)"});
  EXPECT_EQ(json.exit_code, 2);
  const Json error = Json::parse(json.errors, nullptr, false)["error"];
  EXPECT_NE(error["what"].get<std::string>().find("at character 7"), std::string::npos);
}

TEST_F(Events, FailWithoutAHub) {
  expect_one_sentence(rtpm({"echo", "--hub", "lab/evnets"}), 3, {"lab/evnets"});
  expect_one_sentence(rtpm({"hz", "--hub", "rtpm://127.0.0.1:1/rtpm/events"}), 3, {"no server"});
}

TEST_F(Events, AreMeasuredPerSource) {
  const auto end = rtpm({"hz", "--json", "--filter", kSampled, "--for", "500ms"});
  EXPECT_EQ(end.exit_code, 0) << end.errors;
  const Json streams = Json::parse(end.output, nullptr, false)["streams"];
  ASSERT_EQ(streams.size(), 2u) << end.output;
  std::vector<double> rates;
  for (const Json& stream : streams) {
    EXPECT_EQ(stream["lost_count"], 0);
    EXPECT_GT(stream["count"], 10);
    EXPECT_GT(stream["jitter"]["mean_us"], 0.0);
    EXPECT_LE(stream["latency_us"]["p50"], stream["latency_us"]["max"]);
    rates.push_back(stream["rate_hz"]);
  }
  EXPECT_GT(std::ranges::max(rates), 2 * std::ranges::min(rates));
  const auto text = rtpm({"hz", "--filter", kSampled, "--for", "200ms"});
  expect_text(text.output, {"JITTER RMS", "rtpm.device.Sampled  lab/"});
}

TEST_F(Events, AreReportedAsAbsent) {
  const auto end = rtpm({"hz", "--filter", "source(1)", "--for", "100ms"});
  EXPECT_EQ(end.exit_code, 1);
  EXPECT_EQ(end.output, "no events came\n");
}

TEST_F(Events, ArePushedAsJsonAndEchoedAsPushed) {
  test::Process echo({path_of("rtpm"), "echo", "--json", "--count", "3", "--filter", "source(77)",
                      "--registry", registry_->url});
  const std::vector<std::string> pub{"pub", "rtpm.device.ButtonChanged",
                                     "{cycle: 9, button: 2, is_pressed: true}", "--source", "77"};
  ASSERT_TRUE(test::await([&] {
    EXPECT_EQ(rtpm(pub).exit_code, 0);
    return echo.wait_for_output("\"sequence\"", std::chrono::milliseconds{10});
  })) << "the subscription never exists";
  std::vector<std::string> several = pub;
  several.insert(several.end(), {"--rate", "500", "--count", "3", "--json"});
  const auto pushed = rtpm(several);
  EXPECT_EQ(Json::parse(pushed.output, nullptr, false)["count"], 3) << pushed.errors;
  const auto end = echo.wait(kPatience);
  ASSERT_TRUE(end);
  const auto events = documents(end->output);
  ASSERT_EQ(events.size(), 3u);
  EXPECT_EQ(events[2]["payload"]["button"], 2) << end->output;
  EXPECT_EQ(events[2]["payload"]["is_pressed"], true) << end->output;
}

TEST_F(Events, AreNotPushedWithAnUnknownTypeOrField) {
  expect_one_sentence(rtpm({"pub", "rtpm.device.ButtonChangd", "{}"}), 1,
                      {"knows no type", "'rtpm.device.ButtonChanged'"});
  expect_one_sentence(rtpm({"pub", "rtpm.device.ButtonChanged", "{cycle: 9, buton: 2}"}), 1,
                      {"does not fit the schema", "buton", "1:"});
  expect_one_sentence(rtpm({"pub", "rtpm.device.ButtonChanged", "{}", "--rate", "-1"}), 2,
                      {"--rate"});
}

TEST_F(Events, AreRecordedWithTheirSchemas) {
  const recording::Folder folder;
  const std::string file = folder.fresh("run");
  const auto end = rtpm({"record", file, "--for", "500ms", "--filter", kSampled, "--json"});
  ASSERT_EQ(end.exit_code, 0) << end.errors;
  const Json told = Json::parse(end.output, nullptr, false);
  EXPECT_EQ(told["drop_count"], 0) << told;
  EXPECT_GT(told["message_count"], 50);
  const auto reader = recording::FileReader::open(file);
  ASSERT_TRUE(reader) << reader.error().text();
  EXPECT_EQ((*reader)->statistics().message_count, told["message_count"]);
  const auto& schemas = (*reader)->schemas();
  EXPECT_TRUE(std::ranges::all_of(
      schemas, [](const auto& schema) { return schema.second.encoding == "flatbuffer"; }));
  std::set<std::string> topics;
  for (const auto& [number, channel] : (*reader)->channels()) {
    topics.insert(channel.topic + " " + schemas.at(channel.schema_id).name);
    EXPECT_EQ(channel.message_encoding, "flatbuffer");
    if (channel.metadata.at("rtpm.kind") == "view") continue;  // Has some of the samples.
    const auto messages = recording::read_all(**reader, {.channel_ids = {number}});
    for (std::size_t i = 1; i < messages.size(); ++i)
      ASSERT_EQ(messages[i].sequence, messages[0].sequence + i) << channel.topic;
  }
  EXPECT_EQ(
      topics,
      (std::set<std::string>{
          "lab/arm0/description rtpm.device.Description", "lab/arm0/force foxglove.SceneUpdate",
          "lab/arm0/parameters rtpm.configuration.ListReply", "lab/arm0/pose foxglove.PoseInFrame",
          "lab/arm0/sampled rtpm.device.Sampled",
          "lab/gaze0/parameters rtpm.configuration.ListReply",
          "lab/gaze0/description rtpm.device.Description", "lab/gaze0/pose foxglove.PoseInFrame",
          "lab/gaze0/sampled rtpm.device.Sampled", "rtpm/tf foxglove.FrameTransforms"}));
}

TEST_F(Events, AreReadFromARecordingByFlatBuffersAlone) {
  const recording::Folder folder;
  const std::string file = folder.fresh("run");
  ASSERT_EQ(rtpm({"record", file, "--for", "300ms", "--filter", kSampled}).exit_code, 0);
  const auto reader = recording::FileReader::open(file);
  ASSERT_TRUE(reader) << reader.error().text();
  const auto& channels = (*reader)->channels();
  const auto sampled = std::ranges::find(channels, "lab/arm0/sampled",
                                         [](const auto& channel) { return channel.second.topic; });
  ASSERT_NE(sampled, channels.end());
  const auto messages = recording::read_all(**reader, {.channel_ids = {sampled->first}});
  ASSERT_FALSE(messages.empty());
  const auto& schema = (*reader)->schemas().at(sampled->second.schema_id).data;
  const std::string base = file.substr(0, file.rfind('/'));
  recording::put_content(base + "/sampled.bfbs", recording::text_of(schema));
  recording::put_content(base + "/message.bin", messages.front().text);
  const auto end = test::run({"flatc", "--json", "--strict-json", "--raw-binary", "-o", base,
                              base + "/sampled.bfbs", "--", base + "/message.bin"},
                             kPatience);
  ASSERT_TRUE(end);
  ASSERT_EQ(end->exit_code, 0) << end->output << end->errors;
  const Json json = Json::parse(recording::content_of(base + "/message.json"), nullptr, false);
  EXPECT_EQ(json["sample"]["sequence"], messages.front().sequence) << json;
  EXPECT_EQ(json["sample"]["position_m"].size(), 3u) << json;
}

/// Ctrl-C, SIGTERM, and a terminal or session that closes.
TEST_F(Events, AreKeptInARecordingThatASignalEnds) {
  const recording::Folder folder;
  for (const int signal : {SIGINT, SIGTERM, SIGHUP, SIGQUIT}) {
    const std::string file = folder.fresh("run" + std::to_string(signal));
    test::Process record({path_of("rtpm"), "record", file, "--registry", registry_->url});
    ASSERT_TRUE(test::await([&] {
      return std::filesystem::exists(file) && std::filesystem::file_size(file) > 1000;
    })) << record.errors();
    record.send_signal(signal);
    const auto end = record.wait(kPatience);
    ASSERT_TRUE(end);
    EXPECT_EQ(end->exit_code, 0) << signal << end->errors;
    EXPECT_NE(end->output.find(" messages, "), std::string::npos) << end->output;
    EXPECT_EQ(rtpm({"bag", "check", file}).output, file + " is whole\n");
    expect_one_sentence(rtpm({"record", file}), 1, {file, "exists"});
  }
}

/// The disk is full: the tool reports one sentence, and the written part stays whole.
TEST_F(Events, AreKeptInARecordingThatReachesTheFileSizeLimit) {
  const recording::Folder folder;
  const std::string file = folder.fresh("run");
  test::Process record({"sh", "-c",
                        "ulimit -f 200; exec \"$0\" record \"$1\" --compression none "
                        "--registry \"$2\"",
                        path_of("rtpm"), file, registry_->url});
  const auto end = record.wait(kPatience);
  ASSERT_TRUE(end);
  expect_one_sentence(*end, 1, {file, "File too large", "make room"});
  const auto reader = recording::FileReader::open(file, recording::Incomplete::kRead);
  EXPECT_TRUE(reader) << reader.error().text();
}

/// A new hub does not know the types or names of a program whose events it forwards.
TEST_F(Events, AreRecordedFromProgramsThatStartLater) {
  const recording::Folder folder;
  const std::string file = folder.fresh("run");
  const auto hub = start_server("rtpm-eventd", {"--name", "lab/hub"});
  ASSERT_TRUE(hub);
  test::Process record(
      {path_of("rtpm"), "record", file, "--hub", "lab/hub", "--registry", registry_->url});
  ASSERT_TRUE(test::await([&] { return std::filesystem::exists(file); }));
  const auto late = start_server("rtpm-deviced", {"--devices", "knob0", "--events", "lab/hub"});
  ASSERT_TRUE(late);
  ASSERT_TRUE(test::await([&] { return std::filesystem::file_size(file) > 20'000; }))
      << record.errors();
  record.send_signal(SIGINT);
  const auto end = record.wait(kPatience);
  ASSERT_TRUE(end);
  EXPECT_EQ(end->exit_code, 0) << end->errors;
  const auto reader = recording::FileReader::open(file);
  ASSERT_TRUE(reader) << reader.error().text();
  for (const auto& [number, channel] : (*reader)->channels()) {
    EXPECT_TRUE(channel.topic.starts_with("lab/knob0/")) << channel.topic;
    EXPECT_EQ(channel.message_encoding, "flatbuffer") << channel.topic;
  }
}

TEST_F(Events, LeaveNoFileIfTheyCannotBeRecorded) {
  const recording::Folder folder;
  const std::string file = folder.fresh("run");
  expect_one_sentence(rtpm({"record", file, "--hub", "lab/none"}), 3, {"lab/none"});
  EXPECT_EQ(rtpm({"record", file, "--filter", "souce(1)"}).exit_code, 2);
  EXPECT_FALSE(std::filesystem::exists(file));
}

}  // namespace
}  // namespace rtpm::system_test
