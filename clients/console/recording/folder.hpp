#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <mutex>
#include <string>
#include <string_view>
#include <vector>

#include "rtpm/base/setup_error.hpp"

namespace rtpm::console {

/// The metadata of a recording that was made in a session.
inline constexpr std::string_view kSessionMetadata = "rtpm.session";

/// A recording in the folder. An incomplete one states no times and counts.
struct RecordingFile {
  std::string file{};
  std::uint64_t byte_count = 0;
  std::uint64_t begin_ns = 0;
  std::uint64_t end_ns = 0;
  std::uint64_t message_count = 0;
  bool is_complete = false;
  /// The metadata of its session; empty if it was made in none.
  std::map<std::string, std::string> session{};
};

/// The recordings of a folder, sorted by name.
struct RecordingList {
  std::vector<RecordingFile> files{};
  std::size_t omitted_count = 0;  ///< The oldest, beyond RecordingFolder::kFileCountMax.
};

/// A recording that was deleted, and can be restored.
struct DeletedRecording {
  std::string id{};
  std::string file{};
  std::uint64_t deleted_ns = 0;  ///< Since 1970 in UTC.
  std::uint64_t byte_count = 0;
};

/// The folder of recordings. Browsers name files in it, never paths. A recording's notes go with
/// it.
/// @threads  any
class RecordingFolder {
 public:
  static constexpr std::size_t kFileCountMax = 2000;
  /// Deleted recordings are kept for so long, if there are no more, and they take no more.
  static constexpr std::uint64_t kKeptNs = std::uint64_t{30} * 24 * 3600 * 1'000'000'000;
  static constexpr std::size_t kDeletedCountMax = 200;
  static constexpr std::uint64_t kDeletedByteMax = std::uint64_t{64} << 30;

  explicit RecordingFolder(std::filesystem::path folder) : folder_(std::move(folder)) {}

  /// Omits files that are not recordings or not regular.
  [[nodiscard]] RecordingList list();
  /// The path of a file that a browser names.
  /// @errors   a name with characters other than letters, digits, '.', '_', '-'; not "….mcap"
  [[nodiscard]] expected<std::filesystem::path, SetupError> path_of(std::string_view file) const;

  /// @errors   those of path_of(); no such file; the new name exists; the operating system's
  [[nodiscard]] expected<void, SetupError> rename(std::string_view file, std::string_view name);
  /// Moves a recording to the deleted ones, in ".deleted" of the folder.
  /// @return   the id for restore()
  /// @errors   those of path_of(); no such file; the operating system's
  [[nodiscard]] expected<std::string, SetupError> remove(std::string_view file,
                                                         std::uint64_t now_ns);
  /// Moves a deleted recording back.
  /// @return   its name
  /// @errors   no such id; its name exists; the operating system's
  [[nodiscard]] expected<std::string, SetupError> restore(std::string_view id);
  /// The deleted recordings, the newest first.
  [[nodiscard]] std::vector<DeletedRecording> deleted() const;
  /// Removes deleted recordings that are too old, and the oldest of too many or too large ones; the
  /// newest always stays.
  /// @return   the names of those that are gone for good
  std::vector<std::string> purge(std::uint64_t now_ns);
  /// Removes all deleted recordings.
  /// @return   how many
  std::size_t purge_all();

 private:
  struct Known {
    std::uint64_t byte_count = 0;
    std::filesystem::file_time_type time{};
    RecordingFile file{};
  };
  [[nodiscard]] std::filesystem::path deleted_folder() const { return folder_ / ".deleted"; }

  std::filesystem::path folder_;
  mutable std::mutex mutex_{};
  std::map<std::string, Known> known_{};  ///< Guarded by `mutex_`.
};

}  // namespace rtpm::console
