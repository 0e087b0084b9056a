#include "rtpm/incidents/file.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

namespace rtpm::incidents {
namespace {

class File : public ::testing::Test {
 protected:
  void SetUp() override {
    std::string pattern = ::testing::TempDir() + "incidents-XXXXXX";
    ASSERT_NE(::mkdtemp(pattern.data()), nullptr);
    folder_ = pattern;
    path_ = folder_ + "/state/incidents.jsonl";
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  [[nodiscard]] expected<IncidentFile, SetupError> open() {
    return IncidentFile::open(path_, content_);
  }
  static Incident incident(std::uint64_t id) {
    return {.id = id,
            .who = "lab/arm0",
            .what = "lost",
            .why = "its server hangs; \"quoted\"",
            .severity = Severity::kAlarm,
            .since_ns = 1'700'000'000'000'000'001,
            .count = 3,
            .recording = "run.mcap"};
  }

  std::string folder_{};
  std::string path_{};
  Content content_{};
};

TEST_F(File, KeepsTheNewestStateOfEachOverRestarts) {
  Incident first = incident(1);
  {
    auto file = open();
    ASSERT_TRUE(file) << file.error().text();
    const std::array both{first, incident(2)};
    ASSERT_TRUE(file->append(both));
    first.until_ns = first.since_ns + 5;
    first.acknowledged_by = "Anna";
    first.acknowledged_ns = 9;
    ASSERT_TRUE(file->append(std::span(&first, 1)));
  }
  ASSERT_TRUE(open());
  ASSERT_EQ(content_.incidents.size(), 2U);
  EXPECT_EQ(content_.incidents[0], first);
  EXPECT_EQ(content_.incidents[1], incident(2));
  EXPECT_EQ(content_.torn_count, 0U);
}

TEST_F(File, SurvivesATornLineAndForeignBytes) {
  {
    auto file = open();
    ASSERT_TRUE(file->append(std::array{incident(1)}));
  }
  std::ofstream(path_, std::ios::app) << "\xff\xfe{]\n[1,2]\n{\"id\":0}\n{\"id\":2,\"who\":\"la";
  auto file = open();
  ASSERT_TRUE(file);
  ASSERT_TRUE(file->append(std::array{incident(3)}));
  const auto read = read_file(path_);
  ASSERT_TRUE(read);
  ASSERT_EQ(read->incidents.size(), 2U);
  EXPECT_EQ(read->incidents[1], incident(3));
  EXPECT_EQ(read->torn_count, 4U);
}

TEST_F(File, BelongsToOneConsole) {
  auto file = open();
  ASSERT_TRUE(file);
  const auto second = open();
  ASSERT_FALSE(second);
  EXPECT_NE(second.error().text().find("--incidents FILE"), std::string::npos);
}

TEST_F(File, TakesAcknowledgementsOfTheToolWhileAConsoleHasIt) {
  auto file = open();
  ASSERT_TRUE(file->append(std::array{incident(1), incident(2)}));
  EXPECT_TRUE(file->read_others().empty());
  ASSERT_TRUE(acknowledge_in_file(path_, std::array<std::uint64_t, 1>{2}, "Ben", 77));
  const auto others = file->read_others();
  ASSERT_EQ(others.size(), 1U);
  EXPECT_EQ(others[0].id, 2U);
  EXPECT_EQ(others[0].person, "Ben");
  EXPECT_EQ(others[0].utc_ns, 77U);
  EXPECT_TRUE(file->read_others().empty());
  const auto read = read_file(path_);
  EXPECT_EQ(read->incidents[1].acknowledged_by, "Ben");
  EXPECT_FALSE(read->incidents[0].is_acknowledged());
}

TEST_F(File, IsWrittenAnewWhenMostLinesAreSuperseded) {
  {
    auto file = open();
    for (int i = 0; i < 1500; ++i)
      ASSERT_TRUE(file->append(std::array{incident(1)}));
  }
  const auto before = std::filesystem::file_size(path_);
  ASSERT_TRUE(open());
  EXPECT_LT(std::filesystem::file_size(path_) * 100, before);
  EXPECT_EQ(content_.incidents.size(), 1U);
}

TEST_F(File, TellsThatTheDiskIsFull) {
  if (!std::filesystem::exists("/dev/full")) GTEST_SKIP() << "there is no /dev/full";
  auto file = open();
  ASSERT_TRUE(file);
  std::filesystem::remove(path_);
  std::filesystem::create_symlink("/dev/full", path_);
  const auto appended = file->append(std::array{incident(1)});
  ASSERT_FALSE(appended);
  EXPECT_NE(appended.error().text().find("No space left"), std::string::npos)
      << appended.error().text();
}

TEST_F(File, IsEmptyWhereThereIsNone) {
  const auto read = read_file(path_);
  ASSERT_TRUE(read);
  EXPECT_TRUE(read->incidents.empty());
}

}  // namespace
}  // namespace rtpm::incidents
