#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>

#include "rights.hpp"
#include "rtpm/access/file_change.hpp"
#include "rtpm/access/files.hpp"
#include "rtpm/access/log_file.hpp"
#include "rtpm/test/temporary_folder.hpp"

// Files by mode, owner and links.
namespace rtpm::access {

const std::string kRemedyOfReading = "chmod 600 ";
const std::string kRemedyOfWriting = "chmod go-w ";

namespace {

unsigned mode_of(const std::string& path) {
  struct stat status {};
  return ::stat(path.c_str(), &status) == 0 ? status.st_mode & 0777 : 0;
}

}  // namespace

void keep_for_this_user(const std::string& path) {
  EXPECT_EQ(::chmod(path.c_str(), 0600), 0);
}
void let_others_read(const std::string& path) {
  EXPECT_EQ(::chmod(path.c_str(), 0604), 0);
}
void let_others_write(const std::string& path) {
  EXPECT_EQ(::chmod(path.c_str(), 0620), 0);
}
bool are_others_allowed(const std::string& path) {
  return (mode_of(path) & 0077) != 0;
}

namespace {

class Modes : public testing::Test {
 protected:
  [[nodiscard]] std::string path(const char* name) const { return folder_.file(name); }
  void write(const char* name, const std::string& text, mode_t mode) const {
    std::ofstream(path(name)) << text;
    ::chmod(path(name).c_str(), mode);
  }

  test::TemporaryFolder folder_;
};

TEST_F(Modes, AreThoseOfTheOwnerAlone) {
  ASSERT_TRUE(make_key(path("sub/key"), ""));
  EXPECT_EQ(mode_of(path("sub/key")), 0600U);
  EXPECT_EQ(mode_of(path("sub")), 0700U);
  const auto file = LogFile::open(path("audit"));
  ASSERT_TRUE(file);
  EXPECT_EQ(mode_of(path("audit")), 0600U);
}

TEST_F(Modes, AreKeptWithLinkAndAnUnterminatedLastLine) {
  write("real", "one", 0644);
  std::filesystem::create_symlink(path("real"), path("authorized"));
  ASSERT_TRUE(change_trusted_file(path("authorized"),
                                  [](const std::string& text) { return with_line(text, "two"); }));
  EXPECT_TRUE(std::filesystem::is_symlink(path("authorized")));
  EXPECT_EQ(*read_trusted_file(path("real")), "one\ntwo\n");
  EXPECT_EQ(mode_of(path("authorized")), 0644U);
}

TEST_F(Modes, OfAGroupAreRefused) {
  write("key", "", 0640);
  const auto read = read_key(path("key"));
  ASSERT_FALSE(read);
  EXPECT_NE(read.error().text().find("chmod 600 " + path("key")), std::string::npos);
  write("authorized", "", 0664);
  EXPECT_FALSE(read_trusted_file(path("authorized")));
}

TEST_F(Modes, OfPipesAndLinksDoNotHelp) {
  ASSERT_EQ(::mkfifo(path("pipe").c_str(), 0600), 0);
  EXPECT_FALSE(read_key(path("pipe")));
  // sec-9-1
  std::filesystem::create_symlink(path("elsewhere"), path("audit"));
  EXPECT_FALSE(LogFile::open(path("audit")));
}

TEST_F(Modes, OfAnotherUserAreRefused) {
  if (::geteuid() != 0) GTEST_SKIP() << "needs root, to give a file to another user";
  write("authorized", "", 0644);
  ASSERT_EQ(::chown(path("authorized").c_str(), 4711, 4711), 0);
  const auto read = read_trusted_file(path("authorized"));
  ASSERT_FALSE(read);
  EXPECT_NE(read.error().text().find("another user, number 4711"), std::string::npos);
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

}  // namespace
}  // namespace rtpm::access
