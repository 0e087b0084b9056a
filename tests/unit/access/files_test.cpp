#include "rtpm/access/files.hpp"

#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>

#include "rtpm/test/temporary_folder.hpp"

namespace rtpm::access {
namespace {

class Files : public testing::Test {
 protected:
  [[nodiscard]] std::string path(const char* name) const { return folder_.file(name); }
  void write(const char* name, const std::string& text, mode_t mode) const {
    std::ofstream(path(name)) << text;
    ::chmod(path(name).c_str(), mode);
  }

  test::TemporaryFolder folder_;
};

TEST_F(Files, ReadsTheKeyThatItMade) {
  const auto made = make_key(path("sub/key"), "alice@lab");
  ASSERT_TRUE(made) << made.error().text();
  struct stat status {};
  ASSERT_EQ(::stat(path("sub/key").c_str(), &status), 0);
  EXPECT_EQ(status.st_mode & 0777, 0600U);
  ASSERT_EQ(::stat(path("sub").c_str(), &status), 0);
  EXPECT_EQ(status.st_mode & 0777, 0700U);
  const auto read = read_key(path("sub/key"));
  ASSERT_TRUE(read) << read.error().text();
  EXPECT_EQ(read->public_key, made->public_key);
}

TEST_F(Files, RefusesToReplaceAKey) {
  const auto first = make_key(path("key"), "");
  ASSERT_TRUE(first);
  const auto second = make_key(path("key"), "");
  ASSERT_FALSE(second);
  EXPECT_NE(second.error().text().find("there is one already"), std::string::npos);
  EXPECT_EQ(read_key(path("key"))->public_key, first->public_key);
}

TEST_F(Files, RefusesAKeyThatOthersCanReadAndNamesTheRemedy) {
  ASSERT_TRUE(make_key(path("key"), ""));
  for (const mode_t mode : {0640U, 0604U, 0620U}) {
    ::chmod(path("key").c_str(), mode);
    const auto read = read_key(path("key"));
    ASSERT_FALSE(read);
    EXPECT_NE(read.error().text().find("chmod 600 " + path("key")), std::string::npos)
        << read.error().text();
  }
}

TEST_F(Files, RefusesAFileThatHoldsNoKey) {
  const auto missing = read_key(path("key"));
  ASSERT_FALSE(missing);
  EXPECT_NE(missing.error().text().find("rtpm key new"), std::string::npos);
  write("empty", "", 0600);
  EXPECT_FALSE(read_key(path("empty")));
  write("broken", "rtpm25519 AAAA\n", 0600);
  EXPECT_FALSE(read_key(path("broken")));
  EXPECT_FALSE(read_key(folder_.path()));
  ASSERT_EQ(::mkfifo(path("pipe").c_str(), 0600), 0);
  EXPECT_FALSE(read_key(path("pipe")));
}

TEST_F(Files, ReadsAMissingFileOfGrantsAsEmpty) {
  const auto read = read_trusted_file(path("authorized"));
  ASSERT_TRUE(read);
  EXPECT_TRUE(read->empty());
}

TEST_F(Files, RefusesGrantsThatOthersCanWrite) {
  write("authorized", "uid:1 role=observe on=**\n", 0644);
  EXPECT_TRUE(read_trusted_file(path("authorized")));
  ::chmod(path("authorized").c_str(), 0664);
  const auto read = read_trusted_file(path("authorized"));
  ASSERT_FALSE(read);
  EXPECT_NE(read.error().text().find("chmod go-w"), std::string::npos) << read.error().text();
}

TEST_F(Files, RefusesAFileOfAnotherUser) {
  if (::geteuid() != 0) GTEST_SKIP() << "needs root, to give a file to another user";
  write("authorized", "", 0644);
  ASSERT_EQ(::chown(path("authorized").c_str(), 4711, 4711), 0);
  const auto read = read_trusted_file(path("authorized"));
  ASSERT_FALSE(read);
  EXPECT_NE(read.error().text().find("another user, number 4711"), std::string::npos);
}

TEST_F(Files, RefusesAFileThatIsTooLarge) {
  write("authorized", std::string(kFileSizeMax + 1, 'x'), 0644);
  EXPECT_FALSE(read_trusted_file(path("authorized")));
}

TEST(KeyFolder, ComesFromTheEnvironment) {
  ::setenv("RTPM_KEYS", "/of/a/test", 1);
  EXPECT_EQ(*key_file_path("", kKeyFile), "/of/a/test/key");
  EXPECT_EQ(*key_file_path("here", kKeyFile), "here");
  ::unsetenv("RTPM_KEYS");
  ::setenv("XDG_CONFIG_HOME", "/config", 1);
  EXPECT_EQ(*key_folder(), "/config/rtpm");
  ::unsetenv("XDG_CONFIG_HOME");
  ::setenv("HOME", "/own", 1);
  EXPECT_EQ(*key_folder(), "/own/.config/rtpm");
  ::unsetenv("HOME");
  EXPECT_FALSE(key_folder());
}

TEST_F(Files, ReadsTheCommentBehindTheKey) {
  ASSERT_TRUE(make_key(path("key"), "alice@lab, new"));
  EXPECT_EQ(key_comment(path("key")), "alice@lab, new");
  ASSERT_TRUE(make_key(path("bare"), ""));
  EXPECT_EQ(key_comment(path("bare")), "");
  ::chmod(path("key").c_str(), 0640);
  EXPECT_EQ(key_comment(path("key")), "");
}

}  // namespace
}  // namespace rtpm::access
