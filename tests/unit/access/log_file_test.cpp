#include "rtpm/access/log_file.hpp"

#include <gtest/gtest.h>
#include <sys/stat.h>

#include <filesystem>
#include <fstream>

#include "rtpm/test/temporary_folder.hpp"

namespace rtpm::access {
namespace {

namespace fs = std::filesystem;

class LogFileTest : public testing::Test {
 protected:
  test::TemporaryFolder folder_;
  std::string path_ = folder_.file("audit");
};

TEST_F(LogFileTest, IsPrivateAndAppendsAfterReopening) {
  for (const char* line : {"one", "two"}) {
    auto file = LogFile::open(path_);
    ASSERT_TRUE(file) << file.error().text();
    EXPECT_TRUE(file->write_line(line));
  }
  EXPECT_EQ(folder_.read("audit"), "one\ntwo\n");
  EXPECT_EQ(fs::status(path_).permissions(), fs::perms::owner_read | fs::perms::owner_write);
}

TEST_F(LogFileTest, RotatesToOneOlderFileAtItsSizeLimit) {
  auto file = LogFile::open(path_, 8);
  ASSERT_TRUE(file);
  for (const char* line : {"one", "two", "three", "four", "five"})
    EXPECT_TRUE(file->write_line(line));
  EXPECT_EQ(folder_.read("audit.1"), "three\nfour\n");
  EXPECT_EQ(folder_.read("audit"), "five\n");
}

// sec-9-1
TEST_F(LogFileTest, RefusesALinkAndAFileThatOthersRead) {
  std::ofstream(path_) << "";
  fs::permissions(path_, fs::perms::others_read, fs::perm_options::add);
  EXPECT_FALSE(LogFile::open(path_));
  fs::remove(path_);
  fs::create_symlink(folder_.file("elsewhere"), path_);
  EXPECT_FALSE(LogFile::open(path_));
}

}  // namespace
}  // namespace rtpm::access
