#include "web/token.hpp"

#include <fcntl.h>
#include <sys/random.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cerrno>
#include <cstddef>
#include <utility>

namespace rtpm::console {
namespace {

constexpr mode_t kForThisUser = 0600;
constexpr mode_t kOfOthers = 077;

/// Creates the file with `token`; false if the file exists already.
expected<bool, SetupError> make_file(const std::string& path, const std::string& token) {
  const int file =
      ::open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC | O_NOFOLLOW, kForThisUser);
  if (file < 0 && errno == EEXIST) return false;
  if (file < 0) {
    return setup_error("the token file " + path + " can't be made", system_error(errno),
                       "give --token-file another place");
  }
  const std::string line = token + "\n";
  const bool is_written =
      ::write(file, line.data(), line.size()) == static_cast<ssize_t>(line.size());
  const int reason = errno;
  ::close(file);
  if (is_written) return true;
  ::unlink(path.c_str());
  return setup_error("the token file " + path + " can't be written", system_error(reason));
}

}  // namespace

bool is_token(std::string_view text) noexcept {
  return text.size() >= kTokenSizeMin && text.size() <= kTokenSizeMax &&
         std::ranges::all_of(text, [](unsigned char c) {
           return std::isalnum(c) != 0 || c == '-' || c == '_' || c == '.' || c == '~';
         });
}

expected<std::string, SetupError> token_in_file(const std::string& path) {
  auto token = make_token();
  if (!token) return token;
  const auto is_made = make_file(path, *token);
  if (!is_made) return unexpected{is_made.error()};
  if (*is_made) return token;
  // If the file is a pipe, it must not block the start.
  const int file = ::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);
  if (file < 0) {
    return setup_error("the token file " + path + " can't be read", system_error(errno));
  }
  struct stat found {};
  std::array<char, kTokenSizeMax + 2> bytes{};
  const bool is_regular = ::fstat(file, &found) == 0 && S_ISREG(found.st_mode);
  const ssize_t size = is_regular ? ::read(file, bytes.data(), bytes.size()) : -1;
  ::close(file);
  if (is_regular && (found.st_mode & kOfOthers) != 0) {
    return setup_error("the token file " + path + " is not safe", "other users may read it",
                       "chmod 600 " + path);
  }
  std::string_view text(bytes.data(), static_cast<std::size_t>(std::max<ssize_t>(size, 0)));
  if (text.ends_with('\n')) text.remove_suffix(1);
  if (!is_token(text)) {
    return setup_error("the token file " + path + " has no token",
                       "a token has " + std::string(kTokenForm),
                       "remove the file, and rtpm-console makes a new one");
  }
  return std::string(text);
}

expected<std::string, SetupError> make_token() {
  constexpr char kDigits[] = "0123456789abcdef";
  std::array<unsigned char, 24> bytes{};
  if (::getrandom(bytes.data(), bytes.size(), 0) != static_cast<ssize_t>(bytes.size())) {
    return setup_error("the system gives no random numbers", system_error(errno));
  }
  std::string token;
  for (const unsigned char byte : bytes) {
    token += kDigits[byte >> 4];
    token += kDigits[byte & 15];
  }
  return token;
}

bool is_same_token(std::string_view a, std::string_view b) noexcept {
  if (a.size() != b.size()) return false;
  unsigned difference = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    const auto one = static_cast<unsigned char>(a[i]);
    difference |= static_cast<unsigned>(one ^ static_cast<unsigned char>(b[i]));
  }
  // Prevents the compiler from leaving the loop early.
  asm volatile("" : "+r"(difference));
  return difference == 0;
}

}  // namespace rtpm::console
