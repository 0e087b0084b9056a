#include "laboratory/state_folder.hpp"

#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>

// The place where laboratories are recorded, and the records that count.
namespace rtpm::laboratory {
namespace {

namespace fs = std::filesystem;

class Folder : public testing::Test {
 protected:
  void SetUp() override {
    path_ = fs::path(testing::TempDir()) / ("rtpm-state-" + std::to_string(::getpid()));
    fs::remove_all(path_);
    fs::create_directories(path_);
    ::setenv("XDG_RUNTIME_DIR", path_.c_str(), 1);
  }
  void TearDown() override {
    ::unsetenv("XDG_RUNTIME_DIR");
    fs::remove_all(path_);
  }
  static StateFolder open() {
    auto folder = StateFolder::open();
    EXPECT_TRUE(folder) << folder.error().text();
    return *folder;
  }

  fs::path path_;
};

TEST_F(Folder, IsForItsUserOnly) {
  const StateFolder folder = open();
  EXPECT_EQ(folder.path(), path_ / "rtpm");
  struct stat found {};
  ASSERT_EQ(::stat(folder.path().c_str(), &found), 0);
  EXPECT_EQ(found.st_mode & 0777u, 0700u);
  ::chmod(folder.path().c_str(), 0777);
  const auto unsafe = StateFolder::open();
  ASSERT_FALSE(unsafe);
  EXPECT_NE(unsafe.error().text().find("chmod 700"), std::string::npos) << unsafe.error().text();
}

TEST_F(Folder, IsNoLinkToAnother) {
  fs::create_directories(path_ / "elsewhere");
  fs::create_symlink(path_ / "elsewhere", path_ / "rtpm");
  EXPECT_FALSE(StateFolder::open());
}

TEST_F(Folder, KnowsALaboratoryAsLongAsItsRecordIsLocked) {
  const StateFolder folder = open();
  {
    const auto record = Record::create(folder, "cell");
    ASSERT_TRUE(record);
    record->write({.name = "cell",
                   .file = "/x/cell.toml",
                   .supervisor = *identity_of(::getpid()),
                   .stop_patience = std::chrono::milliseconds{2500},
                   .programs = {"a", "b"}});
    const auto found = folder.find("cell");
    ASSERT_TRUE(found);
    EXPECT_EQ(found->file, "/x/cell.toml");
    EXPECT_EQ(found->supervisor, *identity_of(::getpid()));
    EXPECT_EQ(found->stop_patience, std::chrono::milliseconds{2500});
    EXPECT_EQ(found->programs, (std::vector<std::string>{"a", "b"}));
    EXPECT_EQ(folder.list().size(), 1u);
    const auto second = Record::create(folder, "cell");
    ASSERT_FALSE(second);
    EXPECT_NE(second.error().text().find("`rtpm down cell` ends it"), std::string::npos);
    EXPECT_TRUE(Record::create(folder, "other"));
  }
  // As after kill -9, the file exists, but no process locks it.
  EXPECT_TRUE(fs::exists(folder.record_path("cell")));
  EXPECT_FALSE(folder.find("cell"));
  EXPECT_FALSE(fs::exists(folder.record_path("cell")));
  EXPECT_TRUE(folder.list().empty());
}

TEST_F(Folder, TakesAStaleRecordOver) {
  const StateFolder folder = open();
  std::ofstream(folder.record_path("cell")) << "{\"pid\": 1, \"start_ticks\": \"x\"} rubbish";
  const auto record = Record::create(folder, "cell");
  ASSERT_TRUE(record) << record.error().text();
  record->remove();
  EXPECT_FALSE(folder.find("cell"));
}

TEST_F(Folder, ReadsADamagedRecordAsOneWithoutFacts) {
  const StateFolder folder = open();
  const auto record = Record::create(folder, "cell");
  ASSERT_TRUE(record);
  for (const char* text :
       {"", "[]", "{\"pid\": \"x\", \"file\": 3, \"programs\": [1]}", "\xff\xfe"}) {
    std::ofstream(folder.record_path("cell")) << text;
    const auto found = folder.find("cell");
    ASSERT_TRUE(found) << text;
    EXPECT_EQ(found->supervisor.id, 0);
    EXPECT_TRUE(found->programs.empty());
  }
}

}  // namespace
}  // namespace rtpm::laboratory
