#include "rtpm/access/file_change.hpp"

#include <fcntl.h>
#include <poll.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <filesystem>
#include <system_error>

#include "open_file.hpp"
#include "rtpm/access/files.hpp"
#include "rtpm/base/printable.hpp"

namespace rtpm::access {
namespace {

constexpr int kLockTryCountMax = 500;
constexpr int kLockPauseMs = 10;

unexpected<SetupError> failed(const std::string& path, int error) {
  return setup_error(printable(path, kShownWhole) + " can't be changed", system_error(error));
}

/// Resolves links to the file itself; if the file does not exist yet, creates its folder.
expected<std::string, SetupError> real_path_of(const std::string& path) {
  std::error_code error;
  const std::filesystem::path folder = std::filesystem::path(path).parent_path();
  if (!folder.empty() && std::filesystem::create_directories(folder, error))
    std::filesystem::permissions(folder, std::filesystem::perms::owner_all, error);
  if (error) return setup_error(printable(folder.string(), kShownWhole) + " can't be made", error);
  const std::filesystem::path real = std::filesystem::weakly_canonical(path, error);
  if (error) return failed(path, error.value());
  return real.string();
}

bool is_same_file(const File& file, const std::string& path) {
  struct stat open_one {};
  struct stat named {};
  return ::fstat(file.number(), &open_one) == 0 && ::stat(path.c_str(), &named) == 0 &&
         open_one.st_ino == named.st_ino && open_one.st_dev == named.st_dev;
}

bool write_all(const File& file, std::string_view text) {
  while (!text.empty()) {
    const ssize_t count = ::write(file.number(), text.data(), text.size());
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) return false;
    text.remove_prefix(static_cast<std::size_t>(count));
  }
  return ::fsync(file.number()) == 0;
}

/// Replaces the locked file with `text`, keeping its mode and owner.
expected<void, SetupError> replace(const File& locked, const std::string& path,
                                   std::string_view text) {
  struct stat old {};
  if (::fstat(locked.number(), &old) != 0) return failed(path, errno);
  const std::string next = path + ".new";
  ::unlink(next.c_str());  // Left by a program that died halfway: this process holds the lock.
  constexpr int kFlags = O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC | O_NOFOLLOW;
  const File file(::open(next.c_str(), kFlags, 0600));
  if (!file.is_open()) return failed(path, errno);
  const bool is_mine = old.st_uid == ::geteuid();
  const bool is_written = (is_mine || ::fchown(file.number(), old.st_uid, old.st_gid) == 0) &&
                          ::fchmod(file.number(), old.st_mode & 07777) == 0 &&
                          write_all(file, text) && std::rename(next.c_str(), path.c_str()) == 0;
  if (is_written) return {};
  const int error = errno;
  ::unlink(next.c_str());
  return failed(path, error);
}

expected<void, SetupError> change_locked(const File& file, const std::string& path,
                                         const FileChange& change) {
  const auto old = read_trusted_file(path);
  if (!old) return unexpected{old.error()};
  auto text = change(*old);
  if (!text) return unexpected{text.error()};
  if (text->size() > kFileSizeMax)
    return setup_error(printable(path, kShownWhole) + " would have more than " +
                       std::to_string(kFileSizeMax) + " bytes");
  if (*text == *old) return {};
  return replace(file, path, *text);
}

/// Changes the file, unless another program holds its lock or has replaced it meanwhile.
/// @return whether it did
expected<bool, SetupError> try_change(const std::string& path, const FileChange& change) {
  const bool is_new = !stamp_of(path).is_of_file();
  const File file(::open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NONBLOCK, 0600));
  if (!file.is_open()) return failed(path, errno);
  if (::flock(file.number(), LOCK_EX | LOCK_NB) != 0) {
    if (errno == EWOULDBLOCK || errno == EINTR) return false;
    return failed(path, errno);
  }
  if (!is_same_file(file, path)) return false;
  if (auto changed = change_locked(file, path, change); !changed) {
    // An empty file of grants would make servers require grants that nobody has.
    if (is_new) ::unlink(path.c_str());
    return unexpected{changed.error()};
  }
  return true;
}

}  // namespace

expected<void, SetupError> change_trusted_file(const std::string& path, const FileChange& change) {
  const auto real = real_path_of(path);
  if (!real) return unexpected{real.error()};
  for (int i = 0; i < kLockTryCountMax; ++i) {
    const auto changed = try_change(*real, change);
    if (!changed) return unexpected{changed.error()};
    if (*changed) return {};
    ::poll(nullptr, 0, kLockPauseMs);
  }
  return setup_error(printable(path, kShownWhole) + " can't be changed",
                     "another program has it locked", "try again");
}

std::string with_line(std::string text, std::string_view line) {
  if (!text.empty() && text.back() != '\n') text += '\n';
  return text.append(line) + '\n';
}

std::string without_lines(std::string_view text, const std::vector<std::size_t>& numbers) {
  std::string rest;
  for (std::size_t number = 1; !text.empty(); ++number) {
    const std::size_t size = std::min(text.find('\n'), text.size() - 1) + 1;
    if (std::ranges::find(numbers, number) == numbers.end()) rest.append(text.substr(0, size));
    text.remove_prefix(size);
  }
  return rest;
}

}  // namespace rtpm::access
