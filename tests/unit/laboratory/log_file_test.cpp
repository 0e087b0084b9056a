#include "laboratory/log_file.hpp"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <string>

namespace rtpm::laboratory {
namespace {

namespace fs = std::filesystem;

constexpr fs::perms kOwn = fs::perms::owner_read | fs::perms::owner_write;

class Log : public testing::Test {
 protected:
  void SetUp() override { fs::remove_all(folder_); }
  void TearDown() override { fs::remove_all(folder_); }

  fs::path folder_ =
      fs::path(testing::TempDir()) /
      ("rtpm-log-" + std::string(testing::UnitTest::GetInstance()->current_test_info()->name()));
  std::string path_ = folder_ / "logs/console.log";
};

TEST_F(Log, IsReadByItsUserOnly) {
  auto log = LogFile::open(path_);
  ASSERT_TRUE(log) << log.error().text();
  EXPECT_EQ(fs::status(path_).permissions(), kOwn);
  // A file that exceeds its size limit starts anew.
  const std::string line(LogFile::kSizeMax / 4, 'x');
  for (int i = 0; i < 5; ++i)
    log->write(line);
  ASSERT_TRUE(fs::exists(path_ + ".1"));
  EXPECT_EQ(fs::status(path_).permissions(), kOwn);
  EXPECT_EQ(fs::status(path_ + ".1").permissions(), kOwn);
}

TEST_F(Log, OfAnEarlierVersionIsClosedToOthers) {
  fs::create_directories(fs::path(path_).parent_path());
  std::ofstream(path_) << "former\n";
  fs::permissions(path_, kOwn | fs::perms::others_read | fs::perms::group_read);
  auto log = LogFile::open(path_);
  ASSERT_TRUE(log) << log.error().text();
  EXPECT_EQ(fs::status(path_).permissions(), kOwn);
}

}  // namespace
}  // namespace rtpm::laboratory
