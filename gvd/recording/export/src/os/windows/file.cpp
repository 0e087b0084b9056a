#include "os/file.hpp"

#include <fcntl.h>
#include <io.h>
#include <share.h>
#include <sys/stat.h>

namespace rtpm::exports::os {

std::FILE* open(const std::filesystem::path& path) {
  return _wfopen(path.c_str(), L"rb");
}
std::FILE* create(const std::filesystem::path& path) {
  int number = -1;
  // The C library of Windows has no mode "x".
  _wsopen_s(&number, path.c_str(), _O_WRONLY | _O_CREAT | _O_EXCL | _O_BINARY, _SH_DENYNO,
            _S_IREAD | _S_IWRITE);
  return number < 0 ? nullptr : _fdopen(number, "wb");
}
int open_to_append(const std::filesystem::path& path) noexcept {
  int number = -1;
  _wsopen_s(&number, path.c_str(), _O_WRONLY | _O_CREAT | _O_APPEND | _O_BINARY, _SH_DENYNO,
            _S_IREAD | _S_IWRITE);
  return number;
}
bool seek(std::FILE* file, std::uint64_t offset) noexcept {
  return _fseeki64(file, static_cast<std::int64_t>(offset), SEEK_SET) == 0;
}
bool seek_end(std::FILE* file) noexcept {
  return _fseeki64(file, 0, SEEK_END) == 0;
}

}  // namespace rtpm::exports::os
