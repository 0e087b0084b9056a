#include "os/file.hpp"

#include <windows.h>

#include <algorithm>

#include "rtpm/base/utf8_path.hpp"

namespace rtpm::recording::os {
namespace {

/// As on POSIX: others may read, rename and remove a file that is open.
constexpr DWORD kShare = FILE_SHARE_READ | FILE_SHARE_WRITE | FILE_SHARE_DELETE;
/// ERROR_DISK_QUOTA_EXCEEDED, which not every header has.
constexpr int kQuotaExceeded = 1295;
constexpr std::size_t kStep = std::size_t{1} << 30;

HANDLE handle(const File& file) noexcept {
  return reinterpret_cast<HANDLE>(file.number());
}
std::error_code last_error() noexcept {
  return {static_cast<int>(GetLastError()), std::system_category()};
}

File open(const std::string& path, DWORD access, DWORD disposition) {
  // To open a folder, which is then refused as one.
  constexpr DWORD kFlags = FILE_ATTRIBUTE_NORMAL | FILE_FLAG_BACKUP_SEMANTICS;
  return File(reinterpret_cast<Number>(CreateFileW(path_of_utf8(path).c_str(), access, kShare,
                                                   nullptr, disposition, kFlags, nullptr)));
}

DWORD step_of(std::size_t size) noexcept {
  return static_cast<DWORD>(std::min(size, kStep));
}

}  // namespace

void close(Number number) noexcept {
  CloseHandle(reinterpret_cast<HANDLE>(number));
}

expected<Input, std::error_code> open_input(const std::string& path) {
  File file = open(path, GENERIC_READ, OPEN_EXISTING);
  if (!file.is_open()) return unexpected{last_error()};
  BY_HANDLE_FILE_INFORMATION found{};
  if (GetFileType(handle(file)) != FILE_TYPE_DISK) return Input{};
  if (GetFileInformationByHandle(handle(file), &found) == 0) return unexpected{last_error()};
  if ((found.dwFileAttributes & FILE_ATTRIBUTE_DIRECTORY) != 0) return Input{};
  return Input{std::move(file), std::uint64_t{found.nFileSizeHigh} << 32 | found.nFileSizeLow};
}

expected<std::size_t, std::error_code> read_at(const File& file, std::uint64_t offset,
                                               MutableBytes to) noexcept {
  OVERLAPPED place{};
  place.Offset = static_cast<DWORD>(offset);
  place.OffsetHigh = static_cast<DWORD>(offset >> 32);
  DWORD count = 0;
  if (ReadFile(handle(file), to.data(), step_of(to.size()), &count, &place) != 0)
    return std::size_t{count};
  if (GetLastError() == ERROR_HANDLE_EOF) return std::size_t{0};
  return unexpected{last_error()};
}

expected<File, std::error_code> create(const std::string& path) {
  File file = open(path, GENERIC_WRITE, CREATE_NEW);
  if (!file.is_open()) return unexpected{last_error()};
  return file;
}

std::error_code append(const File& file, ConstBytes bytes) noexcept {
  while (!bytes.empty()) {
    DWORD count = 0;
    if (WriteFile(handle(file), bytes.data(), step_of(bytes.size()), &count, nullptr) == 0)
      return last_error();
    bytes = bytes.subspan(count);
  }
  return {};
}

void cut(const File& file, std::uint64_t size) noexcept {
  LARGE_INTEGER end{};
  end.QuadPart = static_cast<LONGLONG>(size);
  if (SetFilePointerEx(handle(file), end, nullptr, FILE_BEGIN) != 0) SetEndOfFile(handle(file));
}

std::error_code flush(const File& file) noexcept {
  if (FlushFileBuffers(handle(file)) != 0) return {};
  // Some disks of a network have no such call.
  return GetLastError() == ERROR_INVALID_FUNCTION ? std::error_code() : last_error();
}

bool is_full(const std::error_code& error) noexcept {
  return error.value() == ERROR_DISK_FULL || error.value() == ERROR_HANDLE_DISK_FULL ||
         error.value() == kQuotaExceeded || error.value() == ERROR_FILE_TOO_LARGE;
}

}  // namespace rtpm::recording::os
