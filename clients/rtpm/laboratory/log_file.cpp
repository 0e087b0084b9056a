#include "laboratory/log_file.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <filesystem>
#include <system_error>

namespace rtpm::laboratory {
namespace {

Handle opened(const std::string& path) {
  // Programs may print lines that only their user may read, such as a console's URL.
  constexpr mode_t kMode = 0600;
  Handle file(::open(path.c_str(), O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, kMode));
  if (file.is_open()) static_cast<void>(::fchmod(file.number(), kMode));
  return file;
}

}  // namespace

expected<LogFile, SetupError> LogFile::open(const std::string& path) {
  std::error_code error;
  std::filesystem::create_directories(std::filesystem::path(path).parent_path(), error);
  Handle file = opened(path);
  if (!file.is_open()) {
    return setup_error("the log " + path + " can't be written", system_error(errno),
                       "choose another folder for 'logs'");
  }
  struct stat found {};
  ::fstat(file.number(), &found);
  return LogFile(path, std::move(file), static_cast<std::size_t>(found.st_size));
}

void LogFile::write(std::string_view line) {
  std::string text(line);
  text += '\n';
  if (size_ + text.size() > kSizeMax) {
    std::rename(path_.c_str(), (path_ + ".1").c_str());
    if (Handle file = opened(path_); file.is_open()) file_ = std::move(file);
    size_ = 0;
  }
  if (::write(file_.number(), text.data(), text.size()) > 0) size_ += text.size();
}

}  // namespace rtpm::laboratory
