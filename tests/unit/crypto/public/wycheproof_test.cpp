#include <gtest/gtest.h>

#include "rtpm/crypto/primitives.hpp"
#include "vectors.hpp"

namespace rtpm::crypto::test {
namespace {

constexpr auto kMissing = "RTPM_PUBLIC_VECTORS has no files of Wycheproof, see tests/unit/crypto";

void expect_seals_as(Suite suite, const std::vector<SealVector>& vectors, int expected_count) {
  if ((suites_here() & static_cast<unsigned>(suite)) == 0) {
    GTEST_SKIP() << "this machine has no hardware for AES";
  }
  int played_count = 0;
  for (const SealVector& vector : vectors) {
    // RTPM has a single size of key and of nonce, and its nonces are four zero bytes and a counter:
    // its interface cannot express the others. libsodium's own tests cover them.
    if (vector.key_bits != 256 || vector.nonce_bits != 96) continue;
    SCOPED_TRACE(vector.id);
    ++played_count;
    AeadKey key;
    key.set(suite, Secret(std::span<const std::byte, kKeySize>(vector.key)));
    const std::span<const std::byte, 12> nonce(vector.nonce);
    const std::span<const std::byte, kTagSize> tag(vector.tag);
    Bytes plain(vector.sealed.size());
    EXPECT_EQ(key.open_with_nonce(nonce, vector.associated, vector.sealed, tag, plain),
              vector.is_valid);
    if (!vector.is_valid) continue;
    EXPECT_EQ(plain, vector.plain);
    Bytes sealed(plain.size());
    Bytes own_tag(kTagSize);
    key.seal_with_nonce(nonce, vector.associated, plain, sealed,
                        std::span<std::byte, kTagSize>(own_tag));
    EXPECT_EQ(sealed, vector.sealed);
    EXPECT_EQ(own_tag, vector.tag);
  }
  EXPECT_EQ(played_count, expected_count);
}

TEST(Wycheproof, X25519) {
  const auto vectors = read_key_agreement();
  if (!vectors) GTEST_SKIP() << kMissing;
  EXPECT_EQ(vectors->size(), 518u);
  const Bytes zeros(kKeySize);
  for (const KeyAgreementVector& vector : *vectors) {
    SCOPED_TRACE(vector.id);
    PublicKey theirs;
    std::ranges::copy(vector.public_key, theirs.begin());
    Secret shared;
    const bool is_agreed =
        agree(Secret(std::span<const std::byte, kKeySize>(vector.private_key)), theirs, shared);
    EXPECT_EQ(is_agreed, vector.shared != zeros);
    if (is_agreed) {
      EXPECT_TRUE(std::ranges::equal(shared.bytes(), vector.shared));
    }
  }
}

TEST(Wycheproof, AesGcm) {
  const auto vectors = read_seals("aes_gcm_test.json");
  if (!vectors) GTEST_SKIP() << kMissing;
  expect_seals_as(Suite::kAesGcm, *vectors, 66);
}

TEST(Wycheproof, ChaCha20Poly1305) {
  const auto vectors = read_seals("chacha20_poly1305_test.json");
  if (!vectors) GTEST_SKIP() << kMissing;
  expect_seals_as(Suite::kChaChaPoly, *vectors, 316);
}

}  // namespace
}  // namespace rtpm::crypto::test
