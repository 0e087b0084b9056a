#include "os/file.hpp"

#include <fcntl.h>
#include <pthread.h>
#include <signal.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#include <cerrno>

#include "rtpm/base/setup_error.hpp"

namespace rtpm::recording::os {
namespace {

/// While it lives, a write of this thread beyond the file-size limit fails with EFBIG, as on a full
/// disk, instead of ending the program by SIGXFSZ.
class SizeLimitAsError {
 public:
  SizeLimitAsError() noexcept {
    ::sigemptyset(&signal_);
    ::sigaddset(&signal_, SIGXFSZ);
    ::pthread_sigmask(SIG_BLOCK, &signal_, &before_);
  }
  SizeLimitAsError(const SizeLimitAsError&) = delete;
  SizeLimitAsError& operator=(const SizeLimitAsError&) = delete;
  ~SizeLimitAsError() {
    const int error = errno;
    constexpr timespec kNow{};
    while (::sigtimedwait(&signal_, nullptr, &kNow) == SIGXFSZ) {
    }
    ::pthread_sigmask(SIG_SETMASK, &before_, nullptr);
    errno = error;
  }

 private:
  sigset_t signal_{};
  sigset_t before_{};
};

int descriptor_of(const File& file) noexcept {
  return static_cast<int>(file.number());
}

}  // namespace

void close(Number number) noexcept {
  ::close(static_cast<int>(number));
}

expected<Input, std::error_code> open_input(const std::string& path) {
  // Opening a device may have side effects, so check the type first. The name may refer to another
  // file by then, so opening must not wait for the writer of a pipe.
  struct stat status {};
  if (::stat(path.c_str(), &status) != 0) return unexpected{system_error(errno)};
  if (!S_ISREG(status.st_mode)) return Input{};
  File file(::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK | O_NOCTTY));
  if (!file.is_open()) return unexpected{system_error(errno)};
  if (::fstat(descriptor_of(file), &status) != 0) return unexpected{system_error(errno)};
  if (!S_ISREG(status.st_mode)) return Input{};
  return Input{std::move(file), static_cast<std::uint64_t>(status.st_size)};
}

expected<std::size_t, std::error_code> read_at(const File& file, std::uint64_t offset,
                                               MutableBytes to) noexcept {
  ssize_t count = 0;
  do {
    count = ::pread(descriptor_of(file), to.data(), to.size(), static_cast<off_t>(offset));
  } while (count < 0 && errno == EINTR);
  if (count < 0) return unexpected{system_error(errno)};
  return static_cast<std::size_t>(count);
}

expected<File, std::error_code> create(const std::string& path) {
  File file(::open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0644));
  if (!file.is_open()) return unexpected{system_error(errno)};
  return file;
}

std::error_code append(const File& file, ConstBytes bytes) noexcept {
  const SizeLimitAsError guard;
  while (!bytes.empty()) {
    const ssize_t count = ::write(descriptor_of(file), bytes.data(), bytes.size());
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) return system_error(errno);
    bytes = bytes.subspan(static_cast<std::size_t>(count));
  }
  return {};
}

void cut(const File& file, std::uint64_t size) noexcept {
  static_cast<void>(::ftruncate(descriptor_of(file), static_cast<off_t>(size)));
}

std::error_code flush(const File& file) noexcept {
  if (::fdatasync(descriptor_of(file)) == 0 || errno == EINVAL || errno == EROFS) return {};
  return system_error(errno);
}

bool is_full(const std::error_code& error) noexcept {
  return error.value() == ENOSPC || error.value() == EDQUOT || error.value() == EFBIG;
}

}  // namespace rtpm::recording::os
