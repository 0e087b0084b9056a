#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "rtpm/base/expected.hpp"
#include "rtpm/base/setup_error.hpp"
#include "rtpm/crypto/primitives.hpp"

namespace rtpm::access {

/// The folder of this user's keys and grants: $RTPM_KEYS, otherwise $XDG_CONFIG_HOME/rtpm,
/// otherwise ~/.config/rtpm.
/// @realtime set-up only
/// @errors   none of these variables is set
[[nodiscard]] expected<std::string, SetupError> key_folder();

/// The names of the files in key_folder().
inline constexpr std::string_view kKeyFile = "key";
inline constexpr std::string_view kAuthorizedFile = "authorized";
inline constexpr std::string_view kKnownServersFile = "known_servers";

/// Returns `given` or, if that is empty, the file of this name in key_folder().
/// @realtime set-up only
/// @errors   those of key_folder()
[[nodiscard]] expected<std::string, SetupError> key_file_path(const std::string& given,
                                                              std::string_view name);

/// The maximum size of a file; a larger one is refused.
inline constexpr std::size_t kFileSizeMax = 1024 * 1024;

/// Creates a key and its file, "rtpm25519 BASE64 comment", which only its owner can read. Also
/// creates the folder, with mode 0700.
/// @param comment  one line, such as "alice@lab"
/// @realtime set-up only: waits for the disk
/// @errors   the file exists already, and is kept; the system's error
[[nodiscard]] expected<crypto::KeyPair, SetupError> make_key(const std::string& path,
                                                             std::string_view comment);

/// Reads the key in a file.
/// @realtime set-up only
/// @errors   no such file; others can read or write it; its owner is neither this user nor root;
///           not a regular file; no key in it
[[nodiscard]] expected<crypto::KeyPair, SetupError> read_key(const std::string& path);

/// The comment after the key in a file; empty if there is none or read_key() refuses the file.
/// @realtime set-up only
[[nodiscard]] std::string key_comment(const std::string& path);

/// The content of a file of grants or known servers; a missing file counts as empty.
/// @realtime set-up only
/// @errors   others can write the file; its owner is neither this user nor root; not a regular
///           file; more than kFileSizeMax bytes
[[nodiscard]] expected<std::string, SetupError> read_trusted_file(const std::string& path);

/// Identifies a file's content without reading it.
struct FileStamp {
  std::uint64_t file_number = 0;  ///< The inode; 0 if there is no file.
  std::int64_t changed_ns = 0;
  std::int64_t size = 0;
  [[nodiscard]] bool is_of_file() const noexcept { return file_number != 0; }
  friend bool operator==(const FileStamp&, const FileStamp&) = default;
};
/// @realtime set-up only
[[nodiscard]] FileStamp stamp_of(const std::string& path) noexcept;

/// "alice@lab": this user and this host, as the comment of a key.
/// @realtime set-up only
[[nodiscard]] std::string user_at_host();

/// The id of the user with whose rights this program runs.
[[nodiscard]] std::uint32_t this_user() noexcept;

}  // namespace rtpm::access
