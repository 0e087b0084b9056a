#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "../../unit/recording/recorded.hpp"
#include "programs.hpp"
#include "rtpm/recording/notes.hpp"

// `rtpm bag` on recordings, whole and broken.
namespace rtpm::system_test {
namespace {

using Json = nlohmann::json;

class Bag : public testing::Test {
 protected:
  void SetUp() override {
    auto writer = recording::FileWriter::create(file_, {.chunk_byte_max = 400});
    ASSERT_TRUE(writer);
    recording::write_messages(**writer, 100);
    ASSERT_TRUE((*writer)->write(recording::Metadata{.name = "lab", .values = {{"who", "Ada"}}}));
    ASSERT_TRUE((*writer)->close());
  }
  [[nodiscard]] static test::Process::End bag(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), "bag");
    return run_program("rtpm", arguments);
  }
  [[nodiscard]] static Json json_of(std::vector<std::string> arguments, int exit_code = 0) {
    arguments.emplace_back("--json");
    const auto end = bag(arguments);
    EXPECT_EQ(end.exit_code, exit_code) << end.errors;
    return Json::parse(end.output, nullptr, false);
  }
  /// The recording without its last third.
  [[nodiscard]] std::string truncated() const {
    const std::string content = recording::content_of(file_);
    std::string path = folder_.fresh("truncated");
    recording::put_content(path, std::string_view(content).substr(0, content.size() / 3));
    return path;
  }

  recording::Folder folder_;
  std::string file_ = folder_.fresh("whole");
};

TEST_F(Bag, InfoShowsTopicsCountsAndRates) {
  const std::string text = bag({"info", file_}).output;
  expect_text(text, {"100 messages in ", "TOPIC ", "lab/touched  lab.Touched  flatbuffer",
                     " from 1970-01-01T00:00:00.001Z", "lab\n  who = Ada"});
  const Json json = json_of({"info", file_});
  EXPECT_EQ(json["message_count"], 100);
  EXPECT_EQ(json["is_complete"], true);
  ASSERT_EQ(json["channels"].size(), 2u);
  EXPECT_EQ(json["channels"][0]["topic"], "lab/touched");
  EXPECT_EQ(json["channels"][0]["message_count"], 50);
  EXPECT_NEAR(json["channels"][0]["rate_hz"].get<double>(), 50 / 0.099, 0.1);
  EXPECT_EQ(json["metadata"][0]["values"]["who"], "Ada");
  EXPECT_TRUE(json["notes"].empty());
}

TEST_F(Bag, InfoShowsTheNotesOfAReview) {
  const recording::Note note{.time_ns = 51'000'000, .text = "slipped\x1b[2J", .made_ns = 7};
  ASSERT_TRUE(recording::write_notes(file_, {note}));
  expect_text(bag({"info", file_}).output, {"NOTE AT", "0.050 s  slipped\\x1b[2J"});
  const Json notes = json_of({"info", file_})["notes"];
  ASSERT_EQ(notes.size(), 1u);
  EXPECT_EQ(notes[0]["time_ns"], 51'000'000);
  EXPECT_EQ(notes[0]["text"], note.text);
  recording::put_content(recording::notes_path(file_), "[]");
  expect_text(bag({"info", file_}).output, {"notes.json' can't be read"});
  EXPECT_FALSE(json_of({"info", file_})["notes_problem"].empty());
}

TEST_F(Bag, CheckReportsFaults) {
  EXPECT_EQ(bag({"check", file_}).output, file_ + " is whole\n");
  EXPECT_TRUE(json_of({"check", file_})["problems"].empty());
  const auto end = bag({"check", truncated()});
  EXPECT_EQ(end.exit_code, 1);
  EXPECT_NE(end.output.find("it was not ended"), std::string::npos) << end.output;
  EXPECT_FALSE(json_of({"check", truncated()}, 1)["problems"].empty());
}

TEST_F(Bag, RecoverSavesWhatIsWhole) {
  const std::string broken = truncated();
  EXPECT_NE(bag({"info", broken}).output.find("rtpm bag recover"), std::string::npos);
  const std::string saved = folder_.fresh("saved");
  const Json json = json_of({"recover", broken, "-o", saved});
  EXPECT_GT(json["message_count"], 10);
  EXPECT_LT(json["message_count"], 100);
  EXPECT_TRUE(json_of({"check", saved})["problems"].empty());
  expect_one_sentence(bag({"recover", broken, "-o", saved}), 1, {"exists already", "Remedy"});
  expect_one_sentence(bag({"recover", broken}), 2, {"--output is required"});
}

/// The chunk with the channels is damaged; the summary has them, too.
TEST_F(Bag, RecoverKeepsTheChannelsAndReportsLosses) {
  std::string content = recording::content_of(file_);
  const std::string head("\x06", 1);
  const std::size_t chunk = 8 + 9 + static_cast<unsigned char>(content[9]);
  ASSERT_EQ(content.substr(chunk, 1), head);
  content[chunk + 70] ^= 1;  // This byte is in its compressed records.
  const std::string damaged = folder_.fresh("damaged");
  recording::put_content(damaged, content);
  const std::string saved = folder_.fresh("saved");
  const Json json = json_of({"recover", damaged, "-o", saved});
  EXPECT_EQ(json["damaged_chunk_count"], 1);
  int lost = 0;
  for (const Json& count : json["lost_counts"])
    lost += count.get<int>();
  EXPECT_GT(lost, 0);
  EXPECT_EQ(json["message_count"].get<int>() + lost, 100) << json;
  const Json info = json_of({"info", saved});
  EXPECT_EQ(info["channels"][0]["type"], "lab.Touched") << info;
  EXPECT_NE(bag({"check", saved}).output.find("was recovered"), std::string::npos);
  const std::string text = bag({"recover", damaged, "-o", folder_.fresh("again")}).output;
  EXPECT_NE(text.find("lab/touched: "), std::string::npos) << text;
}

TEST_F(Bag, CutSelectsATimeAndTopics) {
  const std::string part = folder_.fresh("part");
  const Json json =
      json_of({"cut", file_, "--from", "10ms", "--to", "29ms", "--topics", "log", "-o", part});
  EXPECT_EQ(json["message_count"], 10);
  const Json info = json_of({"info", part});
  ASSERT_EQ(info["channels"].size(), 1u);
  EXPECT_EQ(info["channels"][0]["topic"], "log");
  EXPECT_EQ(info["metadata"][0]["values"]["who"], "Ada");
  const std::string other = folder_.fresh("other");
  expect_one_sentence(bag({"cut", file_, "--topics", "lab/tuched", "-o", other}), 1,
                      {"has no topic 'lab/tuched'", "'lab/touched'"});
  expect_one_sentence(bag({"cut", file_, "--from", "2s", "--to", "1s", "-o", other}), 2,
                      {"--to is before --from"});
}

TEST_F(Bag, CutRefusesAnUnfinishedRecording) {
  expect_one_sentence(bag({"cut", truncated(), "-o", folder_.fresh("part")}), 1, {"recover"});
}

class Ping : public Laboratory {};

TEST_F(Ping, PrintsTripsClockAndSummary) {
  const auto end = run_program("rtpm", {"ping", "lab/arm0", "--count", "20", "--interval", "1ms",
                                        "--registry", registry_->url});
  EXPECT_EQ(end.exit_code, 0) << end.errors;
  EXPECT_EQ(test::line_count(end.output), 22) << end.output;
  expect_text(end.output, {"lab/arm0: 20: ", ", clock ", "20 pings, 0 lost; min "});
  const auto machine = run_program("rtpm", {"ping", "lab/arm0", "--count", "3", "--interval", "1ms",
                                            "--json", "--registry", registry_->url});
  const std::string last = machine.output.substr(machine.output.find("{\"summary\""));
  const Json summary = Json::parse(last, nullptr, false)["summary"];
  EXPECT_EQ(summary["count"], 3) << machine.output;
  EXPECT_GT(summary["time_us"]["min"], 0.0);
}

// hp-6.2 needs no introspection.
TEST_F(Ping, NeedsNothingButTheSession) {
  test::Process server({path_of("rtpm-reference-server"), "--port", "0", "--realtime", "off"});
  ASSERT_TRUE(server.wait_for_output("/lab/arm0\n", kPatience)) << server.errors();
  const std::string url = server.output().substr(0, server.output().find('\n'));
  const auto end = run_program("rtpm", {"ping", url, "--count", "2", "--interval", "1ms"});
  EXPECT_EQ(end.exit_code, 0) << end.errors;
  expect_text(end.output, {"lab/arm0: 2: ", "2 pings, 0 lost; min "});
  expect_one_sentence(run_program("rtpm", {"ping", url + "7"}), 3, {"lab/arm0"});
}

TEST_F(Ping, FailsForADeadServer) {
  expect_one_sentence(run_program("rtpm", {"ping", "rtpm://127.0.0.1:1/x"}), 3, {"no server"});
  expect_one_sentence(run_program("rtpm", {"ping", device_->url, "--interval", "1ns"}), 2,
                      {"100us to 1h"});
}

TEST_F(Bag, ExportSaysWhatItLeavesOut) {
  const std::string tables = folder_.fresh("tables");
  const auto end = bag({"export", file_, tables, "--csv"});
  EXPECT_EQ(end.exit_code, 1);
  expect_text(end.output, {tables + " has 50 messages in 1 files\n",
                           "lab/touched: 50 messages were left out: its schema can't be read"});
  const Json json = json_of({"export", file_, folder_.fresh("ros2"), "--ros2"}, 1);
  EXPECT_EQ(json["message_count"], 50);
  EXPECT_EQ(json["left_out"][0]["topic"], "lab/touched");
  EXPECT_EQ(json["left_out"][0]["message_count"], 50);
}

TEST_F(Bag, ExportRefusesBadInput) {
  const std::string other = folder_.fresh("other");
  expect_one_sentence(bag({"export", file_, other}), 2, {"--ros2, --csv, --parquet, --bids"});
  expect_one_sentence(bag({"export", file_, other, "--csv", "--ros2"}), 2, {"one of --ros2"});
  expect_one_sentence(bag({"export", truncated(), other, "--csv"}), 1, {"recover"});
  expect_one_sentence(bag({"export", file_, file_, "--ros2"}), 1, {"exists already", "Remedy"});
  expect_one_sentence(bag({"export", file_, other, "--ros2", "--rate", "100"}), 2,
                      {"--rate is not for --ros2", "topic_tools throttle"});
  expect_one_sentence(bag({"export", file_, other, "--ros2", "--columns", "x"}), 2,
                      {"not for --ros2", "rtpm bag cut --topics"});
  EXPECT_FALSE(std::filesystem::exists(other));
}

TEST_F(Bag, ExportsAPartForRos2) {
  const std::string part = folder_.fresh("ros2");
  const Json json = json_of({"export", file_, part, "--ros2", "--from", "10ms", "--to", "30ms"}, 1);
  EXPECT_EQ(json["message_count"], 10) << json;
}

}  // namespace
}  // namespace rtpm::system_test
