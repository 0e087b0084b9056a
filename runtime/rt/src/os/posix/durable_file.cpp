#include "rtpm/rt/durable_file.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>

namespace rtpm::rt {
namespace {

std::error_code last_error() noexcept {
  return {errno, std::generic_category()};
}

/// A file descriptor, closed on destruction.
class File {
 public:
  File(const std::string& path, int flags) noexcept
      : descriptor_(open(path.c_str(), flags | O_CLOEXEC, 0644)) {}
  File(const File&) = delete;
  File& operator=(const File&) = delete;
  ~File() {
    if (descriptor_ >= 0) close(descriptor_);
  }
  [[nodiscard]] bool is_open() const noexcept { return descriptor_ >= 0; }
  [[nodiscard]] bool write_all(std::string_view content) const noexcept {
    while (!content.empty()) {
      const ssize_t written = write(descriptor_, content.data(), content.size());
      if (written < 0 && errno == EINTR) continue;
      if (written < 0) return false;
      content.remove_prefix(static_cast<std::size_t>(written));
    }
    return true;
  }
  [[nodiscard]] bool sync() const noexcept { return fsync(descriptor_) == 0; }

 private:
  int descriptor_;
};

std::string folder_of(const std::string& path) {
  const std::size_t slash = path.rfind('/');
  if (slash == std::string::npos) return ".";
  return slash == 0 ? "/" : path.substr(0, slash);
}

expected<void, std::error_code> write_durably(const std::string& path, std::string_view content) {
  const File file(path, O_WRONLY | O_CREAT | O_TRUNC);
  if (!file.is_open() || !file.write_all(content) || !file.sync()) return unexpected{last_error()};
  return {};
}

}  // namespace

expected<void, std::error_code> replace_file(const std::string& path, std::string_view content) {
  const std::string next = path + ".new";
  if (auto written = write_durably(next, content); !written) {
    unlink(next.c_str());
    return written;
  }
  if (std::rename(next.c_str(), path.c_str()) != 0) {
    const std::error_code error = last_error();
    unlink(next.c_str());
    return unexpected{error};
  }
  // Flushes the folder entry as well.
  const File folder(folder_of(path), O_RDONLY | O_DIRECTORY);
  if (!folder.is_open() || !folder.sync()) return unexpected{last_error()};
  return {};
}

}  // namespace rtpm::rt
