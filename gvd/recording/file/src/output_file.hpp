#pragma once

#include <optional>
#include <string>

#include "os/file.hpp"
#include "rtpm/base/bytes.hpp"
#include "rtpm/base/setup_error.hpp"

namespace rtpm::recording {

/// An append-only file. After a failed append the incomplete part is truncated, so the file ends
/// with a complete record.
/// @ownership owns the open file
class OutputFile {
 public:
  [[nodiscard]] static expected<OutputFile, SetupError> create(const std::string& path);

  /// @errors   the disk is full, …; then every further append fails with the same error
  [[nodiscard]] expected<void, SetupError> append(ConstBytes bytes);
  /// Flushes everything to the disk and closes the file.
  [[nodiscard]] expected<void, SetupError> close();

  [[nodiscard]] std::uint64_t size() const noexcept { return size_; }
  [[nodiscard]] bool is_open() const noexcept { return file_.is_open(); }

 private:
  OutputFile(std::string path, os::File file) noexcept;
  [[nodiscard]] unexpected<SetupError> fail(const std::error_code& error);

  std::string path_;
  os::File file_;
  std::uint64_t size_ = 0;
  std::optional<SetupError> failure_{};
};

}  // namespace rtpm::recording
