#include "web/token.hpp"

#include <sys/random.h>

#include <array>
#include <cerrno>
#include <cstddef>

namespace rtpm::console {

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
  // The compiler must not leave the loop early.
  asm volatile("" : "+r"(difference));
  return difference == 0;
}

}  // namespace rtpm::console
