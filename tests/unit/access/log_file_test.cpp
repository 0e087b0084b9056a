#include "rtpm/access/log_file.hpp"

#include <gtest/gtest.h>

#include "rights.hpp"
#include "rtpm/test/temporary_folder.hpp"

namespace rtpm::access {
namespace {

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
  EXPECT_FALSE(are_others_allowed(path_));
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
TEST_F(LogFileTest, RefusesAFileThatOthersRead) {
  ASSERT_TRUE(LogFile::open(path_));
  let_others_read(path_);
  EXPECT_FALSE(LogFile::open(path_));
}

}  // namespace
}  // namespace rtpm::access
