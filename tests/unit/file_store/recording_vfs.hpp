#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <vector>

namespace rtpm::file_store {

/// One operation of a database on its files, or a mark of the test.
struct FileOperation {
  enum class Kind : std::uint8_t { kWrite, kTruncate, kSync, kDelete, kMark };
  Kind kind = Kind::kMark;
  std::string path{};
  std::uint64_t offset = 0;  ///< The size if truncated; 1 if deleted and synced.
  std::string bytes{};
};

/// A file system for SQLite that passes everything to the system's, and logs it.
/// @threads  one at a time
class RecordingVfs {
 public:
  explicit RecordingVfs(std::string name);
  RecordingVfs(const RecordingVfs&) = delete;
  RecordingVfs& operator=(const RecordingVfs&) = delete;
  ~RecordingVfs();

  [[nodiscard]] const std::string& name() const noexcept { return name_; }
  [[nodiscard]] const std::vector<FileOperation>& log() const noexcept { return log_; }
  void add(FileOperation operation) { log_.push_back(std::move(operation)); }
  /// Makes the disk full from now on, or not full.
  void set_full(bool is_full) noexcept { is_full_ = is_full; }
  [[nodiscard]] bool is_full() const noexcept { return is_full_; }

 private:
  struct Registered;
  std::string name_;
  std::vector<FileOperation> log_{};
  bool is_full_ = false;
  std::unique_ptr<Registered> registered_;
};

/// The files after a power cut: all synced data; for the rest `keep` decides for each sector of 512
/// bytes and each other operation.
class DiskImage {
 public:
  void apply(const FileOperation& operation);
  using Files = std::map<std::string, std::string>;
  template <class Keep>
  [[nodiscard]] Files after_power_cut(Keep keep) const {
    Files files = synced_;
    for (const FileOperation& operation : pending_) {
      if (operation.kind != FileOperation::Kind::kWrite) {
        if (keep()) apply_to(files, operation);
        continue;
      }
      constexpr std::uint64_t kSectorSize = 512;
      for (std::uint64_t done = 0; done < operation.bytes.size();) {
        const std::uint64_t at = operation.offset + done;
        const std::uint64_t size =
            std::min(kSectorSize - at % kSectorSize, operation.bytes.size() - done);
        FileOperation sector = operation;
        sector.offset = at;
        sector.bytes = operation.bytes.substr(done, size);
        if (keep()) apply_to(files, sector);
        done += size;
      }
    }
    return files;
  }

 private:
  static void apply_to(Files& files, const FileOperation& operation);
  Files synced_{};
  std::vector<FileOperation> pending_{};
};

}  // namespace rtpm::file_store
