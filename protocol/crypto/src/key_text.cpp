#include "rtpm/crypto/key_text.hpp"

#include <sodium.h>

namespace rtpm::crypto {

void encode_key(std::span<const std::byte, kKeySize> key, KeyText& text) noexcept {
  std::array<char, std::tuple_size_v<KeyText> + 1> terminated{};
  sodium_bin2base64(terminated.data(), terminated.size(),
                    reinterpret_cast<const unsigned char*>(key.data()), key.size(),
                    sodium_base64_VARIANT_ORIGINAL);
  std::copy_n(terminated.begin(), text.size(), text.begin());
  wipe(std::as_writable_bytes(std::span(terminated)));
}

bool decode_key(std::string_view text, std::span<std::byte, kKeySize> key) noexcept {
  std::size_t size = 0;
  return text.size() == std::tuple_size_v<KeyText> &&
         sodium_base642bin(reinterpret_cast<unsigned char*>(key.data()), key.size(), text.data(),
                           text.size(), nullptr, &size, nullptr,
                           sodium_base64_VARIANT_ORIGINAL) == 0 &&
         size == kKeySize;
}

}  // namespace rtpm::crypto
