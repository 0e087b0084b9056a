#include "rtpm/rt/durable_file.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>

namespace rtpm::rt {
namespace {

std::string content_of(const std::filesystem::path& path) {
  std::ostringstream text;
  text << std::ifstream(path).rdbuf();
  return text.str();
}

class DurableFile : public testing::Test {
 protected:
  DurableFile() { std::filesystem::create_directory(folder_); }
  ~DurableFile() override { std::filesystem::remove_all(folder_); }

  std::filesystem::path folder_ =
      std::filesystem::path(testing::TempDir()) / ("rtpm-durable-" + std::to_string(getpid()));
  std::string path_ = (folder_ / "file").string();
};

TEST_F(DurableFile, IsMadeAndReplacedWhole) {
  ASSERT_TRUE(replace_file(path_, "first content"));
  EXPECT_EQ(content_of(path_), "first content");
  ASSERT_TRUE(replace_file(path_, "second"));
  EXPECT_EQ(content_of(path_), "second");
  EXPECT_FALSE(std::filesystem::exists(path_ + ".new"));
}

TEST_F(DurableFile, ThatCannotBeReplacedStays) {
  ASSERT_TRUE(replace_file(path_, "old"));
  std::filesystem::create_directory(path_ + ".new");
  const auto replaced = replace_file(path_, "new");
  ASSERT_FALSE(replaced);
  EXPECT_EQ(replaced.error(), std::errc::is_a_directory);
  EXPECT_EQ(content_of(path_), "old");
  EXPECT_EQ(replace_file((folder_ / "none" / "file").string(), "new").error(),
            std::errc::no_such_file_or_directory);
}

}  // namespace
}  // namespace rtpm::rt
