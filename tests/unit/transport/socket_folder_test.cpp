#include "rtpm/transport/socket_folder.hpp"

#include <gtest/gtest.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <optional>
#include <string>
#include <vector>

#include "rtpm/test/temporary_folder.hpp"

namespace rtpm::transport {
namespace {

namespace fs = std::filesystem;

/// A separate folder, which the first socket creates.
class SocketFolderTest : public testing::Test {
 protected:
  [[nodiscard]] expected<FolderSocket, SetupError> create(std::string name) {
    return FolderSocket::create(folder_, std::move(name));
  }
  /// Leaves its file, like a program that was killed.
  void leave_stale(const std::string& name) {
    auto socket = create("living");
    ASSERT_TRUE(socket) << socket.error().text();
    fs::rename(folder_ + "/living", folder_ + "/" + name);
  }
  void expect_unusable(std::string_view part) {
    for (const auto& error : {read_socket_folder(folder_).error(), create("one").error()}) {
      EXPECT_NE(error.text().find(folder_), std::string::npos) << error.text();
      EXPECT_NE(error.text().find(part), std::string::npos) << error.text();
      EXPECT_NE(error.text().find("Remedy"), std::string::npos) << error.text();
    }
  }

  rtpm::test::TemporaryFolder temporary_;
  std::string scratch_ = temporary_.path();
  std::string folder_ = scratch_ + "/rtpm";
};

TEST_F(SocketFolderTest, IsEmptyIfItDoesNotExist) {
  const auto content = read_socket_folder(folder_);
  ASSERT_TRUE(content) << content.error().text();
  EXPECT_TRUE(content->names.empty());
  EXPECT_FALSE(fs::exists(folder_));
}

TEST_F(SocketFolderTest, ListsSocketsWhileTheyExist) {
  {
    const auto one = create("one");
    const auto two = create("two");
    ASSERT_TRUE(one && two);
    EXPECT_EQ(fs::status(folder_).permissions(), fs::perms::owner_all);
    EXPECT_EQ(read_socket_folder(folder_)->names, (std::vector<std::string>{"one", "two"}));
    EXPECT_FALSE(create("one")) << "the name is there already";
  }
  EXPECT_TRUE(read_socket_folder(folder_)->names.empty());
  EXPECT_TRUE(fs::is_empty(folder_));
}

TEST_F(SocketFolderTest, RemovesStaleSocketsWhenRead) {
  for (int i = 0; i < 1000; ++i)
    leave_stale("stale" + std::to_string(i));
  const auto living = create("living");
  const auto content = read_socket_folder(folder_);
  ASSERT_TRUE(content) << content.error().text();
  EXPECT_EQ(content->names, std::vector<std::string>{"living"});
  EXPECT_EQ(content->stale_count, 1000U);
  EXPECT_EQ(read_socket_folder(folder_)->stale_count, 0U);
}

TEST_F(SocketFolderTest, KeepsFilesThatAreNoSockets) {
  const auto living = create("living");
  std::ofstream(folder_ + "/file") << "text";
  fs::create_symlink(folder_ + "/living", folder_ + "/link");
  fs::create_directory(folder_ + "/folder");
  const auto content = read_socket_folder(folder_);
  EXPECT_EQ(content->names, std::vector<std::string>{"living"});
  EXPECT_EQ(content->foreign_count, 3U);
  EXPECT_TRUE(fs::exists(folder_ + "/file"));
}

// A reader examines a bounded number of files, however many exist.
TEST_F(SocketFolderTest, IsReadUpToALimit) {
  const auto living = create("living");
  for (std::size_t i = 0; i < kFolderFileCountMax; ++i)
    std::ofstream(folder_ + "/file" + std::to_string(i));
  EXPECT_TRUE(read_socket_folder(folder_)->is_cut_off);
}

TEST_F(SocketFolderTest, IsRefusedIfOthersMayEnterIt) {
  fs::create_directory(folder_);
  chmod(folder_.c_str(), 0750);
  expect_unusable("others may enter it");
}

TEST_F(SocketFolderTest, IsRefusedThroughALink) {
  fs::create_directory(scratch_ + "/elsewhere");
  chmod((scratch_ + "/elsewhere").c_str(), 0700);
  fs::create_directory_symlink(scratch_ + "/elsewhere", folder_);
  expect_unusable("it is a link or no folder");
  EXPECT_TRUE(fs::is_empty(scratch_ + "/elsewhere"));
}

TEST_F(SocketFolderTest, IsRefusedIfItBelongsToAnotherUser) {
  if (geteuid() != 0) GTEST_SKIP() << "only root can give a folder away";
  fs::create_directory(folder_);
  chmod(folder_.c_str(), 0700);
  ASSERT_EQ(chown(folder_.c_str(), 12345, 12345), 0);
  expect_unusable("it belongs to user 12345");
}

TEST_F(SocketFolderTest, IsRecreatedAfterItsRemoval) {
  auto socket = create("one");
  ASSERT_TRUE(socket);
  fs::remove_all(folder_);
  socket->keep();
  EXPECT_EQ(read_socket_folder(folder_)->names, std::vector<std::string>{"one"});
}

TEST_F(SocketFolderTest, AcceptsPlainFileNamesOnly) {
  for (const char* const bad : {"", ".", "..", ".hidden", "a/b"})
    EXPECT_FALSE(create(bad)) << bad;
  EXPECT_FALSE(create(std::string(kFolderNameSizeMax + 1, 'x')));
  EXPECT_TRUE(create(std::string(kFolderNameSizeMax, 'x')));
}

TEST(RuntimeFolder, FollowsTheEnvironment) {
  setenv("XDG_RUNTIME_DIR", "/run/here", 1);
  unsetenv("RTPM_RUNTIME_FOLDER");
  EXPECT_EQ(runtime_folder(), "/run/here/rtpm-names");
  EXPECT_FALSE(has_own_runtime_folder());
  setenv("RTPM_RUNTIME_FOLDER", "/my/own", 1);
  EXPECT_EQ(runtime_folder(), "/my/own");
  EXPECT_TRUE(has_own_runtime_folder());
  unsetenv("RTPM_RUNTIME_FOLDER");
  unsetenv("XDG_RUNTIME_DIR");
  EXPECT_TRUE(runtime_folder().ends_with("/rtpm-names") ||
              runtime_folder() == "/tmp/rtpm-names-" + std::to_string(geteuid()));
}

}  // namespace
}  // namespace rtpm::transport
