#include <windows.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <string_view>
#include <system_error>
#include <utility>

#include "rtpm/base/utf8_path.hpp"
#include "rtpm/transport/socket_folder.hpp"

// Windows has no datagram sockets with names in folders. A file that the system deletes as soon as
// its program ends does the same.
namespace rtpm::transport {
namespace {

namespace fs = std::filesystem;

constexpr const wchar_t* kVariable = L"RTPM_RUNTIME_FOLDER";

std::wstring variable(const wchar_t* name) {
  const wchar_t* const value = _wgetenv(name);
  return value == nullptr ? std::wstring() : std::wstring(value);
}

// A file's name can't have the colon that an address has.
fs::path file_of(std::string name) {
  std::ranges::replace(name, ':', ';');
  return path_of_utf8(name);
}
std::string name_of(const fs::path& file) {
  std::string name = utf8_of(file);
  std::ranges::replace(name, ';', ':');
  return name;
}

unexpected<SetupError> unusable(const std::string& folder, const std::string& why) {
  return setup_error(
      "the folder " + folder + ", by which the programs of a host find each other, can't be used",
      why, "set RTPM_RUNTIME_FOLDER to a folder of your own");
}
unexpected<SetupError> failed(const std::string& folder, DWORD error) {
  return unusable(folder, std::system_category().message(static_cast<int>(error)));
}

/// Creates the file, which lives as long as its handle. Not open if it fails; the last error has
/// the reason.
Descriptor make_mark(const fs::path& path) noexcept {
  const HANDLE file = CreateFileW(path.c_str(), GENERIC_WRITE | DELETE,
                                  FILE_SHARE_READ | FILE_SHARE_DELETE, nullptr, CREATE_NEW,
                                  FILE_ATTRIBUTE_TEMPORARY | FILE_FLAG_DELETE_ON_CLOSE, nullptr);
  if (file == INVALID_HANDLE_VALUE) return {};
  return Descriptor(static_cast<int>(reinterpret_cast<std::intptr_t>(file)));
}

enum class File { kLiving, kStale, kForeign };

// A file that nobody has open is left over from a computer that lost its power.
File examine(const fs::path& path) noexcept {
  const HANDLE file = CreateFileW(path.c_str(), GENERIC_READ, 0, nullptr, OPEN_EXISTING,
                                  FILE_ATTRIBUTE_NORMAL, nullptr);
  if (file == INVALID_HANDLE_VALUE) {
    return GetLastError() == ERROR_SHARING_VIOLATION ? File::kLiving : File::kForeign;
  }
  LARGE_INTEGER size{};
  const bool is_empty = GetFileSizeEx(file, &size) != 0 && size.QuadPart == 0;
  CloseHandle(file);
  return is_empty ? File::kStale : File::kForeign;
}

}  // namespace

bool has_own_runtime_folder() {
  return !variable(kVariable).empty();
}

std::string runtime_folder() {
  if (const auto own = variable(kVariable); !own.empty()) return utf8_of(own);
  return utf8_of(fs::path(variable(L"LOCALAPPDATA")) / "rtpm" / "run");
}

std::uint64_t network_namespace() {
  return 0;
}

std::uint32_t process_id() noexcept {
  return GetCurrentProcessId();
}

expected<FolderSocket, SetupError> FolderSocket::create(std::string folder, std::string name) {
  const bool is_name = !name.empty() && name.size() <= kFolderNameSizeMax && name.front() != '.' &&
                       name.find_first_of("/\\;<>\"|?*") == std::string::npos;
  if (!is_name) return unusable(folder, "'" + name + "' is no name for a file in it");
  const fs::path path = path_of_utf8(folder);
  std::error_code error;
  fs::create_directories(path, error);
  if (error) return unusable(folder, error.message());
  Descriptor mark = make_mark(path / file_of(name));
  if (!mark.is_open()) return failed(folder, GetLastError());
  return FolderSocket(std::move(folder), std::move(name), std::move(mark));
}

FolderSocket& FolderSocket::operator=(FolderSocket&& other) noexcept {
  std::swap(folder_, other.folder_);
  std::swap(name_, other.name_);
  std::swap(socket_, other.socket_);
  return *this;
}

FolderSocket::~FolderSocket() = default;

void FolderSocket::keep() {
  const fs::path path = path_of_utf8(folder_);
  std::error_code error;
  if (fs::exists(path / file_of(name_), error)) return;
  fs::create_directories(path, error);
  if (Descriptor mark = make_mark(path / file_of(name_)); mark.is_open()) socket_ = std::move(mark);
}

expected<FolderContent, SetupError> read_socket_folder(const std::string& folder) {
  FolderContent content;
  std::error_code error;
  fs::directory_iterator files(path_of_utf8(folder), error);
  if (error == std::errc::no_such_file_or_directory) return content;
  if (error) return unusable(folder, error.message());
  std::size_t file_count = 0;
  for (; files != fs::directory_iterator() && !error; files.increment(error)) {
    const fs::path& path = files->path();
    if (++file_count > kFolderFileCountMax) {
      content.is_cut_off = true;
      break;
    }
    std::string name = name_of(path.filename());
    const bool may_be = name.size() <= kFolderNameSizeMax && name.front() != '.';
    switch (may_be ? examine(path) : File::kForeign) {
      case File::kLiving:
        content.names.push_back(std::move(name));
        break;
      case File::kStale:
        ++content.stale_count;
        DeleteFileW(path.c_str());
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
