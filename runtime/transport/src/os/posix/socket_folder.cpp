#include "rtpm/transport/socket_folder.hpp"

#include <dirent.h>
#include <fcntl.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstddef>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <string_view>
#include <utility>

#include "os/folder_path.hpp"
#include "os/native_socket.hpp"

namespace rtpm::transport {
namespace {

constexpr mode_t kOwnerOnly = 0700;
constexpr mode_t kOthers = 0077;

constexpr const char* kFolderName = "rtpm-names";
constexpr const char* kVariable = "RTPM_RUNTIME_FOLDER";

std::string_view variable(const char* name) {
  const char* const value = std::getenv(name);
  return value == nullptr ? std::string_view{} : std::string_view(value);
}

unexpected<SetupError> unusable(const std::string& folder, const std::string& why,
                                const std::string& remedy) {
  return setup_error("the folder " + folder +
                         ", by which the programs of a host find each other, "
                         "can't be used",
                     why, remedy);
}

unexpected<SetupError> failed(const std::string& folder, int error) {
  const char* const remedy = "set RTPM_RUNTIME_FOLDER to a folder of your own";
  if (error == ELOOP || error == ENOTDIR) {
    return unusable(folder, "it is a link or no folder", remedy);
  }
  return unusable(folder, std::strerror(error), remedy);
}

struct OpenFolder {
  std::string path;
  Descriptor descriptor{};
};

/// Opens the folder, so that it can't be replaced meanwhile. Not open if there is none.
expected<OpenFolder, SetupError> open_folder(const std::string& folder, bool makes) {
  if (makes && mkdir(folder.c_str(), kOwnerOnly) != 0 && errno != EEXIST) {
    return failed(folder, errno);
  }
  Descriptor opened(open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC));
  if (!opened.is_open()) {
    if (errno == ENOENT) return OpenFolder{folder};
    return failed(folder, errno);
  }
  struct stat status {};
  if (fstat(opened.number(), &status) != 0) return failed(folder, errno);
  if (status.st_uid != geteuid()) {
    return unusable(folder, "it belongs to user " + std::to_string(status.st_uid),
                    "set RTPM_RUNTIME_FOLDER to a folder of your own");
  }
  if ((status.st_mode & kOthers) != 0) {
    return unusable(folder, "others may enter it", "chmod 700 " + folder);
  }
  return OpenFolder{folder, std::move(opened)};
}

sockaddr_un address_in(const OpenFolder& folder, std::string_view name, socklen_t& size) {
  const std::string path =
      os::short_path_of(folder.descriptor.number(), folder.path) + "/" + std::string(name);
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  const std::size_t length = std::min(path.size(), sizeof address.sun_path - 1);
  std::memcpy(address.sun_path, path.data(), length);
  size = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + length + 1);
  return address;
}

const sockaddr* generic(const sockaddr_un& address) noexcept {
  return reinterpret_cast<const sockaddr*>(&address);
}

Descriptor make_folder_socket() noexcept {
  return os::open_socket(AF_UNIX, SOCK_DGRAM, os::Blocking::kNo);
}

/// Datagram sockets are live after bind(2), so a reader never finds one that is not listening yet.
int bind_in(const OpenFolder& folder, const Descriptor& socket, const std::string& name) noexcept {
  socklen_t size = 0;
  const sockaddr_un address = address_in(folder, name, size);
  return ::bind(socket.number(), generic(address), size) == 0 ? 0 : errno;
}

enum class File { kLiving, kStale, kForeign };

File examine(const OpenFolder& folder, const char* name) {
  struct stat status {};
  if (fstatat(folder.descriptor.number(), name, &status, AT_SYMLINK_NOFOLLOW) != 0)
    return File::kForeign;
  if (!S_ISSOCK(status.st_mode) || status.st_uid != geteuid()) return File::kForeign;
  if (std::strlen(name) > kFolderNameSizeMax) return File::kForeign;
  const Descriptor socket = make_folder_socket();
  socklen_t size = 0;
  const sockaddr_un address = address_in(folder, name, size);
  if (connect(socket.number(), generic(address), size) == 0) return File::kLiving;
  return errno == ECONNREFUSED ? File::kStale : File::kForeign;
}

}  // namespace

bool has_own_runtime_folder() {
  return !variable(kVariable).empty();
}

std::string runtime_folder() {
  if (const auto own = variable(kVariable); !own.empty()) return std::string(own);
  if (const auto session = variable("XDG_RUNTIME_DIR"); !session.empty()) {
    return std::string(session) + "/" + kFolderName;
  }
  const std::string user = std::to_string(geteuid());
  const std::string usual = "/run/user/" + user;
  struct stat status {};
  const bool is_there = stat(usual.c_str(), &status) == 0 && status.st_uid == geteuid();
  if (is_there) return usual + "/" + kFolderName;
  // Built in parts, because GCC 12 misreads a chain of `+` here (GCC bug 105329).
  std::string own("/tmp/");
  own.append(kFolderName).append("-").append(user);
  return own;
}

std::uint64_t network_namespace() {
  struct stat status {};
  return stat("/proc/self/ns/net", &status) == 0 ? std::uint64_t{status.st_ino} : 0;
}

std::uint32_t process_id() noexcept {
  return static_cast<std::uint32_t>(getpid());
}

expected<FolderSocket, SetupError> FolderSocket::create(std::string folder, std::string name) {
  if (name.empty() || name.size() > kFolderNameSizeMax || name.front() == '.' ||
      name.find('/') != std::string::npos) {
    return unusable(folder, "'" + name + "' is no name for a file in it", "");
  }
  const auto opened = open_folder(folder, /*makes=*/true);
  if (!opened) return unexpected{opened.error()};
  Descriptor socket = make_folder_socket();
  if (!socket.is_open()) return unexpected{no_descriptor("a socket in " + folder, errno)};
  if (const int error = bind_in(*opened, socket, name); error != 0) return failed(folder, error);
  return FolderSocket(std::move(folder), std::move(name), std::move(socket));
}

FolderSocket& FolderSocket::operator=(FolderSocket&& other) noexcept {
  std::swap(folder_, other.folder_);
  std::swap(name_, other.name_);
  std::swap(socket_, other.socket_);
  return *this;
}

FolderSocket::~FolderSocket() {
  remove();
}

void FolderSocket::remove() noexcept {
  if (!socket_.is_open()) return;
  const Descriptor folder(open(folder_.c_str(), O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC));
  if (folder.is_open()) unlinkat(folder.number(), name_.c_str(), 0);
}

void FolderSocket::keep() {
  const auto folder = open_folder(folder_, /*makes=*/true);
  struct stat status {};
  if (!folder ||
      fstatat(folder->descriptor.number(), name_.c_str(), &status, AT_SYMLINK_NOFOLLOW) == 0) {
    return;
  }
  // A socket keeps its first name, so a new socket is created.
  Descriptor socket = make_folder_socket();
  if (socket.is_open() && bind_in(*folder, socket, name_) == 0) socket_ = std::move(socket);
}

expected<FolderContent, SetupError> read_socket_folder(const std::string& folder) {
  const auto opened = open_folder(folder, /*makes=*/false);
  if (!opened) return unexpected{opened.error()};
  FolderContent content;
  if (!opened->descriptor.is_open()) return content;
  // fdopendir() takes ownership of its descriptor.
  const std::unique_ptr<DIR, int (*)(DIR*)> files(fdopendir(dup(opened->descriptor.number())),
                                                  closedir);
  if (!files) return failed(folder, errno);
  std::size_t file_count = 0;
  while (const dirent* const file = readdir(files.get())) {
    if (file->d_name[0] == '.') continue;
    if (++file_count > kFolderFileCountMax) {
      content.is_cut_off = true;
      break;
    }
    switch (examine(*opened, file->d_name)) {
      case File::kLiving:
        content.names.emplace_back(file->d_name);
        break;
      case File::kStale:
        ++content.stale_count;
        unlinkat(opened->descriptor.number(), file->d_name, 0);
        break;
      case File::kForeign:
        ++content.foreign_count;
        break;
    }
  }
  std::ranges::sort(content.names);
  return content;
}

}  // namespace rtpm::transport
