#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/recording/file_writer.hpp"

namespace rtpm::recording {

/// A new recording that has a temporary name until it is complete.
/// @ownership owns its file, and removes it unless finish() was called
class NewRecording {
 public:
  /// @errors   the file exists, or cannot be written
  [[nodiscard]] static expected<NewRecording, SetupError> create(const std::string& path);
  NewRecording(NewRecording&&) noexcept = default;
  NewRecording& operator=(NewRecording&&) = delete;
  ~NewRecording();

  [[nodiscard]] FileWriter& writer() noexcept { return *writer_; }
  /// Renames the file to its final name.
  /// @return   the number of messages that it has
  [[nodiscard]] expected<std::uint64_t, SetupError> finish();

 private:
  explicit NewRecording(std::string path) noexcept : path_(std::move(path)) {}
  [[nodiscard]] std::string draft() const { return path_ + ".part"; }

  std::string path_;
  std::unique_ptr<FileWriter> writer_{};
};

}  // namespace rtpm::recording
