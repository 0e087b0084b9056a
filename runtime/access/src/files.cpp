#include "rtpm/access/files.hpp"

#include <fcntl.h>
#include <pwd.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstdlib>
#include <filesystem>
#include <optional>
#include <span>
#include <utility>

#include "open_file.hpp"
#include "rtpm/base/printable.hpp"
#include "rtpm/crypto/key_text.hpp"
#include "words.hpp"

namespace rtpm::access {
namespace {

constexpr mode_t kOfOthers = S_IRWXG | S_IRWXO;
constexpr mode_t kWriteOfOthers = S_IWGRP | S_IWOTH;

/// Secret text, wiped on destruction.
struct SecretText {
  std::string text{};
  ~SecretText() { crypto::wipe(std::as_writable_bytes(std::span(text))); }
};

/// Appends the whole file to `text`, whose memory is reserved so that no copy is left behind.
std::error_code read_all(const File& file, std::string& text) {
  text.reserve(kFileSizeMax + 1);
  text.resize(kFileSizeMax + 1);
  std::size_t size = 0;
  while (size < text.size()) {
    const ssize_t count = ::read(file.number(), text.data() + size, text.size() - size);
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) return system_error(errno);
    if (count == 0) break;
    size += static_cast<std::size_t>(count);
  }
  text.resize(size);
  return {};
}

/// @param forbidden  the permission bits that the file must not have
expected<void, SetupError> check(const File& file, const std::string& path, mode_t forbidden) {
  const std::string what = printable(path, kShownWhole) + " is not used";
  struct stat status {};
  if (::fstat(file.number(), &status) != 0) return setup_error(what, system_error(errno));
  if (!S_ISREG(status.st_mode)) return setup_error(what, "it is no regular file");
  if (status.st_uid != ::geteuid() && status.st_uid != 0)
    return setup_error(what, "it belongs to another user, number " + std::to_string(status.st_uid),
                       "chown it to the user who runs this program");
  if ((status.st_mode & forbidden) != 0) {
    const bool is_secret = forbidden == kOfOthers;
    return setup_error(what, is_secret ? "others can read or write it" : "others can write it",
                       (is_secret ? "chmod 600 " : "chmod go-w ") + printable(path, kShownWhole));
  }
  return {};
}

expected<void, SetupError> write_secret(const std::string& path, std::string_view text) {
  const std::string what = printable(path, kShownWhole) + " can't be made";
  // O_EXCL: an existing key is never replaced, and no link is followed.
  const File file(::open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC | O_NOFOLLOW, 0600));
  if (!file.is_open()) {
    if (errno == EEXIST)
      return setup_error(
          what, "there is one already",
          "use it, or move it away first: who trusts the old key does not trust a new one");
    return setup_error(what, system_error(errno));
  }
  const ssize_t count = ::write(file.number(), text.data(), text.size());
  if (count == static_cast<ssize_t>(text.size()) && ::fsync(file.number()) == 0) return {};
  const int error = count < 0 || count == static_cast<ssize_t>(text.size()) ? errno : ENOSPC;
  ::unlink(path.c_str());
  return setup_error(what, system_error(error));
}

}  // namespace

expected<std::string, SetupError> key_folder() {
  const auto variable = [](const char* name) -> std::string {
    const char* value = std::getenv(name);  // NOLINT(concurrency-mt-unsafe): set-up.
    return value == nullptr ? "" : value;
  };
  if (const std::string folder = variable("RTPM_KEYS"); !folder.empty()) return folder;
  if (const std::string folder = variable("XDG_CONFIG_HOME"); !folder.empty())
    return folder + "/rtpm";
  if (const std::string home = variable("HOME"); !home.empty()) return home + "/.config/rtpm";
  return setup_error("there is no folder for keys",
                     "RTPM_KEYS, XDG_CONFIG_HOME and HOME are not set",
                     "set RTPM_KEYS to a folder of your own");
}

expected<std::string, SetupError> key_file_path(const std::string& given, std::string_view name) {
  if (!given.empty()) return given;
  auto folder = key_folder();
  if (folder) folder->append("/").append(name);
  return folder;
}

expected<crypto::KeyPair, SetupError> make_key(const std::string& path, std::string_view comment) {
  const std::filesystem::path folder = std::filesystem::path(path).parent_path();
  std::error_code error;
  if (!folder.empty() && std::filesystem::create_directories(folder, error))
    std::filesystem::permissions(folder, std::filesystem::perms::owner_all, error);
  if (error) return setup_error(printable(folder.string(), kShownWhole) + " can't be made", error);
  crypto::KeyPair pair = crypto::KeyPair::generate();
  crypto::KeyText key;
  crypto::encode_key(pair.private_key.bytes(), key);
  SecretText secret;
  // Enough for the whole line, so that growing leaves no copy behind.
  secret.text.reserve(1024);
  secret.text.append(crypto::kKeyTextName).append(" ").append(key.data(), key.size());
  crypto::wipe(std::as_writable_bytes(std::span(key)));
  if (!comment.empty()) secret.text.append(" ").append(printable(comment));
  secret.text += '\n';
  if (auto written = write_secret(path, secret.text); !written) return unexpected{written.error()};
  return pair;
}

expected<crypto::KeyPair, SetupError> read_key(const std::string& path) {
  const std::string what = printable(path, kShownWhole) + " can't be read";
  const File file(::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK));
  if (!file.is_open()) {
    const int error = errno;
    return setup_error(what, system_error(error),
                       error == ENOENT ? "make a key: rtpm key new" : "");
  }
  if (auto checked = check(file, path, kOfOthers); !checked) return unexpected{checked.error()};
  SecretText secret;
  if (const auto error = read_all(file, secret.text)) return setup_error(what, error);
  std::optional<crypto::KeyPair> pair;
  visit_lines(secret.text, [&](std::string_view line, std::size_t) {
    const std::vector<Word> words = words_of(line);
    crypto::PrivateKey key;
    if (!pair && words.size() >= 2 && words[0].text == crypto::kKeyTextName &&
        crypto::decode_key(words[1].text, key.bytes()))
      pair = crypto::KeyPair::of(std::move(key));
  });
  if (!pair)
    return setup_error(what, "it has no line 'rtpm25519 KEY'",
                       "move it away and make a key: rtpm key new");
  return std::move(*pair);
}

std::string key_comment(const std::string& path) {
  const File file(::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK));
  if (!file.is_open() || !check(file, path, kOfOthers)) return {};
  SecretText secret;
  if (read_all(file, secret.text)) return {};
  std::string comment;
  visit_lines(secret.text, [&](std::string_view line, std::size_t) {
    const std::vector<Word> words = words_of(line);
    if (comment.empty() && words.size() >= 3 && words[0].text == crypto::kKeyTextName)
      comment = printable(line.substr(words[2].column - 1));
  });
  return comment;
}

expected<std::string, SetupError> read_trusted_file(const std::string& path) {
  const File file(::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK));
  if (!file.is_open()) {
    if (errno == ENOENT) return std::string();
    return setup_error(printable(path, kShownWhole) + " can't be read", system_error(errno));
  }
  if (auto checked = check(file, path, kWriteOfOthers); !checked)
    return unexpected{checked.error()};
  std::string text;
  if (const auto error = read_all(file, text))
    return setup_error(printable(path, kShownWhole) + " can't be read", error);
  if (text.size() > kFileSizeMax)
    return setup_error(printable(path, kShownWhole) + " is not used",
                       "it has more than " + std::to_string(kFileSizeMax) + " bytes");
  return text;
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

}  // namespace rtpm::access
