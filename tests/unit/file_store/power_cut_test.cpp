#include <gtest/gtest.h>

#include <cstdint>
#include <fstream>
#include <map>
#include <random>
#include <string>
#include <vector>

#include "folder.hpp"
#include "recording_vfs.hpp"
#include "rtpm/file_store/file_storage.hpp"

// The power fails between any two writes: no acknowledged change is lost, and none comes back.
namespace rtpm::file_store {
namespace {

using State = std::map<std::string, std::uint64_t>;  ///< Names with their changes.

constexpr int kChangeCount = 24;

/// Binds and unbinds a few names; writes a mark to the log for each acknowledgement.
std::vector<State> run_changes(const std::string& path, RecordingVfs& vfs) {
  std::vector<State> states(1);
  std::mt19937 random(1);
  const auto storage = make_file_storage(path, vfs.name());
  EXPECT_TRUE(storage->load());
  for (std::uint64_t i = 1; i <= kChangeCount; ++i) {
    State next = states.back();
    const std::string name = "lab/arm" + std::to_string(random() % 5);
    if (next.contains(name) && random() % 2 == 0) {
      next.erase(name);
      EXPECT_TRUE(storage->commit({name, nullptr, i, true}));
    } else {
      next[name] = i;
      EXPECT_TRUE(put(*storage, permanent(name, i)));
    }
    vfs.add({FileOperation::Kind::kMark});
    states.push_back(std::move(next));
  }
  return states;
}

/// The state that a registry finds if it starts with these files.
State found_in(const DiskImage::Files& files, const std::string& original) {
  const Folder folder;
  for (const auto& [path, bytes] : files) {
    // "names.db", "names.db-wal"
    const std::string copy = folder.file() + path.substr(original.size());
    std::ofstream(copy, std::ios::binary)
        .write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  }
  State state;
  const auto storage = make_file_storage(folder.file());
  const auto content = storage->load();
  EXPECT_TRUE(content) << content.error().text();
  if (!content) return state;
  for (const std::string& fault : content->faults)
    ADD_FAILURE() << fault;
  for (const names::StoredName& stored : content->names)
    state[stored.name] = stored.change;
  EXPECT_TRUE(put(*storage, permanent("lab/next", 1000))) << "it goes on";
  return state;
}

TEST(PowerCut, KeepsExactlyTheAcknowledgedChanges) {
  const Folder folder;
  RecordingVfs vfs("rtpm-recording");
  const std::vector<State> states = run_changes(folder.file(), vfs);
  std::mt19937 random(7);
  DiskImage disk;
  std::size_t acknowledged = 0;
  std::size_t cut_count = 0;
  for (const FileOperation& operation : vfs.log()) {
    disk.apply(operation);
    if (operation.kind == FileOperation::Kind::kMark) ++acknowledged;
    for (int variant = 0; variant < 3; ++variant) {
      const auto files = disk.after_power_cut(
          [&] { return variant == 0 ? false : variant == 1 || random() % 2 == 0; });
      const State found = found_in(files, folder.file());
      // The change in progress may be stored or not.
      const bool is_next = acknowledged + 1 < states.size() && found == states[acknowledged + 1];
      ASSERT_TRUE(found == states[acknowledged] || is_next)
          << "variant " << variant << " after " << acknowledged << " acknowledged changes";
      ++cut_count;
    }
  }
  EXPECT_EQ(acknowledged, static_cast<std::size_t>(kChangeCount));
  RecordProperty("power_cuts", static_cast<int>(cut_count));
}

}  // namespace
}  // namespace rtpm::file_store
