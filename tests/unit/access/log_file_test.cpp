#include "rtpm/access/log_file.hpp"

#include <gtest/gtest.h>
#include <sys/stat.h>

#include <filesystem>
#include <fstream>
#include <iterator>

#include "rtpm/test/temporary_folder.hpp"

namespace rtpm::access {
namespace {

namespace fs = std::filesystem;

class LogFileTest : public testing::Test {
 protected:
  static std::string content(const std::string& path) {
    std::ifstream file(path);
    return {std::istreambuf_iterator<char>(file), {}};
  }
  test::TemporaryFolder temporary_;
  std::string folder_ = temporary_.path();
  std::string path_ = folder_ + "/audit";
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
