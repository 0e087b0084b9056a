#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>

#include "../recording/foreign.hpp"
#include "../recording/recorded.hpp"
#include "recording/folder.hpp"
#include "recording/replay_player.hpp"
#include "rtpm/test/text.hpp"

// The console's folder of recordings, which also contains hostile files.
namespace rtpm::console {
namespace {

namespace foreign = recording::foreign;

class FolderOfRecordings : public testing::Test {
 protected:
  /// The names that the console lists.
  [[nodiscard]] std::vector<std::string> names() {
    std::vector<std::string> names;
    for (const RecordingFile& file : listed_.list().files)
      names.push_back(file.file);
    return names;
  }
  [[nodiscard]] static std::string refusal(const std::string& path) {
    const auto opened =
        ReplayPlayer::open(path, [](std::uint16_t, std::uint64_t, std::string) {}, {});
    return opened ? "" : opened.error().text();
  }

  recording::Folder folder_;
  RecordingFolder listed_{std::filesystem::path(folder_.path("a")).parent_path()};
};

TEST_F(FolderOfRecordings, SkipsPipesAndOtherFiles) {
  ASSERT_EQ(::mkfifo(folder_.fresh("pipe").c_str(), 0600), 0);
  recording::put_content(folder_.fresh("text"), "no recording");
  std::filesystem::create_symlink("/dev/zero", folder_.fresh("zero"));
  std::filesystem::create_directory(folder_.fresh("folder"));
  EXPECT_EQ(names(), std::vector<std::string>{});
  EXPECT_NE(refusal(folder_.path("pipe")), "");
}

TEST_F(FolderOfRecordings, ListsASparseFileWithoutReadingIt) {
  recording::put_content(folder_.fresh("holes"), foreign::header());
  ASSERT_EQ(::truncate(folder_.path("holes").c_str(), 1'000'000'000'000), 0);
  EXPECT_EQ(names(), std::vector<std::string>{"holes.mcap"});
  EXPECT_FALSE(listed_.list().files.at(0).is_complete);
}

TEST_F(FolderOfRecordings, ListsAFileWhileItGrowsAndWhenItIsComplete) {
  auto writer = recording::FileWriter::create(folder_.fresh("run"));
  ASSERT_TRUE(writer);
  EXPECT_FALSE(listed_.list().files.at(0).is_complete);
  recording::write_messages(**writer, 10);
  ASSERT_TRUE((*writer)->close());
  const auto files = listed_.list().files;
  ASSERT_EQ(files.size(), 1u);
  EXPECT_TRUE(files[0].is_complete);
  EXPECT_EQ(files[0].message_count, 10u);
  EXPECT_EQ(files[0].begin_ns, 1'000'000u);
  std::filesystem::remove(folder_.path("run"));
  EXPECT_TRUE(listed_.list().files.empty());
}

TEST_F(FolderOfRecordings, RefusesMoreTopicsThanAPageCanShow) {
  std::string content = foreign::header();
  for (std::uint64_t i = 1; i <= 20'000; ++i)
    content += foreign::channel(i, 0, "topic/" + std::to_string(i));
  content += foreign::message(1, 0, 5, "x");
  recording::put_content(folder_.fresh("many"), content);
  test::expect_text(refusal(folder_.path("many")), {"20000 topics"});
}

}  // namespace
}  // namespace rtpm::console
