#include "file_text.hpp"

#include <fcntl.h>
#include <unistd.h>

namespace rtpm::rt {

std::string_view read_file(const char* path, std::span<char> buffer) noexcept {
  const int file = open(path, O_RDONLY | O_CLOEXEC);
  if (file < 0) return {};
  const ssize_t size = read(file, buffer.data(), buffer.size());
  close(file);
  if (size <= 0) return {};
  std::string_view text(buffer.data(), static_cast<std::size_t>(size));
  while (text.ends_with('\n'))
    text.remove_suffix(1);
  return text;
}

}  // namespace rtpm::rt
