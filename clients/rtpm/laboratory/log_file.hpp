#pragma once

#include <cstddef>
#include <string>
#include <string_view>

#include "laboratory/process.hpp"
#include "rtpm/base/setup_error.hpp"

namespace rtpm::laboratory {

/// A log of bounded size: beyond `kSizeMax` the file replaces FILE.1, and an empty one follows it.
/// @threads  one
class LogFile {
 public:
  static constexpr std::size_t kSizeMax = std::size_t{8} * 1024 * 1024;

  /// Opens the file to append, or makes it with its folder.
  [[nodiscard]] static expected<LogFile, SetupError> open(const std::string& path);

  /// Writes a line; a full disk loses it.
  void write(std::string_view line);

 private:
  LogFile(std::string path, Handle file, std::size_t size)
      : path_(std::move(path)), file_(std::move(file)), size_(size) {}

  std::string path_;
  Handle file_;
  std::size_t size_;
};

}  // namespace rtpm::laboratory
