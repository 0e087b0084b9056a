#include <gtest/gtest.h>

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <set>
#include <string>

#include "folder.hpp"
#include "recording_vfs.hpp"
#include "rtpm/file_store/file_storage.hpp"

// Damaged databases, and full disks.
namespace rtpm::file_store {
namespace {

constexpr int kNameCount = 400;

class Damage : public testing::Test {
 protected:
  void SetUp() override {
    const auto storage = make_file_storage(folder_.file());
    ASSERT_TRUE(storage->load());
    for (int i = 0; i < kNameCount; ++i) {
      names::StoredName stored = permanent("lab/arm" + std::to_string(i), 1);
      stored.change = static_cast<std::uint64_t>(i) + 1;
      ASSERT_TRUE(storage->commit({stored.name, &stored, stored.change, false}));
    }
  }
  void overwrite(std::uint64_t offset, const std::string& bytes) {
    std::fstream file(folder_.file(), std::ios::in | std::ios::out | std::ios::binary);
    file.seekp(static_cast<std::streamoff>(offset));
    file.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  }
  /// The number of names left; they must be sound, and no change is possible.
  std::size_t sound_count() {
    const auto storage = make_file_storage(folder_.file());
    const auto content = storage->load();
    EXPECT_TRUE(content) << content.error().text();
    if (!content) return 0;
    EXPECT_FALSE(content->faults.empty());
    std::set<std::string> seen;
    for (const names::StoredName& stored : content->names) {
      EXPECT_TRUE(seen.insert(stored.name).second) << stored.name;
      EXPECT_EQ(stored.properties, permanent("", 1).properties);
    }
    const auto refused = put(*storage, permanent("lab/new", 9999));
    EXPECT_FALSE(refused);
    EXPECT_TRUE(refused || refused.error().kind == names::StorageError::Kind::kReadOnly);
    return content->names.size();
  }

  Folder folder_;
};

TEST_F(Damage, ToOneByteLosesOneRow) {
  std::ifstream file(folder_.file(), std::ios::binary);
  const std::string bytes{std::istreambuf_iterator<char>(file), {}};
  const std::size_t at = bytes.find("rtpm://10.0.0.1");
  ASSERT_NE(at, std::string::npos);
  overwrite(at + 9, "X");
  EXPECT_EQ(sound_count(), static_cast<std::size_t>(kNameCount) - 1);
}

TEST_F(Damage, ToAPageKeepsTheOtherPages) {
  const auto size = std::filesystem::file_size(folder_.file());
  overwrite(size / 2 / 4096 * 4096, std::string(4096, '\x5a'));
  const std::size_t count = sound_count();
  EXPECT_LE(count, static_cast<std::size_t>(kNameCount));
  EXPECT_GT(count, static_cast<std::size_t>(kNameCount) / 2);
}

TEST_F(Damage, ByTruncationKeepsTheRemainder) {
  std::filesystem::resize_file(folder_.file(), std::filesystem::file_size(folder_.file()) * 2 / 3);
  EXPECT_LT(sound_count(), static_cast<std::size_t>(kNameCount));
}

TEST_F(Damage, ToTheHeaderLosesEverythingAndIsReported) {
  overwrite(0, std::string(200, 'x'));
  EXPECT_EQ(sound_count(), 0u);
}

TEST(FullDisk, RefusesChangesUntilThereIsSpace) {
  const Folder folder;
  RecordingVfs disk("rtpm-full");
  const auto storage = make_file_storage(folder.file(), disk.name());
  ASSERT_TRUE(storage->load());
  ASSERT_TRUE(put(*storage, permanent("lab/arm0", 1)));
  disk.set_full(true);
  const auto refused = put(*storage, permanent("lab/arm1", 2));
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().kind, names::StorageError::Kind::kFull);
  test::expect_text(refused.error().text(), {"free some space"});
  disk.set_full(false);
  ASSERT_TRUE(put(*storage, permanent("lab/arm2", 3)));
}

// As after `kill -9`, the log exists, and the first write of the next start finds no space.
TEST(FullDisk, AtTheStartServesNamesAndRefusesChangesUntilThereIsSpace) {
  const Folder folder;
  RecordingVfs disk("rtpm-full-start");
  ASSERT_TRUE(make_file_storage(folder.file(), disk.name())->load());
  std::uint64_t first_revision = 0;
  {
    const auto storage = make_file_storage(folder.file(), disk.name());
    ASSERT_TRUE(storage->load());
    ASSERT_TRUE(put(*storage, permanent("lab/arm0", 1)));
  }
  disk.set_full(true);
  const auto storage = make_file_storage(folder.file(), disk.name());
  const auto content = storage->load();
  ASSERT_TRUE(content) << content.error().text();
  first_revision = content->first_revision;
  ASSERT_EQ(content->names.size(), 1u);
  EXPECT_EQ(content->names[0], permanent("lab/arm0", 1));
  ASSERT_EQ(content->faults.size(), 1u);
  test::expect_text(content->faults[0],
                    {"can't be written", "full", "Its names are served", "free some space"});
  for (int i = 0; i < 2; ++i) {
    const auto refused = put(*storage, permanent("lab/arm1", first_revision));
    ASSERT_FALSE(refused);
    EXPECT_EQ(refused.error().kind, names::StorageError::Kind::kFull);
  }
  disk.set_full(false);
  ASSERT_TRUE(put(*storage, permanent("lab/arm1", first_revision)));
  const auto next = make_file_storage(folder.file(), disk.name());
  EXPECT_FALSE(next->load()) << "the first one has it open";
}

// A file of shared memory would take space, which a full disk does not have.
TEST(FullDisk, CanStillBeRead) {
  const Folder folder;
  {
    const auto storage = make_file_storage(folder.file());
    ASSERT_TRUE(storage->load());
    ASSERT_TRUE(put(*storage, permanent("lab/arm0", 1)));
  }
  const auto storage = make_file_storage(folder.file());
  ASSERT_TRUE(storage->load());
  EXPECT_FALSE(std::filesystem::exists(folder.file("names.db-shm")));
}

// A restored copy is another file, too.
TEST(Deleted, OrReplacedDatabaseRefusesChanges) {
  for (const char* const fate : {"names.db", "names.db-wal", "replaced"}) {
    const Folder folder;
    const auto storage = make_file_storage(folder.file());
    ASSERT_TRUE(storage->load());
    ASSERT_TRUE(put(*storage, permanent("lab/arm0", 1)));
    if (fate == std::string("replaced")) {
      std::filesystem::copy_file(folder.file(), folder.file("copy"));
      std::filesystem::rename(folder.file("copy"), folder.file());
    } else {
      ASSERT_TRUE(std::filesystem::remove(folder.file(fate))) << fate;
    }
    for (int i = 0; i < 2; ++i) {
      const auto refused = put(*storage, permanent("lab/arm1", 2));
      ASSERT_FALSE(refused) << fate;
      EXPECT_EQ(refused.error().kind, names::StorageError::Kind::kReadOnly);
      test::expect_text(refused.error().text(), {"was deleted or replaced"});
    }
  }
}

}  // namespace
}  // namespace rtpm::file_store
