#include "output_file.hpp"

#include <fcntl.h>
#include <pthread.h>
#include <signal.h>
#include <time.h>
#include <unistd.h>

#include <cerrno>
#include <utility>

namespace rtpm::recording {
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

}  // namespace

expected<OutputFile, SetupError> OutputFile::create(const std::string& path) {
  const int descriptor = ::open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0644);
  if (descriptor < 0) {
    return setup_error("the recording " + path + " can't be created", system_error(errno),
                       errno == EEXIST ? "name another file, or remove that one"
                                       : "name a file in a folder that you may write to");
  }
  return OutputFile(path, descriptor);
}

OutputFile::OutputFile(std::string path, int descriptor) noexcept
    : path_(std::move(path)), descriptor_(descriptor) {}

OutputFile::OutputFile(OutputFile&& other) noexcept
    : path_(std::move(other.path_)),
      descriptor_(std::exchange(other.descriptor_, -1)),
      size_(other.size_),
      failure_(std::move(other.failure_)) {}

OutputFile::~OutputFile() {
  if (descriptor_ >= 0) ::close(descriptor_);
}

unexpected<SetupError> OutputFile::fail(int error) {
  failure_ = SetupError{"the recording " + path_ + " can't go on", system_error(error).message(),
                        error == ENOSPC || error == EDQUOT || error == EFBIG
                            ? "make room, or record to another disk"
                            : "see whether its disk is well",
                        system_error(error)};
  return unexpected{*failure_};
}

expected<void, SetupError> OutputFile::append(ConstBytes bytes) {
  if (failure_) return unexpected{*failure_};
  const SizeLimitAsError guard;
  std::size_t done = 0;
  while (done < bytes.size()) {
    const ssize_t count = ::write(descriptor_, bytes.data() + done, bytes.size() - done);
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) {
      const int error = errno;
      static_cast<void>(::ftruncate(descriptor_, static_cast<off_t>(size_)));
      return fail(error);
    }
    done += static_cast<std::size_t>(count);
  }
  size_ += bytes.size();
  return {};
}

expected<void, SetupError> OutputFile::close() {
  if (failure_) return unexpected{*failure_};
  const bool is_on_disk = ::fdatasync(descriptor_) == 0 || errno == EINVAL || errno == EROFS;
  const int error = errno;
  ::close(std::exchange(descriptor_, -1));
  if (!is_on_disk) return fail(error);
  return {};
}

}  // namespace rtpm::recording
