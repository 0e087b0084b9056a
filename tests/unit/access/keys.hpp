#pragma once

#include <string>

#include "rtpm/access/subject.hpp"

namespace rtpm::access {

/// Base64 of 32 bytes that are all `value`, and the subject with this key.
inline crypto::PublicKey key_of(unsigned char value) {
  crypto::PublicKey key{};
  key.fill(std::byte{value});
  return key;
}
inline Subject subject_of(unsigned char value) {
  return {Subject::Kind::kKey, 0, key_of(value)};
}
/// "rtpm25519 BASE64"
inline std::string text_of(unsigned char value) {
  return to_text(subject_of(value));
}

}  // namespace rtpm::access
