#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/transport/socket.hpp"

/// A folder of UNIX sockets through whose names the programs of one user find each other on a host.
/// The file name carries all the information; the kernel tells whether its program is alive: it
/// refuses a connect as soon as the socket is closed, however the program ended. Nothing is ever
/// sent, so a program that hangs delays no reader. On Windows, files that the system deletes when
/// their programs end take the place of the sockets.
namespace rtpm::transport {

/// The folder of this user's sockets: $RTPM_RUNTIME_FOLDER, otherwise "rtpm-names" in
/// $XDG_RUNTIME_DIR or /run/user/UID, otherwise /tmp/rtpm-names-UID; on Windows otherwise
/// %LOCALAPPDATA%\rtpm\run.
/// @realtime set-up only
[[nodiscard]] std::string runtime_folder();

/// Whether runtime_folder() is $RTPM_RUNTIME_FOLDER.
/// @realtime set-up only
[[nodiscard]] bool has_own_runtime_folder();

/// The id of this process's network namespace, in which its addresses are valid; 0 if it can't be
/// determined.
/// @realtime set-up only
[[nodiscard]] std::uint64_t network_namespace();
/// This process's id.
[[nodiscard]] std::uint32_t process_id() noexcept;

/// The maximum size of a name in the folder, in bytes.
inline constexpr std::size_t kFolderNameSizeMax = 80;

/// A socket in the folder, which exists as long as this object.
/// @threads  one at a time
class FolderSocket {
 public:
  /// Creates the socket, and the folder, for this user only, if it does not exist.
  /// @realtime set-up only
  /// @errors   the folder is a link, belongs to another user, or is open to other users; the name
  ///           exists already, or can't be a file name. Windows does not tell of other users
  [[nodiscard]] static expected<FolderSocket, SetupError> create(std::string folder,
                                                                 std::string name);
  FolderSocket(FolderSocket&&) noexcept = default;
  FolderSocket& operator=(FolderSocket&&) noexcept;
  ~FolderSocket();

  /// Re-creates the file if it was removed, for example by a cleaner of /tmp.
  /// @realtime set-up only
  void keep();

 private:
  FolderSocket(std::string folder, std::string name, Descriptor socket) noexcept
      : folder_(std::move(folder)), name_(std::move(name)), socket_(std::move(socket)) {}
  void remove() noexcept;

  std::string folder_;
  std::string name_;
  Descriptor socket_;
};

/// The contents of a folder.
struct FolderContent {
  std::vector<std::string> names{};  ///< The names of live sockets, sorted.
  std::size_t stale_count = 0;       ///< Sockets of dead programs, which were removed.
  std::size_t foreign_count = 0;     ///< Other files, and files of other users, which are kept.
  bool is_cut_off = false;           ///< There were more than kFolderFileCountMax files.
};

/// The most files of a folder that are read.
inline constexpr std::size_t kFolderFileCountMax = 4096;

/// Reads the folder, and removes the sockets of dead programs. A missing folder is empty.
/// @realtime set-up only
/// @errors   those of FolderSocket::create()
[[nodiscard]] expected<FolderContent, SetupError> read_socket_folder(const std::string& folder);

}  // namespace rtpm::transport
