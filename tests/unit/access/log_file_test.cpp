#include "rtpm/access/log_file.hpp"

#include <gtest/gtest.h>
#include <sys/stat.h>

#include <filesystem>
#include <fstream>
#include <iterator>

namespace rtpm::access {
namespace {

namespace fs = std::filesystem;

class LogFileTest : public testing::Test {
 protected:
  LogFileTest() : folder_((fs::temp_directory_path() / "rtpm-log-XXXXXX").string()) {
    EXPECT_NE(mkdtemp(folder_.data()), nullptr);
    path_ = folder_ + "/audit";
  }
  ~LogFileTest() override { fs::remove_all(folder_); }
  static std::string content(const std::string& path) {
    std::ifstream file(path);
    return {std::istreambuf_iterator<char>(file), {}};
  }
  std::string folder_;
  std::string path_;
};

TEST_F(LogFileTest, IsItsOwnersAloneAndGoesOnWhereItEnded) {
  for (const char* line : {"one", "two"}) {
    auto file = LogFile::open(path_);
    ASSERT_TRUE(file) << file.error().text();
    EXPECT_TRUE(file->write_line(line));
  }
  EXPECT_EQ(content(path_), "one\ntwo\n");
  EXPECT_EQ(fs::status(path_).permissions(), fs::perms::owner_read | fs::perms::owner_write);
}

TEST_F(LogFileTest, HasABoundedSizeWithOneOlderFileBesideIt) {
  auto file = LogFile::open(path_, 8);
  ASSERT_TRUE(file);
  for (const char* line : {"one", "two", "three", "four", "five"})
    EXPECT_TRUE(file->write_line(line));
  EXPECT_EQ(content(path_ + ".1"), "three\nfour\n");
  EXPECT_EQ(content(path_), "five\n");
}

// sec-9-1
TEST_F(LogFileTest, IsNotWrittenWhereOthersRead) {
  std::ofstream(path_) << "";
  fs::permissions(path_, fs::perms::others_read, fs::perm_options::add);
  EXPECT_FALSE(LogFile::open(path_));
  fs::remove(path_);
  fs::create_symlink(folder_ + "/elsewhere", path_);
  EXPECT_FALSE(LogFile::open(path_));
}

}  // namespace
}  // namespace rtpm::access
