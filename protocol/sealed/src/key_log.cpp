#include "rtpm/sealed/key_log.hpp"

#include <array>
#include <string_view>

namespace rtpm::sealed {
namespace {

std::string hex_of(ConstBytes bytes) {
  constexpr std::string_view kDigits = "0123456789abcdef";
  std::string text;
  for (const std::byte byte : bytes) {
    text += kDigits[std::to_integer<unsigned>(byte) >> 4];
    text += kDigits[std::to_integer<unsigned>(byte) & 15];
  }
  return text;
}

}  // namespace

std::string key_log_line(std::uint64_t session, crypto::Suite suite, const crypto::Secret& client,
                         const crypto::Secret& server) {
  std::array<std::byte, 8> number;
  for (std::size_t i = 0; i < number.size(); ++i)
    number[i] = static_cast<std::byte>(session >> (56 - 8 * i));
  return "RTPM_SESSION " + hex_of(number) +
         (suite == crypto::Suite::kAesGcm ? " aes-256-gcm " : " chacha20-poly1305 ") +
         hex_of(client.bytes()) + " " + hex_of(server.bytes());
}

}  // namespace rtpm::sealed
