#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/transport/socket.hpp"

/// A folder of UNIX sockets by whose names the programs of one user find each other on a host. The
/// file's name carries all the information; the kernel tells whether its program lives: a connect
/// is refused as soon as the socket is closed, however its program ended. Nothing is ever sent, so
/// a program that hangs delays no reader.
namespace rtpm::transport {

/// The folder of this user's sockets: $RTPM_RUNTIME_FOLDER, else "rtpm-names" in
/// $XDG_RUNTIME_DIR or /run/user/UID, else /tmp/rtpm-names-UID.
/// @realtime set-up only
[[nodiscard]] std::string runtime_folder();

/// Whether runtime_folder() is $RTPM_RUNTIME_FOLDER.
/// @realtime set-up only
[[nodiscard]] bool has_own_runtime_folder();

/// The number of this process's network namespace, in which its addresses are valid; 0 if it can't
/// be determined.
/// @realtime set-up only
[[nodiscard]] std::uint64_t network_namespace();
/// This process's id.
[[nodiscard]] std::uint32_t process_id() noexcept;

/// The size of a name in the folder, at most, in bytes.
inline constexpr std::size_t kFolderNameSizeMax = 80;

/// A socket in the folder, for as long as this object lives.
/// @threads  one at a time
class FolderSocket {
 public:
  /// Creates the folder too, for this user alone, if it does not exist.
  /// @realtime set-up only
  /// @errors   the folder is a link, is another user's, or is open to other users; the name exists
  ///           already, or is not possible as a file name
  [[nodiscard]] static expected<FolderSocket, SetupError> create(std::string folder,
                                                                 std::string name);
  FolderSocket(FolderSocket&&) noexcept = default;
  FolderSocket& operator=(FolderSocket&&) noexcept;
  ~FolderSocket();

  /// Creates the file again if it was removed, as by a cleaner of /tmp.
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
  std::vector<std::string> names{};  ///< The names of living sockets, sorted.
  std::size_t stale_count = 0;       ///< Sockets of dead programs, which were removed.
  std::size_t foreign_count = 0;     ///< Other files, and those of other users, which stay.
  bool is_cut_off = false;           ///< There were more than kFolderFileCountMax files.
};

/// The number of files of a folder that are read at most.
inline constexpr std::size_t kFolderFileCountMax = 4096;

/// Reads the folder, and removes the sockets of dead programs. A missing folder is empty.
/// @realtime set-up only
/// @errors   as FolderSocket::create()
[[nodiscard]] expected<FolderContent, SetupError> read_socket_folder(const std::string& folder);

}  // namespace rtpm::transport
