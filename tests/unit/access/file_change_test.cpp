#include "rtpm/access/file_change.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <thread>
#include <vector>

#include "rights.hpp"
#include "rtpm/access/files.hpp"
#include "rtpm/test/temporary_folder.hpp"

namespace rtpm::access {
namespace {

class FileChanges : public testing::Test {
 protected:
  static expected<void, SetupError> append(const std::string& path, const std::string& line) {
    return change_trusted_file(path,
                               [&](const std::string& text) { return with_line(text, line); });
  }

  test::TemporaryFolder temporary_;
  std::string folder_ = temporary_.path();
};

TEST_F(FileChanges, CreateFileAndFolderForTheOwnerAlone) {
  const std::string path = folder_ + "/sub/authorized";
  ASSERT_TRUE(append(path, "one"));
  ASSERT_TRUE(append(path, "two"));
  EXPECT_EQ(*read_trusted_file(path), "one\ntwo\n");
  EXPECT_FALSE(are_others_allowed(path));
  EXPECT_FALSE(are_others_allowed(folder_ + "/sub"));
}

TEST_F(FileChanges, LeaveTheFileUnchangedWhenRefused) {
  const std::string path = folder_ + "/authorized";
  ASSERT_TRUE(append(path, "one"));
  const FileStamp before = stamp_of(path);
  const FileChange refuse = [](const std::string&) -> expected<std::string, SetupError> {
    return setup_error("no");
  };
  EXPECT_FALSE(change_trusted_file(folder_ + "/none", refuse));
  EXPECT_FALSE(std::filesystem::exists(folder_ + "/none"));
  const auto refused = change_trusted_file(path, refuse);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().what, "no");
  EXPECT_EQ(stamp_of(path), before);
  let_others_write(path);
  const auto distrusted = append(path, "two");
  ASSERT_FALSE(distrusted);
  EXPECT_NE(distrusted.error().text().find(kRemedyOfWriting), std::string::npos);
}

TEST_F(FileChanges, KeepTheLinesOfConcurrentWriters) {
  const std::string path = folder_ + "/authorized";
  constexpr int kCount = 8;
  std::vector<std::thread> threads;
  for (int i = 0; i < kCount; ++i)
    threads.emplace_back([&, i] { EXPECT_TRUE(append(path, "line" + std::to_string(i))); });
  for (std::thread& thread : threads)
    thread.join();
  const std::string text = *read_trusted_file(path);
  EXPECT_EQ(std::ranges::count(text, '\n'), kCount) << text;
}

TEST(Lines, AreRemovedByNumber) {
  EXPECT_EQ(without_lines("a\n\nb\nc", {1, 4}), "\nb\n");
  EXPECT_EQ(without_lines("a\n", {2}), "a\n");
  EXPECT_EQ(without_lines("", {1}), "");
}

}  // namespace
}  // namespace rtpm::access
