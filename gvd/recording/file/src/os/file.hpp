#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <system_error>
#include <utility>

#include "rtpm/base/bytes.hpp"
#include "rtpm/base/expected.hpp"

/// The operating system's side of a recording's file. Paths are UTF-8.
namespace rtpm::recording::os {

/// A file descriptor, or a handle of Windows.
using Number = std::intptr_t;
inline constexpr Number kNoFile = -1;
void close(Number number) noexcept;

/// An open file, closed on destruction.
class File {
 public:
  explicit File(Number number = kNoFile) noexcept : number_(number) {}
  File(File&& other) noexcept : number_(std::exchange(other.number_, kNoFile)) {}
  File& operator=(File&&) = delete;
  ~File() { reset(); }
  void reset() noexcept {
    if (number_ != kNoFile) close(std::exchange(number_, kNoFile));
  }
  [[nodiscard]] Number number() const noexcept { return number_; }
  [[nodiscard]] bool is_open() const noexcept { return number_ != kNoFile; }

 private:
  Number number_;
};

struct Input {
  File file{};  ///< Not open: it is a pipe, a device or a folder.
  std::uint64_t size = 0;
};
/// Opens a file to read; never waits for the writer of a pipe.
[[nodiscard]] expected<Input, std::error_code> open_input(const std::string& path);
/// Reads up to `to.size()` bytes from `offset` on.
/// @return 0 behind the end of the file
[[nodiscard]] expected<std::size_t, std::error_code> read_at(const File& file, std::uint64_t offset,
                                                             MutableBytes to) noexcept;

/// Creates a file; an existing one is an error.
[[nodiscard]] expected<File, std::error_code> create(const std::string& path);
/// Writes all of `bytes` at the end.
[[nodiscard]] std::error_code append(const File& file, ConstBytes bytes) noexcept;
/// Cuts the end off, so that the next bytes follow the first `size`.
void cut(const File& file, std::uint64_t size) noexcept;
/// Waits until the disk has the file; no error on a disk that can't tell.
[[nodiscard]] std::error_code flush(const File& file) noexcept;
/// Whether there is no room: on the disk, in the user's share of it, or within the process's limit.
[[nodiscard]] bool is_full(const std::error_code& error) noexcept;

}  // namespace rtpm::recording::os
