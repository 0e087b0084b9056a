#pragma once

#include <optional>
#include <string>

#include "rtpm/base/bytes.hpp"
#include "rtpm/base/setup_error.hpp"

namespace rtpm::recording {

/// A file that grows at its end. What an append could not write whole is cut off again, so that the
/// file ends behind a whole record.
/// @ownership owns the descriptor
class OutputFile {
 public:
  [[nodiscard]] static expected<OutputFile, SetupError> create(const std::string& path);
  OutputFile(OutputFile&& other) noexcept;
  OutputFile& operator=(OutputFile&&) = delete;
  ~OutputFile();

  /// @errors   the disk is full, …; then every further append fails with the same
  [[nodiscard]] expected<void, SetupError> append(ConstBytes bytes);
  /// Hands all to the disk and closes.
  [[nodiscard]] expected<void, SetupError> close();

  [[nodiscard]] std::uint64_t size() const noexcept { return size_; }
  [[nodiscard]] bool is_open() const noexcept { return descriptor_ >= 0; }

 private:
  OutputFile(std::string path, int descriptor) noexcept;
  [[nodiscard]] unexpected<SetupError> fail(int error);

  std::string path_;
  int descriptor_;
  std::uint64_t size_ = 0;
  std::optional<SetupError> failure_{};
};

}  // namespace rtpm::recording
