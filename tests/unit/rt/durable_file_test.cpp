#include "rtpm/rt/durable_file.hpp"

#include <gtest/gtest.h>

#include <filesystem>
#include <string>

#include "rtpm/test/temporary_folder.hpp"

namespace rtpm::rt {
namespace {

class DurableFile : public testing::Test {
 protected:
  test::TemporaryFolder folder_;
  std::string path_ = folder_.file("file");
};

TEST_F(DurableFile, IsCreatedAndReplacedAsAWhole) {
  ASSERT_TRUE(replace_file(path_, "first content"));
  EXPECT_EQ(folder_.read("file"), "first content");
  ASSERT_TRUE(replace_file(path_, "second"));
  EXPECT_EQ(folder_.read("file"), "second");
  EXPECT_FALSE(std::filesystem::exists(path_ + ".new"));
}

TEST_F(DurableFile, KeepsItsContentWhenItCannotBeReplaced) {
  ASSERT_TRUE(replace_file(path_, "old"));
  std::filesystem::create_directory(path_ + ".new");
  const auto replaced = replace_file(path_, "new");
  ASSERT_FALSE(replaced);
  // Windows denies access to what is no file.
  EXPECT_TRUE(replaced.error() == std::errc::is_a_directory ||
              replaced.error() == std::errc::permission_denied)
      << replaced.error().message();
  EXPECT_EQ(folder_.read("file"), "old");
  EXPECT_EQ(replace_file(folder_.file("none/file"), "new").error(),
            std::errc::no_such_file_or_directory);
}

}  // namespace
}  // namespace rtpm::rt
