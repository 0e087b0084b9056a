#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/transport/socket.hpp"

/// A folder of UNIX sockets by whose names the programs of one user find each other on a host.
/// What there is to say stands in the file's name; whether its program lives is the kernel's
/// record: a connect is refused as soon as the socket is closed, however its program ended. Nothing
/// is ever sent, so that a program that hangs holds up nobody who looks.
namespace rtpm::transport {

/// Where the programs of this user have their sockets: $RTPM_RUNTIME_FOLDER, else "rtpm-names" in
/// $XDG_RUNTIME_DIR or /run/user/UID, else /tmp/rtpm-names-UID.
/// @realtime set-up only
[[nodiscard]] std::string runtime_folder();

/// Whether that is $RTPM_RUNTIME_FOLDER.
/// @realtime set-up only
[[nodiscard]] bool has_own_runtime_folder();

/// The number of this process's network namespace, in which its addresses mean something; 0 if the
/// system does not tell.
/// @realtime set-up only
[[nodiscard]] std::uint64_t network_namespace();
/// The number of this process.
[[nodiscard]] std::uint32_t process_id() noexcept;

/// How many bytes a name in the folder has at most.
inline constexpr std::size_t kFolderNameSizeMax = 80;

/// A socket in the folder, for as long as this object lives.
/// @threads  one at a time
class FolderSocket {
 public:
  /// Makes the folder too, for this user alone, if it is not there.
  /// @realtime set-up only
  /// @errors   the folder is a link, is another user's, or is open to others; the name is there
  ///           already, or has no place in a file name
  [[nodiscard]] static expected<FolderSocket, SetupError> create(std::string folder,
                                                                 std::string name);
  FolderSocket(FolderSocket&&) noexcept = default;
  FolderSocket& operator=(FolderSocket&&) noexcept;
  ~FolderSocket();

  /// Makes the file again if somebody removed it, as cleaners of /tmp do.
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

/// What a folder holds.
struct FolderContent {
  std::vector<std::string> names{};  ///< Of living sockets, sorted.
  std::size_t stale_count = 0;       ///< Sockets of dead programs, which were removed.
  std::size_t foreign_count = 0;     ///< Other files, and those of other users, which stay.
  bool is_cut_off = false;           ///< There were more files than anybody reads.
};

/// How many files of a folder are read.
inline constexpr std::size_t kFolderFileCountMax = 4096;

/// Reads the folder, and removes the sockets of dead programs. One that is not there is empty.
/// @realtime set-up only
/// @errors   as FolderSocket::create()
[[nodiscard]] expected<FolderContent, SetupError> read_socket_folder(const std::string& folder);

}  // namespace rtpm::transport
