#include <gtest/gtest.h>
#include <sys/mount.h>

#include <algorithm>
#include <filesystem>
#include <numeric>
#include <sstream>

#include "example_recording.hpp"
#include "rtpm/exports/export.hpp"

namespace rtpm::exports {
namespace {

/// The schema of rtpm.Trial.
constexpr const char* kTrialSchema = R"(
attribute "rtpm_event";
namespace rtpm;
enum TrialPhase : ubyte { Mark = 0, Begin = 1, End = 2 }
table Trial (rtpm_event: 1380974656) {
  phase:TrialPhase;
  number:uint;
  condition:string;
  response:string;
  seed:ulong = null;
  note:string;
  duration_ns:ulong = null;
}
)";
constexpr const char* kValueSchema = R"(
attribute "rtpm_event";
attribute "rtpm_unit";
namespace lab;
table Value (rtpm_event: 78) { x:double (rtpm_unit: "m"); label:string; bytes:[ubyte]; }
)";

std::vector<std::string> lines_of(const std::string& text) {
  std::vector<std::string> lines;
  for (std::istringstream stream(text); std::getline(stream, lines.emplace_back());)
    if (lines.back().ends_with('\r')) lines.back().pop_back();
  lines.pop_back();
  return lines;
}

/// Records values and trials at chosen times.
class Tables : public testing::Test {
 protected:
  void SetUp() override {
    std::string error;
    trial_ = schema::Dynamic::make_for_event(kTrialSchema, "rtpm.Trial", error);
    ASSERT_NE(trial_, nullptr) << error;
    value_ = schema::Dynamic::make_for_event(kValueSchema, "lab.Value", error);
    ASSERT_NE(value_, nullptr) << error;
  }
  std::uint16_t values(const std::string& topic) {
    return example_.add(*value_, "lab.Value", topic, {});
  }
  std::uint16_t trials() { return example_.add(*trial_, "rtpm.Trial", "rtpm.Trial/0", {}); }

  /// A message whose origin is `seconds` after the begin, logged `late_s` later.
  void put(std::uint16_t channel, double seconds, const std::string& json, double late_s = 0) {
    schema::Dynamic& dynamic = json.find("phase") == std::string::npos ? *value_ : *trial_;
    std::string error;
    const auto bytes = dynamic.encode(dynamic.event(), json, error);
    ASSERT_TRUE(bytes) << error;
    ASSERT_TRUE(example_.writer().write({.channel_id = channel,
                                         .sequence = ++count_,
                                         .log_time_ns = ns(seconds + late_s),
                                         .publish_time_ns = ns(seconds),
                                         .data = *bytes}));
  }
  static std::uint64_t ns(double seconds) {
    return test::kBeginNs + static_cast<std::uint64_t>(seconds * 1e9 + 0.5);
  }
  expected<Report, SetupError> exported(const TableOptions& options) {
    example_.end();
    auto reader = recording::FileReader::open(file_);
    EXPECT_TRUE(reader) << reader.error().text();
    return export_csv(**reader, out_, options);
  }
  [[nodiscard]] std::vector<std::string> table(const std::string& name) const {
    std::vector<std::string> rows = lines_of(recording::content_of(out_ + "/" + name));
    // The first column is always the same as the second one.
    for (std::string& row : rows)
      row.erase(0, row.find(',') + 1);
    return rows;
  }

  recording::Folder folder_;
  std::string file_ = folder_.fresh("run");
  std::string out_ = folder_.fresh("tables");
  test::Example example_{file_};
  std::unique_ptr<schema::Dynamic> trial_{};
  std::unique_ptr<schema::Dynamic> value_{};
  std::uint32_t count_ = 0;
};

using Rows = std::vector<std::string>;

TEST_F(Tables, JoinAllTopicsOnOneClock) {
  const auto a = values("lab/a");
  const auto b = values("lab/b");
  put(a, 0, R"({"x":1,"label":"one, two"})");
  put(b, 0.5, R"({"x":-1})");
  put(a, 1, R"({"x":2})");
  put(b, 1, R"({"x":-2})");
  const auto report = exported({.is_joined = true});
  ASSERT_TRUE(report) << report.error().text();
  EXPECT_EQ(report->row_count, 3u);
  EXPECT_EQ(lines_of(recording::content_of(out_ + "/joined.csv"))[0],
            "time [UTC],seconds [s],lab/a.x [m],lab/a.label,lab/b.x [m],lab/b.label");
  EXPECT_EQ(table("joined.csv"),
            (Rows{"seconds [s],lab/a.x [m],lab/a.label,lab/b.x [m],lab/b.label",
                  "0.000000000,1,\"one, two\",,", "0.500000000,1,\"one, two\",-1,",
                  "1.000000000,2,,-2,"}));
}

TEST_F(Tables, JoinInOrderOfOriginsNotOfArrival) {
  const auto a = values("lab/a");
  const auto b = values("lab/b");
  put(a, 0, R"({"x":1})");
  put(b, 0.2, R"({"x":-1})", 0.3);
  put(a, 0.4, R"({"x":2})", 0.2);
  put(a, 3, R"({"x":3})");
  ASSERT_TRUE(exported({.columns = {"x"}, .is_joined = true}));
  EXPECT_EQ(table("joined.csv"),
            (Rows{"seconds [s],lab/a.x [m],lab/b.x [m]", "0.000000000,1,", "0.200000000,1,-1",
                  "0.400000000,2,-1", "3.000000000,3,-1"}));
}

TEST_F(Tables, CountValuesThatAreTooLateForTheirRow) {
  const auto a = values("lab/a");
  const auto b = values("lab/b");
  for (int i = 0; i <= 40; ++i)
    put(a, 0.1 * i, R"({"x":1})");
  put(b, 1, R"({"x":-1})", 3);
  const auto report = exported({.columns = {"x"}, .is_joined = true});
  ASSERT_TRUE(report) << report.error().text();
  EXPECT_EQ(report->late_count, 1u);
  const Rows rows = table("joined.csv");
  EXPECT_TRUE(std::ranges::is_sorted(rows.begin() + 1, rows.end()));
  EXPECT_TRUE(rows.back().ends_with(",1,-1")) << rows.back();
}

TEST_F(Tables, HaveRowsAtARateWithTheLastValueBefore) {
  const auto a = values("lab/a");
  put(a, 0, R"({"x":1})");
  put(a, 0.5, R"({"x":2})");
  put(a, 0.74, R"({"x":3})");
  put(a, 1, R"({"x":4})");
  ASSERT_TRUE(exported({.columns = {"x"}, .is_joined = true, .rate_hz = 4}));
  EXPECT_EQ(table("joined.csv"), (Rows{"seconds [s],lab/a.x [m]", "0.000000000,1", "0.250000000,1",
                                       "0.500000000,2", "0.750000000,3", "1.000000000,4"}));
}

TEST_F(Tables, OfEachTopicMayHaveARate) {
  const auto a = values("lab/a");
  values("lab/b");
  put(a, 0, R"({"x":1})");
  put(a, 1, R"({"x":4})");
  ASSERT_TRUE(exported({.columns = {"x"}, .rate_hz = 2}));
  EXPECT_EQ(table("lab_a.csv"),
            (Rows{"seconds [s],x [m]", "0.000000000,1", "0.500000000,1", "1.000000000,4"}));
  EXPECT_TRUE(std::filesystem::exists(out_ + "/lab_b.csv"));
}

/// Two trials with a mark in the first.
class CourseTables : public Tables {
 protected:
  void SetUp() override {
    Tables::SetUp();
    const auto a = values("lab/a");
    const auto trials = this->trials();
    put(a, 0, R"({"x":0})");
    put(trials, 1, R"({"phase":"Begin","number":1,"condition":"soft","seed":7})");
    put(a, 1.5, R"({"x":1})");
    put(trials, 1.6, R"({"phase":"Mark","number":1,"note":"=now"})");
    put(trials, 2,
        R"({"phase":"End","number":1,"condition":"soft","response":"yes","seed":7,)"
        R"("duration_ns":1000000000})");
    put(a, 2.5, R"({"x":2})");
    put(trials, 3, R"({"phase":"Begin","number":2,"condition":"hard"})");
    put(a, 3.5, R"({"x":3})");
    put(trials, 4, R"({"phase":"Mark","note":"the end"})");
  }
};

TEST_F(CourseTables, HaveTrialsAndMarksInColumns) {
  ASSERT_TRUE(exported({.columns = {"x"}, .is_joined = true}));
  EXPECT_EQ(
      table("joined.csv"),
      (Rows{"seconds [s],trial,condition,marker,lab/a.x [m]", "0.000000000,,,,0",
            "1.000000000,1,soft,,0", "1.500000000,1,soft,,1", "1.600000000,1,soft,\"'=now\",1",
            "2.000000000,,,,1", "2.500000000,,,,2", "3.000000000,2,hard,,2",
            "3.500000000,2,hard,,3", "4.000000000,2,hard,the end,3"}));
  EXPECT_EQ(table("trials.csv"),
            (Rows{"seconds [s],number,condition,response,seed,end [s],duration [s],note",
                  "1.000000000,1,soft,yes,7,2.000000000,1.000000000,", "3.000000000,2,hard,,,,,"}))
      << "the second trial has no end";
}

TEST_F(CourseTables, KeepMarksAtARate) {
  ASSERT_TRUE(exported({.columns = {"x"}, .is_joined = true, .rate_hz = 1}));
  EXPECT_EQ(table("joined.csv"),
            (Rows{"seconds [s],trial,condition,marker,lab/a.x [m]", "0.000000000,,,,0",
                  "1.000000000,1,soft,,0", "2.000000000,,,\"'=now\",1", "3.000000000,2,hard,,2",
                  "4.000000000,2,hard,the end,3"}));
}

/// A person wrote them in a review, so they are beside the recording.
TEST_F(CourseTables, HaveNotesAmongTheMarks) {
  const TableOptions options{.columns = {"x"},
                             .part = {.between = {{"=now", "slipped, left"}}},
                             .is_joined = true,
                             .notes = {{.time_ns = ns(3.2), .text = "slipped, left"},
                                       {.time_ns = ns(1.8), .text = "=2+2\nas before"},
                                       {.time_ns = ns(3.9), .text = "after the part"}}};
  ASSERT_TRUE(exported(options));
  EXPECT_EQ(
      table("joined.csv"),
      (Rows{"seconds [s],trial,condition,marker,lab/a.x [m]", "1.600000000,1,soft,\"'=now\",1",
            "1.800000000,1,soft,\"'=2+2\\nas before\",1", "2.000000000,,,,1", "2.500000000,,,,2",
            "3.000000000,2,hard,,2", "3.200000000,2,hard,\"slipped, left\",2"}));
  EXPECT_EQ(recording::content_of(out_ + "/notes.csv"),
            "time [UTC],seconds [s],note\r\n"
            "2023-11-14T22:13:21.800000000Z,1.800000000,\"'=2+2\nas before\"\r\n"
            "2023-11-14T22:13:23.200000000Z,3.200000000,\"slipped, left\"\r\n");
}

TEST_F(CourseTables, CanBeOfOneTrial) {
  ASSERT_TRUE(exported({.columns = {"x"}, .part = {.trial = 1}, .is_joined = true}));
  EXPECT_EQ(table("joined.csv"),
            (Rows{"seconds [s],trial,condition,marker,lab/a.x [m]", "1.000000000,1,soft,,0",
                  "1.500000000,1,soft,,1", "1.600000000,1,soft,\"'=now\",1", "2.000000000,,,,1"}))
      << "the value before the trial is held";
  EXPECT_EQ(table("trials.csv").size(), 2u);
}

TEST_F(CourseTables, CanBeOfACondition) {
  ASSERT_TRUE(exported({.columns = {"x"}, .part = {.condition = "hard"}}));
  EXPECT_EQ(table("lab_a.csv"), (Rows{"seconds [s],message,x [m]", "3.500000000,8,3"}));
}

TEST_F(CourseTables, CanBeBetweenMarks) {
  ASSERT_TRUE(exported({.columns = {"x"}, .part = {.between = {{"=now", "the end"}}}}));
  EXPECT_EQ(table("lab_a.csv"),
            (Rows{"seconds [s],message,x [m]", "2.500000000,6,2", "3.500000000,8,3"}));
}

TEST_F(CourseTables, CanBeBetweenTimes) {
  ASSERT_TRUE(exported({.columns = {"x"}, .part = {.from_s = 1, .to_s = 2.5}}));
  EXPECT_EQ(table("lab_a.csv"), (Rows{"seconds [s],message,x [m]", "1.500000000,3,1"}));
}

TEST_F(CourseTables, RefuseWhatTheRecordingDoesNotHave) {
  example_.end();
  auto reader = recording::FileReader::open(file_);
  ASSERT_TRUE(reader);
  const auto refusal = [&](const TableOptions& options) {
    const auto report = export_csv(**reader, out_, options);
    EXPECT_FALSE(report);
    EXPECT_FALSE(std::filesystem::exists(out_));
    return report ? "" : report.error().text();
  };
  const auto has = [](const std::string& text, const char* part) {
    EXPECT_NE(text.find(part), std::string::npos) << text;
  };
  has(refusal({.topics = {"lab/aa"}}), "no topic is like 'lab/aa' (did you mean 'lab/a'");
  has(refusal({.columns = {"labell"}}), "did you mean 'label'");
  has(refusal({.part = {.between = {{"=now", "the  end"}}}}), "did you mean 'the end'");
  has(refusal({.part = {.between = {{"the end", "=now"}}}}), "no mark '=now' follows 'the end'");
  has(refusal({.part = {.trial = 9}}), "its trials are 1 to 2");
  has(refusal({.part = {.condition = "sofd"}}), "did you mean 'soft'");
  has(refusal({.part = {.from_s = 60}}), "4.000 seconds");
  has(refusal({.part = {.from_s = 0, .to_s = 1, .trial = 2}}), "nothing in common");
  has(refusal({.is_joined = true, .rate_hz = 1e12}), "lower rate");
}

TEST_F(Tables, KeepColumnsOfOneNameApart) {
  const auto first = values("lab/a");
  const auto second = example_.add(*value_, "lab.Value", "lab/a", {{"rtpm.kind", "sample"}});
  put(first, 0, R"({"x":1})");
  put(second, 0, R"({"x":2})");
  ASSERT_TRUE(exported({.columns = {"x"}, .is_joined = true}));
  EXPECT_EQ(table("joined.csv"),
            (Rows{"seconds [s],lab/a.x [m],lab/a-2.x [m]", "0.000000000,1,2"}));
}

TEST_F(Tables, KeepTheirOrderWithManyMarks) {
  const auto trials = this->trials();
  std::string error;
  const auto bytes = trial_->encode(
      trial_->event(), R"({"phase":"Mark","note":"a mark with a label of some length"})", error);
  ASSERT_TRUE(bytes);
  constexpr std::uint32_t kCount = 100'000;
  for (std::uint32_t i = 0; i < kCount; ++i) {
    ASSERT_TRUE(example_.writer().write({.channel_id = trials,
                                         .sequence = i,
                                         .log_time_ns = ns(0) + i * 10'000ULL,
                                         .publish_time_ns = ns(0) + i * 10'000ULL,
                                         .data = *bytes}));
  }
  const auto report = exported({.topics = {"*"}, .is_joined = true, .rate_hz = 10});
  ASSERT_TRUE(report) << report.error().text();
  EXPECT_EQ(report->row_count, 11u);
}

TEST_F(Tables, SayThatTheDiskIsFull) {
  example_.put_arm(3000);
  example_.end();
  const std::string disk = folder_.fresh("disk");
  std::filesystem::create_directory(disk);
  if (::mount("tmpfs", disk.c_str(), "tmpfs", 0, "size=256k") != 0)
    GTEST_SKIP() << "mounting a small disk needs root";
  auto reader = recording::FileReader::open(file_);
  ASSERT_TRUE(reader);
  const auto report = export_csv(**reader, disk + "/tables", {.is_joined = true});
  const bool has_rest = !std::filesystem::is_empty(disk);
  EXPECT_EQ(::umount(disk.c_str()), 0);
  ASSERT_FALSE(report);
  EXPECT_NE(report.error().text().find("No space left on device"), std::string::npos)
      << report.error().text();
  EXPECT_FALSE(has_rest);
}

}  // namespace
}  // namespace rtpm::exports
