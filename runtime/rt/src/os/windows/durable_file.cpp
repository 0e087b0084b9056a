#include "rtpm/rt/durable_file.hpp"

#include <windows.h>

#include <algorithm>
#include <filesystem>

#include "rtpm/base/utf8_path.hpp"

namespace rtpm::rt {
namespace {

std::error_code last_error() noexcept {
  return {static_cast<int>(GetLastError()), std::system_category()};
}

/// A file that is written from its beginning, closed on destruction.
class NewFile {
 public:
  explicit NewFile(const std::filesystem::path& path) noexcept
      : handle_(CreateFileW(path.c_str(), GENERIC_WRITE, FILE_SHARE_READ | FILE_SHARE_DELETE,
                            nullptr, CREATE_ALWAYS, FILE_ATTRIBUTE_NORMAL, nullptr)) {}
  NewFile(const NewFile&) = delete;
  NewFile& operator=(const NewFile&) = delete;
  ~NewFile() {
    if (is_open()) CloseHandle(handle_);
  }
  [[nodiscard]] bool is_open() const noexcept { return handle_ != INVALID_HANDLE_VALUE; }
  [[nodiscard]] bool write_all(std::string_view content) const noexcept {
    constexpr std::size_t kStep = std::size_t{1} << 30;
    while (!content.empty()) {
      DWORD written = 0;
      const auto wanted = static_cast<DWORD>(std::min(content.size(), kStep));
      if (WriteFile(handle_, content.data(), wanted, &written, nullptr) == 0) return false;
      content.remove_prefix(written);
    }
    return true;
  }
  [[nodiscard]] bool sync() const noexcept { return FlushFileBuffers(handle_) != 0; }

 private:
  HANDLE handle_;
};

expected<void, std::error_code> write_durably(const std::filesystem::path& path,
                                              std::string_view content) {
  const NewFile file(path);
  if (!file.is_open() || !file.write_all(content) || !file.sync()) return unexpected{last_error()};
  return {};
}

}  // namespace

expected<void, std::error_code> replace_file(const std::string& path, std::string_view content) {
  const std::filesystem::path next = path_of_utf8(path + ".new");
  if (auto written = write_durably(next, content); !written) {
    DeleteFileW(next.c_str());
    return written;
  }
  // Writes the folder entry through as well.
  constexpr DWORD kFlags = MOVEFILE_REPLACE_EXISTING | MOVEFILE_WRITE_THROUGH;
  if (MoveFileExW(next.c_str(), path_of_utf8(path).c_str(), kFlags) == 0) {
    const std::error_code error = last_error();
    DeleteFileW(next.c_str());
    return unexpected{error};
  }
  return {};
}

}  // namespace rtpm::rt
