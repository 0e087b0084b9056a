#include "rtpm/access/fingerprint.hpp"

#include <cctype>
#include <span>

#include "rtpm/crypto/key_text.hpp"
#include "words.hpp"

namespace rtpm::access {
namespace {

constexpr std::size_t kByteCount = 10;
constexpr std::size_t kGroupSize = 4;  // In digits.

/// The digits of a fingerprint, in lower case and without dashes.
std::string digits_of(std::string_view text) {
  std::string digits;
  for (const char each : text) {
    if (each != '-') digits += static_cast<char>(std::tolower(static_cast<unsigned char>(each)));
  }
  return digits;
}

}  // namespace

std::string fingerprint(const crypto::PublicKey& key) {
  constexpr std::string_view kDigits = "0123456789abcdef";
  const crypto::Digest digest = crypto::sha256(key, {});
  std::string text;
  for (std::size_t i = 0; i < kByteCount; ++i) {
    const auto byte = std::to_integer<unsigned>(digest[i]);
    if (i > 0 && 2 * i % kGroupSize == 0) text += '-';
    text += kDigits[byte >> 4];
    text += kDigits[byte & 0xf];
  }
  return text;
}

bool is_fingerprint_of(std::string_view text, const crypto::PublicKey& key) {
  return digits_of(text) == digits_of(fingerprint(key));
}

std::string public_key_text(const crypto::PublicKey& key) {
  crypto::KeyText text;
  crypto::encode_key(key, text);
  std::string line(crypto::kKeyTextName);
  line += ' ';
  return line.append(text.data(), text.size());
}

std::optional<crypto::PublicKey> parse_public_key(std::string_view text) {
  const std::vector<Word> words = words_of(text);
  crypto::PublicKey key{};
  if (words.size() < 2 || words[0].text != crypto::kKeyTextName) return std::nullopt;
  if (!crypto::decode_key(words[1].text, key)) return std::nullopt;
  return key;
}

}  // namespace rtpm::access
