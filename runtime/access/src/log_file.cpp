#include "rtpm/access/log_file.hpp"

#include <utility>

#include "os/file.hpp"
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
      number_(std::exchange(other.number_, os::kNoFile)),
      size_(other.size_) {}

LogFile::~LogFile() {
  if (number_ != os::kNoFile) os::close(number_);
}

expected<LogFile, SetupError> LogFile::open(std::string path, std::uint64_t size_max) {
  LogFile file(std::move(path), size_max);
  if (auto opened = file.reopen(); !opened) return unexpected{opened.error()};
  return file;
}

expected<void, SetupError> LogFile::reopen() {
  auto file = os::open(path_, os::Mode::kAppend);
  if (!file) {
    return setup_error(what(path_), file.error(),
                       "name a file in a folder that is there and may be written");
  }
  // sec-9-1
  if (!os::is_private(file->number())) {
    return setup_error(what(path_), "it is no file that this user alone can read and write",
                       std::string(os::private_remedy()) + ", or name another");
  }
  size_ = os::size_of(file->number());
  number_ = file->release();
  return {};
}

expected<void, SetupError> LogFile::write_line(std::string_view line) {
  if (number_ != os::kNoFile && size_ >= size_max_) {
    os::close(std::exchange(number_, os::kNoFile));
    if (const auto error = os::rename(path_, path_ + ".1")) return setup_error(what(path_), error);
  }
  if (number_ == os::kNoFile) {
    if (auto opened = reopen(); !opened) return opened;
  }
  const std::string whole = std::string(line) + '\n';
  if (const auto error = os::write(number_, whole)) return setup_error(what(path_), error);
  size_ += whole.size();
  return {};
}

}  // namespace rtpm::access
