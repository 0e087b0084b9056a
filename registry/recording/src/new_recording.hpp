#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/recording/file_writer.hpp"

namespace rtpm::recording {

/// A new recording under another name until it is whole.
/// @ownership owns its file, and removes it unless finish() was called
class NewRecording {
 public:
  /// @errors   the file exists, or can't be written
  [[nodiscard]] static expected<NewRecording, SetupError> create(const std::string& path);
  NewRecording(NewRecording&&) noexcept = default;
  NewRecording& operator=(NewRecording&&) = delete;
  ~NewRecording();

  [[nodiscard]] FileWriter& writer() noexcept { return *writer_; }
  /// Gives it its name.
  /// @return   how many messages it has
  [[nodiscard]] expected<std::uint64_t, SetupError> finish();

 private:
  explicit NewRecording(std::string path) noexcept : path_(std::move(path)) {}
  [[nodiscard]] std::string draft() const { return path_ + ".part"; }

  std::string path_;
  std::unique_ptr<FileWriter> writer_{};
};

}  // namespace rtpm::recording
