#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>

#include "rtpm/access/files.hpp"
#include "rtpm/base/expected.hpp"

/// The operating system's side of files with keys and grants. Paths are UTF-8.
namespace rtpm::access::os {

/// A file descriptor, or a handle of Windows.
using Number = std::intptr_t;
inline constexpr Number kNoFile = -1;
void close(Number number) noexcept;

/// An open file, closed on destruction.
class File {
 public:
  explicit File(Number number) noexcept : number_(number) {}
  File(File&& other) noexcept : number_(other.release()) {}
  File& operator=(File&&) = delete;
  ~File() {
    if (number_ != kNoFile) close(number_);
  }
  [[nodiscard]] Number number() const noexcept { return number_; }
  [[nodiscard]] Number release() noexcept { return std::exchange(number_, kNoFile); }

 private:
  Number number_;
};

/// The variants make a file that only this user can read and write; an existing one keeps its
/// rights.
enum class Mode {
  kRead,
  kCreate,  ///< An existing file is not opened, and no link is followed.
  kAppend,  ///< Creates a missing file; no link is followed.
};
[[nodiscard]] expected<File, std::error_code> open(const std::string& path, Mode mode);

/// Reads up to `size` bytes.
/// @return 0 at the end of the file
[[nodiscard]] expected<std::size_t, std::error_code> read(const File& file, char* to,
                                                          std::size_t size) noexcept;
/// Writes all of `text`; a full disk is an error.
[[nodiscard]] std::error_code write(Number file, std::string_view text) noexcept;
/// Waits until the disk has the file.
[[nodiscard]] std::error_code flush(const File& file) noexcept;

/// The rights of other users that make a file unusable. The system's administrators have all.
enum class Forbidden { kToWrite, kToReadOrWrite };
struct Distrust {
  std::string why;
  std::string remedy{};
};
/// Why a file is not to be trusted; nullopt if it is. Administrators may own it.
[[nodiscard]] expected<std::optional<Distrust>, std::error_code> distrust_of(
    const File& file, const std::string& path, Forbidden forbidden);
/// Whether it is a regular file of this user alone, who also owns it.
[[nodiscard]] bool is_private(Number file) noexcept;
/// How a user makes it so, as in "chmod 600 it".
[[nodiscard]] std::string_view private_remedy() noexcept;
[[nodiscard]] std::uint64_t size_of(Number file) noexcept;

void remove(const std::string& path) noexcept;
/// Replaces `to`, if it exists.
[[nodiscard]] std::error_code rename(const std::string& from, const std::string& to) noexcept;

/// Creates missing folders; the last of them is for this user alone.
[[nodiscard]] std::error_code make_folder_of(const std::string& path);
/// Resolves links in a path whose last part need not exist.
[[nodiscard]] expected<std::string, std::error_code> real_path_of(const std::string& path);

/// Locks a file for its change, and creates it if the system locks files themselves.
/// @return nullopt while another program has the lock
[[nodiscard]] expected<std::optional<File>, std::error_code> lock(const std::string& path);
/// Replaces a locked file, keeping its rights and owner.
/// @return whether it did: a reader may hinder it for a moment
[[nodiscard]] expected<bool, std::error_code> replace(const File& locked, const std::string& path,
                                                      std::string_view text);
void pause() noexcept;

/// A variable of the environment; empty if it is not set.
[[nodiscard]] std::string variable(const char* name);
/// The folder for keys that RTPM_KEYS does not name; empty if the environment does not tell.
[[nodiscard]] std::string default_key_folder();
/// The variables that tell it, as in "XDG_CONFIG_HOME and HOME".
[[nodiscard]] std::string_view key_folder_variables() noexcept;

[[nodiscard]] FileStamp stamp_of(const std::string& path) noexcept;
[[nodiscard]] std::string user_at_host();
[[nodiscard]] std::uint32_t this_user() noexcept;

/// The bytes of a numeric IPv6 (16) or IPv4 address (4).
[[nodiscard]] bool parse_ipv6(const std::string& text, std::uint8_t* to) noexcept;
[[nodiscard]] bool parse_ipv4(const std::string& text, std::uint8_t* to) noexcept;

}  // namespace rtpm::access::os
