#include "rtpm/crypto/primitives.hpp"

#include <gtest/gtest.h>

#include <string_view>

#include "crypto_fixture.hpp"
#include "rtpm/crypto/key_text.hpp"
#include "vectors.hpp"

namespace rtpm::crypto::test {
namespace {

Secret secret_of(const std::string& hex) {
  return Secret(std::span<const std::byte, kKeySize>(bytes_of_hex(hex)));
}
PublicKey public_of(const std::string& hex) {
  PublicKey key;
  std::ranges::copy(bytes_of_hex(hex), key.begin());
  return key;
}
ConstBytes bytes_of(std::string_view text) {
  return std::as_bytes(std::span(text));
}

// RFC 7748, 5.2: its first test, and the first round of its iterated test (9 is also the base).
TEST(Primitives, AgreeAsInRfc7748) {
  Secret shared;
  ASSERT_TRUE(agree(secret_of("a546e36bf0527c9d3b16154b82465edd62144c0ac1fc5a18506a2244ba449ac4"),
                    public_of("e6db6867583030db3594c1a424b15f7c726624ec26b3353b10a903a6d0ab1c4c"),
                    shared));
  EXPECT_TRUE(std::ranges::equal(
      shared.bytes(),
      bytes_of_hex("c3da55379de9c6908e94ea4df28d084f32eccf03491c71f754b4075577a28552")));
  Secret nine;
  nine.bytes()[0] = std::byte{9};
  EXPECT_EQ(KeyPair::of(std::move(nine)).public_key,
            public_of("422c8e7a6227d7bca1350b3e2bb7279f7897b87bb6854b783c60e80311ae3079"));
}

// sec-2-3
TEST(Primitives, RefuseKeysOfSmallOrder) {
  const KeyPair pair = KeyPair::generate();
  Secret shared;
  EXPECT_FALSE(agree(pair.private_key, PublicKey{}, shared));
  PublicKey one{};
  one[0] = std::byte{1};
  EXPECT_FALSE(agree(pair.private_key, one, shared));
}

// FIPS 180-4's "abc", and RFC 4231's second test.
TEST(Primitives, HashAsPublished) {
  EXPECT_EQ(sha256(bytes_of("a"), bytes_of("bc")),
            public_of("ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"));
  Secret code;
  hmac_sha256(bytes_of("Jefe"), bytes_of("what do ya want "), bytes_of("for nothing?"), code);
  EXPECT_TRUE(std::ranges::equal(
      code.bytes(),
      bytes_of_hex("5bdcc146bf60754e6a042426089575c75a003f089d2739839dec58b964ec3843")));
}

// RFC 8439, 2.8.2.
TEST(Primitives, SealAsInRfc8439) {
  const Bytes plain = bytes_of_hex(
      "4c616469657320616e642047656e746c656d656e206f662074686520636c617373206f66202739393a2049662049"
      "20636f756c64206f6666657220796f75206f6e6c79206f6e652074697020666f7220746865206675747572652c20"
      "73756e73637265656e20776f756c642062652069742e");
  const Bytes nonce = bytes_of_hex("070000004041424344454647");
  AeadKey key;
  key.set(Suite::kChaChaPoly,
          secret_of("808182838485868788898a8b8c8d8e8f909192939495969798999a9b9c9d9e9f"));
  Bytes sealed(plain.size());
  Bytes tag(kTagSize);
  key.seal_with_nonce(std::span<const std::byte, kNonceSize>(nonce),
                      bytes_of_hex("50515253c0c1c2c3c4c5c6c7"), plain, sealed,
                      std::span<std::byte, kTagSize>(tag));
  EXPECT_EQ(tag, bytes_of_hex("1ae10b594f09e26a7e902ecbd0600691"));
}

// Test case 14 of the proposal of GCM to NIST: a key, a nonce and a block of zeros.
TEST(Primitives, SealAsInTheGcmProposal) {
  if (all_suites().size() < 2) GTEST_SKIP() << "this machine has no hardware for AES";
  AeadKey key;
  key.set(Suite::kAesGcm, Secret{});
  const Bytes plain(16);
  Bytes sealed(16), tag(kTagSize);
  key.seal(0, {}, plain, sealed, std::span<std::byte, kTagSize>(tag));
  EXPECT_EQ(sealed, bytes_of_hex("cea7403d4d606b6e074ec5d3baf39d18"));
  EXPECT_EQ(tag, bytes_of_hex("d0d1c8a799996bf0265b98b5d48ab919"));
}

// sec-2-2
TEST(Primitives, ChooseTheBestCommonSuite) {
  const auto chacha = static_cast<std::uint8_t>(Suite::kChaChaPoly);
  const std::uint8_t both = 3;
  EXPECT_EQ(best_suite(both, both), Suite::kAesGcm);
  EXPECT_EQ(best_suite(both, chacha), Suite::kChaChaPoly);
  EXPECT_EQ(best_suite(chacha, both), Suite::kChaChaPoly);
  EXPECT_NE(suites_here() & chacha, 0);
}

TEST(Primitives, WipeTheSourceOfAMovedSecret) {
  Random random(1);
  Secret from = random_secret(random);
  const Secret to = std::move(from);
  EXPECT_FALSE(std::ranges::equal(to.bytes(), Bytes(kKeySize)));
  EXPECT_TRUE(std::ranges::equal(from.bytes(), Bytes(kKeySize)));  // NOLINT: the moved-from object.
}

TEST(Primitives, ConvertKeysToTextAndBack) {
  Random random(2);
  for (int i = 0; i < 100; ++i) {
    const PublicKey key = random_pair(random).public_key;
    KeyText text;
    encode_key(key, text);
    PublicKey read{};
    ASSERT_TRUE(decode_key({text.data(), text.size()}, read));
    EXPECT_EQ(read, key);
  }
  PublicKey key;
  EXPECT_TRUE(decode_key("AAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAA=", key));
  // The texts are short, long, unpadded, not Base64, and of 33 bytes.
  for (const char* bad : {"", "AAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAA==",
                          "AAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAA==",
                          "AAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAA",
                          "*AAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAA=",
                          "AAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAA"}) {
    EXPECT_FALSE(decode_key(bad, key)) << bad;
  }
}

}  // namespace
}  // namespace rtpm::crypto::test
