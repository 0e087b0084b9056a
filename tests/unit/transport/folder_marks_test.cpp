#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "rtpm/test/temporary_folder.hpp"
#include "rtpm/transport/socket_folder.hpp"

// The folder by which the programs of a host find each other, on Windows.
namespace rtpm::transport {
namespace {

namespace fs = std::filesystem;

class FolderMarksTest : public testing::Test {
 protected:
  [[nodiscard]] expected<FolderSocket, SetupError> create(std::string name) {
    return FolderSocket::create(folder_, std::move(name));
  }

  rtpm::test::TemporaryFolder temporary_;
  // Paths are UTF-8, with blanks and umlauts.
  std::string folder_ = temporary_.path() + "/Geräte im Haus/rtpm";
};

TEST_F(FolderMarksTest, IsEmptyIfItDoesNotExist) {
  const auto content = read_socket_folder(folder_);
  ASSERT_TRUE(content) << content.error().text();
  EXPECT_TRUE(content->names.empty());
}

TEST_F(FolderMarksTest, ListsMarksWhileTheyExist) {
  const std::string name = "names@127.0.0.1:4711@12@0@7";
  {
    const auto one = create(name);
    ASSERT_TRUE(one) << one.error().text();
    EXPECT_EQ(read_socket_folder(folder_)->names, std::vector<std::string>{name});
    EXPECT_FALSE(create(name)) << "the name is there already";
  }
  EXPECT_TRUE(read_socket_folder(folder_)->names.empty());
}

TEST_F(FolderMarksTest, RemovesStaleMarksAndKeepsOtherFiles) {
  const auto living = create("living");
  ASSERT_TRUE(living) << living.error().text();
  const fs::path folder(std::u8string(folder_.begin(), folder_.end()));
  std::ofstream(folder / "stale");
  std::ofstream(folder / "file") << "text";
  const auto content = read_socket_folder(folder_);
  ASSERT_TRUE(content) << content.error().text();
  EXPECT_EQ(content->names, std::vector<std::string>{"living"});
  EXPECT_EQ(content->stale_count, 1U);
  EXPECT_EQ(content->foreign_count, 1U);
  EXPECT_FALSE(fs::exists(folder / "stale"));
  EXPECT_TRUE(fs::exists(folder / "file"));
}

TEST_F(FolderMarksTest, AcceptsPlainFileNamesOnly) {
  for (const char* const bad : {"", ".", "..", ".hidden", "a/b", "a\\b"})
    EXPECT_FALSE(create(bad)) << bad;
  EXPECT_FALSE(create(std::string(kFolderNameSizeMax + 1, 'x')));
}

}  // namespace
}  // namespace rtpm::transport
