#include "os/file.hpp"

#include <fcntl.h>

namespace rtpm::exports::os {

std::FILE* open(const std::filesystem::path& path) {
  return std::fopen(path.c_str(), "rb");
}
std::FILE* create(const std::filesystem::path& path) {
  return std::fopen(path.c_str(), "wbx");
}
int open_to_append(const std::filesystem::path& path) noexcept {
  return ::open(path.c_str(), O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0666);
}
bool seek(std::FILE* file, std::uint64_t offset) noexcept {
  return ::fseeko(file, static_cast<off_t>(offset), SEEK_SET) == 0;
}
bool seek_end(std::FILE* file) noexcept {
  return ::fseeko(file, 0, SEEK_END) == 0;
}

}  // namespace rtpm::exports::os
