#include "rtpm/access/log_file.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <utility>

#include "rtpm/base/printable.hpp"

namespace rtpm::access {
namespace {

std::string what(const std::string& path) {
  return printable(path, kShownWhole) + " can't be written";
}

}  // namespace

LogFile::LogFile(std::string path, std::uint64_t size_max) noexcept
    : path_(std::move(path)), size_max_(size_max) {}

LogFile::LogFile(LogFile&& other) noexcept
    : path_(std::move(other.path_)),
      size_max_(other.size_max_),
      number_(std::exchange(other.number_, -1)),
      size_(other.size_) {}

LogFile::~LogFile() {
  if (number_ >= 0) ::close(number_);
}

expected<LogFile, SetupError> LogFile::open(std::string path, std::uint64_t size_max) {
  LogFile file(std::move(path), size_max);
  if (auto opened = file.reopen(); !opened) return unexpected{opened.error()};
  return file;
}

expected<void, SetupError> LogFile::reopen() {
  constexpr int kFlags = O_WRONLY | O_APPEND | O_CREAT | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK;
  const int number = ::open(path_.c_str(), kFlags, 0600);
  if (number < 0) {
    return setup_error(what(path_), system_error(errno),
                       "name a file in a folder that is there and may be written");
  }
  struct stat status {};
  // sec-9-1
  const bool is_ours = ::fstat(number, &status) == 0 && S_ISREG(status.st_mode) &&
                       status.st_uid == ::geteuid() && (status.st_mode & (S_IRWXG | S_IRWXO)) == 0;
  if (!is_ours) {
    ::close(number);
    return setup_error(what(path_), "it is no file that this user alone can read and write",
                       "chmod 600 it, or name another");
  }
  number_ = number;
  size_ = static_cast<std::uint64_t>(status.st_size);
  return {};
}

expected<void, SetupError> LogFile::write_line(std::string_view line) {
  if (number_ >= 0 && size_ >= size_max_) {
    ::close(std::exchange(number_, -1));
    if (std::rename(path_.c_str(), (path_ + ".1").c_str()) != 0) {
      return setup_error(what(path_), system_error(errno));
    }
  }
  if (number_ < 0) {
    if (auto opened = reopen(); !opened) return opened;
  }
  const std::string whole = std::string(line) + '\n';
  const ssize_t size = ::write(number_, whole.data(), whole.size());
  if (size > 0) size_ += static_cast<std::uint64_t>(size);
  if (size == static_cast<ssize_t>(whole.size())) return {};
  return setup_error(what(path_), system_error(size < 0 ? errno : ENOSPC));
}

}  // namespace rtpm::access
