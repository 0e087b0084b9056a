#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "rtpm/base/expected.hpp"
#include "rtpm/base/setup_error.hpp"

namespace rtpm::access {

/// A file of lines that only its owner can read, mode 0600. At its maximum size it is renamed, with
/// ".1" appended, replacing an older one, and a new file is started.
/// @threads  one at a time
/// @realtime set-up only
class LogFile {
 public:
  static constexpr std::uint64_t kSizeMax = 16 * 1024 * 1024;

  /// Opens the file for appending, or creates it.
  /// @errors   it can't be opened, is not a regular file, belongs to another user, or is open to
  ///           others
  [[nodiscard]] static expected<LogFile, SetupError> open(std::string path,
                                                          std::uint64_t size_max = kSizeMax);
  LogFile(LogFile&& other) noexcept;
  LogFile& operator=(LogFile&&) = delete;
  ~LogFile();

  /// @errors   the system's error, such as a full disk: the line is lost
  [[nodiscard]] expected<void, SetupError> write_line(std::string_view line);

 private:
  LogFile(std::string path, std::uint64_t size_max) noexcept;
  [[nodiscard]] expected<void, SetupError> reopen();

  std::string path_;
  std::uint64_t size_max_;
  std::intptr_t number_ = -1;  ///< The system's number of the open file.
  std::uint64_t size_ = 0;
};

}  // namespace rtpm::access
