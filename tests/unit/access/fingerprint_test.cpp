#include "rtpm/access/fingerprint.hpp"

#include <gtest/gtest.h>

#include "keys.hpp"

namespace rtpm::access {
namespace {

// Computed with Python's hashlib: sha256(bytes([1] * 32)).
TEST(Fingerprint, IsAPrefixOfSha256InGroups) {
  EXPECT_EQ(fingerprint(key_of(1)), "72cd-6e84-22c4-07fb-6d09");
  EXPECT_TRUE(is_fingerprint_of("72CD6E8422C407FB6D09", key_of(1)));
  EXPECT_FALSE(is_fingerprint_of("72cd-6e84-22c4-07fb", key_of(1)));
  EXPECT_FALSE(is_fingerprint_of("", key_of(1)));
  EXPECT_FALSE(is_fingerprint_of(fingerprint(key_of(1)), key_of(2)));
}

TEST(PublicKeyText, IsReadWithOrWithoutAComment) {
  const std::string text = public_key_text(key_of(7));
  EXPECT_EQ(text, text_of(7));
  EXPECT_EQ(parse_public_key(text), key_of(7));
  EXPECT_EQ(parse_public_key("  " + text + " alice@lab\n"), key_of(7));
  EXPECT_EQ(parse_public_key(text.substr(0, text.size() - 1)), std::nullopt);
  EXPECT_EQ(parse_public_key("ssh-ed25519 AAAA"), std::nullopt);
  EXPECT_EQ(parse_public_key(""), std::nullopt);
}

}  // namespace
}  // namespace rtpm::access
