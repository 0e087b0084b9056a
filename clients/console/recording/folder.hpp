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

/// A recording in the folder. An incomplete one states no times and counts.
struct RecordingFile {
  std::string file{};
  std::uint64_t byte_count = 0;
  std::uint64_t begin_ns = 0;
  std::uint64_t end_ns = 0;
  std::uint64_t message_count = 0;
  bool is_complete = false;
};

/// The folder of recordings. Browsers name files in it, never paths.
/// @threads  any
class RecordingFolder {
 public:
  explicit RecordingFolder(std::filesystem::path folder) : folder_(std::move(folder)) {}

  /// The recordings, sorted by name; at most 200. Omits files that are not recordings or not
  /// regular.
  [[nodiscard]] std::vector<RecordingFile> list();
  /// The path of a file that a browser names.
  /// @errors   a name with characters other than letters, digits, '.', '_', '-'; not "….mcap"
  [[nodiscard]] expected<std::filesystem::path, SetupError> path_of(std::string_view file) const;

 private:
  struct Known {
    std::uint64_t byte_count = 0;
    std::filesystem::file_time_type time{};
    RecordingFile file{};
  };
  std::filesystem::path folder_;
  std::mutex mutex_{};
  std::map<std::string, Known> known_{};  ///< Guarded by `mutex_`.
};

}  // namespace rtpm::console
