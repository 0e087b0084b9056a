#include "rtpm/exports/bids.hpp"

#include <gtest/gtest.h>

#include <filesystem>

#include "example_recording.hpp"

namespace rtpm::exports {
namespace {

class Bids : public testing::Test {
 protected:
  expected<Report, SetupError> exported(const BidsOptions& options) {
    auto reader = recording::FileReader::open(file_);
    EXPECT_TRUE(reader) << reader.error().text();
    return export_bids(**reader, out_, options);
  }
  [[nodiscard]] std::string file(const std::string& name) const {
    return recording::content_of(out_ + "/" + name);
  }
  void record(bool has_session) {
    test::Example example(file_);
    example.put_arm(20);
    if (has_session) {
      ASSERT_TRUE(example.writer().write(
          recording::Metadata{.name = kSessionMetadata,
                              .values = {{"participant", "P-07"}, {"experiment", "soft touch"}}}));
    }
    example.end();
  }

  recording::Folder folder_;
  std::string file_ = folder_.fresh("run");
  std::string out_ = folder_.fresh("study");
};

TEST_F(Bids, NamesFilesByTheRecordingsSession) {
  record(true);
  const auto report = exported({.topics = {"lab/arm-0"}, .rate_hz = 1000});
  ASSERT_TRUE(report) << report.error().text();
  EXPECT_EQ(report->topic_count, 1u);
  const std::string stem = "sub-P07/motion/sub-P07_task-softtouch_tracksys-labarm0";
  const std::string rows = file(stem + "_motion.tsv");
  EXPECT_EQ(std::ranges::count(rows, '\n'), 21) << "from the first message, in steps of 1 ms";
  EXPECT_EQ(rows.substr(0, 8), "n/a\tn/a\t") << "the description is before the first sample";
  const std::string channels = file(stem + "_channels.tsv");
  EXPECT_EQ(channels.rfind("name\tcomponent\ttype\ttracked_point\tunits\n", 0), 0u);
  EXPECT_NE(channels.find("\nposition_m.x\tx\tPOS\tlab/arm-0\tm\n"), std::string::npos);
  EXPECT_NE(channels.find("\norientation.w\tquat_w\tORNT\tlab/arm-0\tn/a\n"), std::string::npos);
  const auto column_count = std::ranges::count(rows.substr(0, rows.find('\n')), '\t') + 1;
  EXPECT_EQ(std::ranges::count(channels, '\n'), column_count + 1);
  EXPECT_NE(file(stem + "_motion.json").find("\"SamplingFrequency\": 1000"), std::string::npos);
  EXPECT_EQ(file("participants.tsv"), "participant_id\nsub-P07\n");
  EXPECT_EQ(file("sub-P07/sub-P07_scans.tsv"),
            "filename\tacq_time\nmotion/sub-P07_task-softtouch_tracksys-labarm0_motion.tsv\t"
            "2023-11-14T22:13:20.000000000Z\n");
  EXPECT_NE(file("dataset_description.json").find("BIDSVersion"), std::string::npos);
}

TEST_F(Bids, HasNotesAmongTheEvents) {
  record(true);
  const auto report =
      exported({.notes = {{.time_ns = test::kBeginNs + 5'000'000, .text = "slipped,\tleft"}}});
  ASSERT_TRUE(report) << report.error().text();
  EXPECT_EQ(report->row_count, 1u);
  EXPECT_EQ(file("sub-P07/beh/sub-P07_task-softtouch_events.tsv"),
            "onset\tduration\ttrial_type\ttrial\tresponse\tresponse_time\tseed\tnote\n"
            "0.005000000\t0\tnote\tn/a\tn/a\tn/a\tn/a\tslipped,\\tleft\n");
}

TEST_F(Bids, AddsRunsAndParticipants) {
  record(true);
  ASSERT_TRUE(exported({}));
  const auto again = exported({});
  ASSERT_FALSE(again);
  EXPECT_NE(again.error().text().find("already"), std::string::npos) << again.error().text();
  EXPECT_TRUE(exported({.run = 2}));
  EXPECT_TRUE(exported({.participant = "P08", .session = "1"}));
  EXPECT_EQ(file("participants.tsv"), "participant_id\nsub-P07\nsub-P08\n");
  EXPECT_NE(file("sub-P08/ses-1/motion/sub-P08_ses-1_task-softtouch_tracksys-labarm0_motion.tsv"),
            "");
  EXPECT_FALSE(std::filesystem::exists(out_ + ".part"));
}

TEST_F(Bids, NeedsAParticipantAndADataSet) {
  record(false);
  const auto nobody = exported({});
  ASSERT_FALSE(nobody);
  EXPECT_NE(nobody.error().text().find("--participant"), std::string::npos);
  std::filesystem::create_directory(out_);
  const auto elsewhere = exported({.participant = "P07"});
  ASSERT_FALSE(elsewhere);
  EXPECT_NE(elsewhere.error().text().find("no BIDS data set"), std::string::npos);
  EXPECT_TRUE(std::filesystem::is_empty(out_));
}

}  // namespace
}  // namespace rtpm::exports
