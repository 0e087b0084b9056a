#include "os/file.hpp"

#include <arpa/inet.h>
#include <fcntl.h>
#include <poll.h>
#include <pwd.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <filesystem>

#include "rtpm/base/printable.hpp"
#include "rtpm/base/setup_error.hpp"

namespace rtpm::access::os {
namespace {

constexpr int kLockPauseMs = 10;
constexpr mode_t kOfOthers = S_IRWXG | S_IRWXO;
constexpr mode_t kWriteOfOthers = S_IWGRP | S_IWOTH;

int descriptor(Number number) noexcept {
  return static_cast<int>(number);
}
int descriptor(const File& file) noexcept {
  return descriptor(file.number());
}

unexpected<std::error_code> last_error() noexcept {
  return unexpected{system_error(errno)};
}

int flags_of(Mode mode) noexcept {
  switch (mode) {
    case Mode::kRead:
      return O_RDONLY | O_CLOEXEC | O_NONBLOCK;
    case Mode::kCreate:
      return O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC | O_NOFOLLOW;
    case Mode::kAppend:
      return O_WRONLY | O_APPEND | O_CREAT | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK;
  }
  return O_RDONLY;
}

bool is_same_file(const File& file, const std::string& path) noexcept {
  struct stat open_one {};
  struct stat named {};
  return ::fstat(descriptor(file), &open_one) == 0 && ::stat(path.c_str(), &named) == 0 &&
         open_one.st_ino == named.st_ino && open_one.st_dev == named.st_dev;
}

}  // namespace

void close(Number number) noexcept {
  ::close(descriptor(number));
}

expected<File, std::error_code> open(const std::string& path, Mode mode) {
  const int number = ::open(path.c_str(), flags_of(mode), 0600);
  if (number < 0) return last_error();
  return File(number);
}

expected<std::size_t, std::error_code> read(const File& file, char* to, std::size_t size) noexcept {
  while (true) {
    const ssize_t count = ::read(descriptor(file), to, size);
    if (count >= 0) return static_cast<std::size_t>(count);
    if (errno != EINTR) return last_error();
  }
}

std::error_code write(Number file, std::string_view text) noexcept {
  while (!text.empty()) {
    const ssize_t count = ::write(descriptor(file), text.data(), text.size());
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) return system_error(errno);
    if (count == 0) return system_error(ENOSPC);
    text.remove_prefix(static_cast<std::size_t>(count));
  }
  return {};
}

std::error_code flush(const File& file) noexcept {
  return ::fsync(descriptor(file)) == 0 ? std::error_code() : system_error(errno);
}

expected<std::optional<Distrust>, std::error_code> distrust_of(const File& file,
                                                               const std::string& path,
                                                               Forbidden forbidden) {
  struct stat status {};
  if (::fstat(descriptor(file), &status) != 0) return last_error();
  if (!S_ISREG(status.st_mode)) return Distrust{"it is no regular file"};
  if (status.st_uid != ::geteuid() && status.st_uid != 0)
    return Distrust{"it belongs to another user, number " + std::to_string(status.st_uid),
                    "chown it to the user who runs this program"};
  const bool is_secret = forbidden == Forbidden::kToReadOrWrite;
  if ((status.st_mode & (is_secret ? kOfOthers : kWriteOfOthers)) != 0) {
    return Distrust{is_secret ? "others can read or write it" : "others can write it",
                    (is_secret ? "chmod 600 " : "chmod go-w ") + printable(path, kShownWhole)};
  }
  return std::nullopt;
}

bool is_private(Number file) noexcept {
  struct stat status {};
  return ::fstat(descriptor(file), &status) == 0 && S_ISREG(status.st_mode) &&
         status.st_uid == ::geteuid() && (status.st_mode & kOfOthers) == 0;
}

std::string_view private_remedy() noexcept {
  return "chmod 600 it";
}

std::uint64_t size_of(Number file) noexcept {
  struct stat status {};
  return ::fstat(descriptor(file), &status) == 0 ? static_cast<std::uint64_t>(status.st_size) : 0;
}

void remove(const std::string& path) noexcept {
  ::unlink(path.c_str());
}

std::error_code rename(const std::string& from, const std::string& to) noexcept {
  return std::rename(from.c_str(), to.c_str()) == 0 ? std::error_code() : system_error(errno);
}

std::error_code make_folder_of(const std::string& path) {
  const std::filesystem::path folder = std::filesystem::path(path).parent_path();
  std::error_code error;
  if (!folder.empty() && std::filesystem::create_directories(folder, error))
    std::filesystem::permissions(folder, std::filesystem::perms::owner_all, error);
  return error;
}

expected<std::string, std::error_code> real_path_of(const std::string& path) {
  std::error_code error;
  const std::filesystem::path real = std::filesystem::weakly_canonical(path, error);
  if (error) return unexpected{error};
  return real.string();
}

expected<std::optional<File>, std::error_code> lock(const std::string& path) {
  File file(::open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NONBLOCK, 0600));
  if (file.number() == kNoFile) return last_error();
  if (::flock(descriptor(file), LOCK_EX | LOCK_NB) != 0) {
    if (errno == EWOULDBLOCK || errno == EINTR) return std::nullopt;
    return last_error();
  }
  // Another program has replaced it meanwhile.
  if (!is_same_file(file, path)) return std::nullopt;
  return std::optional<File>(std::move(file));
}

expected<bool, std::error_code> replace(const File& locked, const std::string& path,
                                        std::string_view text) {
  struct stat old {};
  if (::fstat(descriptor(locked), &old) != 0) return last_error();
  const std::string next = path + ".new";
  remove(next);  // Left by a program that died halfway: this process holds the lock.
  const auto file = open(next, Mode::kCreate);
  if (!file) return unexpected{file.error()};
  const bool is_mine = old.st_uid == ::geteuid();
  std::error_code error;
  if ((!is_mine && ::fchown(descriptor(*file), old.st_uid, old.st_gid) != 0) ||
      ::fchmod(descriptor(*file), old.st_mode & 07777) != 0) {
    error = system_error(errno);
  }
  if (!error) error = write(file->number(), text);
  if (!error) error = flush(*file);
  if (!error) error = rename(next, path);
  if (!error) return true;
  remove(next);
  return unexpected{error};
}

void pause() noexcept {
  ::poll(nullptr, 0, kLockPauseMs);
}

std::string variable(const char* name) {
  const char* value = std::getenv(name);  // NOLINT(concurrency-mt-unsafe): set-up.
  return value == nullptr ? "" : value;
}

std::string default_key_folder() {
  if (const std::string folder = variable("XDG_CONFIG_HOME"); !folder.empty())
    return folder + "/rtpm";
  if (const std::string home = variable("HOME"); !home.empty()) return home + "/.config/rtpm";
  return {};
}

std::string_view key_folder_variables() noexcept {
  return "XDG_CONFIG_HOME and HOME";
}

FileStamp stamp_of(const std::string& path) noexcept {
  struct stat found {};
  if (::stat(path.c_str(), &found) != 0) return {};
  return {found.st_ino, found.st_ctim.tv_sec * 1'000'000'000LL + found.st_ctim.tv_nsec,
          found.st_size};
}

std::string user_at_host() {
  std::array<char, 256> host{};
  if (::gethostname(host.data(), host.size() - 1) != 0) return {};
  const passwd* const user = ::getpwuid(this_user());  // NOLINT(concurrency-mt-unsafe): set-up.
  const std::string name = user != nullptr ? user->pw_name : std::to_string(this_user());
  return name + "@" + host.data();
}

std::uint32_t this_user() noexcept {
  return ::geteuid();
}

bool parse_ipv6(const std::string& text, std::uint8_t* to) noexcept {
  return ::inet_pton(AF_INET6, text.c_str(), to) == 1;
}

bool parse_ipv4(const std::string& text, std::uint8_t* to) noexcept {
  return ::inet_pton(AF_INET, text.c_str(), to) == 1;
}

}  // namespace rtpm::access::os
