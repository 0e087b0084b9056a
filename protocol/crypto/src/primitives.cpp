#include "rtpm/crypto/primitives.hpp"

#include <sodium.h>

#include <type_traits>
#include <utility>

#include "rtpm/base/assert.hpp"

namespace rtpm::crypto {
namespace {

using Nonce = std::array<std::byte, kNonceSize>;
static_assert(crypto_aead_chacha20poly1305_ietf_NPUBBYTES == kNonceSize &&
              crypto_aead_aes256gcm_NPUBBYTES == kNonceSize);
static_assert(crypto_aead_chacha20poly1305_ietf_ABYTES == kTagSize &&
              crypto_aead_aes256gcm_ABYTES == kTagSize);

// A byte container as libsodium expects it.
template <class Bytes>
auto* raw(Bytes&& bytes) noexcept {
  if constexpr (std::is_const_v<std::remove_pointer_t<decltype(bytes.data())>>) {
    return reinterpret_cast<const unsigned char*>(bytes.data());
  } else {
    return reinterpret_cast<unsigned char*>(bytes.data());
  }
}
const crypto_aead_aes256gcm_state* state_of(const std::array<std::byte, 512>& expanded) noexcept {
  static_assert(sizeof(crypto_aead_aes256gcm_state) == 512);
  return reinterpret_cast<const crypto_aead_aes256gcm_state*>(expanded.data());
}

// Noise, 12.3 and 12.4: ChaChaPoly counts little-endian, AESGCM big-endian.
Nonce nonce_of(Suite suite, std::uint64_t number) noexcept {
  Nonce nonce{};
  for (std::size_t i = 0; i < 8; ++i) {
    const std::size_t at = suite == Suite::kAesGcm ? 11 - i : 4 + i;
    nonce[at] = static_cast<std::byte>(number >> (8 * i));
  }
  return nonce;
}

}  // namespace

void wipe(MutableBytes bytes) noexcept {
  sodium_memzero(bytes.data(), bytes.size());
}

KeyPair KeyPair::of(PrivateKey private_key) noexcept {
  KeyPair pair{std::move(private_key), {}};
  crypto_scalarmult_curve25519_base(raw(pair.public_key), raw(pair.private_key.bytes()));
  return pair;
}

KeyPair KeyPair::generate() noexcept {
  PrivateKey key;
  fill_random(key.bytes());
  return of(std::move(key));
}

void fill_random(MutableBytes bytes) noexcept {
  randombytes_buf(bytes.data(), bytes.size());
}

bool agree(const PrivateKey& ours, const PublicKey& theirs, Secret& shared) noexcept {
  return crypto_scalarmult_curve25519(raw(shared.bytes()), raw(ours.bytes()), raw(theirs)) == 0;
}

Digest sha256(ConstBytes first, ConstBytes second) noexcept {
  crypto_hash_sha256_state state;
  crypto_hash_sha256_init(&state);
  crypto_hash_sha256_update(&state, raw(first), first.size());
  crypto_hash_sha256_update(&state, raw(second), second.size());
  Digest digest;
  crypto_hash_sha256_final(&state, raw(digest));
  return digest;
}

void hmac_sha256(ConstBytes key, ConstBytes first, ConstBytes second, Secret& out) noexcept {
  crypto_auth_hmacsha256_state state;
  crypto_auth_hmacsha256_init(&state, raw(key), key.size());
  crypto_auth_hmacsha256_update(&state, raw(first), first.size());
  crypto_auth_hmacsha256_update(&state, raw(second), second.size());
  crypto_auth_hmacsha256_final(&state, raw(out.bytes()));
  sodium_memzero(&state, sizeof state);
}

std::uint8_t suites_here() noexcept {
  // The CPU's features are known only after sodium_init().
  static const bool kHasAes = sodium_init() >= 0 && crypto_aead_aes256gcm_is_available() == 1;
  const auto chacha = static_cast<unsigned>(Suite::kChaChaPoly);
  const auto aes = kHasAes ? static_cast<unsigned>(Suite::kAesGcm) : 0U;
  return static_cast<std::uint8_t>(chacha | aes);
}

void AeadKey::set(Suite suite, const Secret& key) noexcept {
  RTPM_ASSERT((suites_here() & static_cast<std::uint8_t>(suite)) != 0,
              "a suite was chosen that this machine lacks");
  suite_ = suite;
  std::ranges::copy(key.bytes(), key_.bytes().begin());
  if (suite == Suite::kAesGcm) {
    crypto_aead_aes256gcm_beforenm(reinterpret_cast<crypto_aead_aes256gcm_state*>(expanded_.data()),
                                   raw(key.bytes()));
  }
}

// Noise, 4.2: the first 32 bytes of zeros, sealed under the largest number.
void AeadKey::set_next_of(const AeadKey& previous) noexcept {
  const std::array<std::byte, kKeySize> zeros{};
  Secret next;
  std::array<std::byte, kTagSize> tag;
  previous.seal(~std::uint64_t{0}, {}, zeros, next.bytes(), tag);
  set(previous.suite_, next);
}

void AeadKey::copy_from(const AeadKey& other) noexcept {
  expanded_ = other.expanded_;
  std::ranges::copy(other.key_.bytes(), key_.bytes().begin());
  suite_ = other.suite_;
}

void AeadKey::wipe_key() noexcept {
  wipe(expanded_);
  wipe(key_.bytes());
}

void AeadKey::seal(std::uint64_t number, ConstBytes associated, ConstBytes plain,
                   MutableBytes sealed, std::span<std::byte, kTagSize> tag) const noexcept {
  seal_with_nonce(nonce_of(suite_, number), associated, plain, sealed, tag);
}

bool AeadKey::open(std::uint64_t number, ConstBytes associated, ConstBytes sealed,
                   std::span<const std::byte, kTagSize> tag, MutableBytes plain) const noexcept {
  return open_with_nonce(nonce_of(suite_, number), associated, sealed, tag, plain);
}

void AeadKey::seal_with_nonce(std::span<const std::byte, kNonceSize> nonce, ConstBytes associated,
                              ConstBytes plain, MutableBytes sealed,
                              std::span<std::byte, kTagSize> tag) const noexcept {
  RTPM_ASSERT(sealed.size() == plain.size(), "sealing keeps the size");
  // libsodium accepts no null pointer for an empty text.
  unsigned char none = 0;
  unsigned char* const to = sealed.empty() ? &none : raw(sealed);
  if (suite_ == Suite::kAesGcm) {
    crypto_aead_aes256gcm_encrypt_detached_afternm(to, raw(tag), nullptr, raw(plain), plain.size(),
                                                   raw(associated), associated.size(), nullptr,
                                                   raw(nonce), state_of(expanded_));
  } else {
    crypto_aead_chacha20poly1305_ietf_encrypt_detached(
        to, raw(tag), nullptr, raw(plain), plain.size(), raw(associated), associated.size(),
        nullptr, raw(nonce), raw(key_.bytes()));
  }
}

bool AeadKey::open_with_nonce(std::span<const std::byte, kNonceSize> nonce, ConstBytes associated,
                              ConstBytes sealed, std::span<const std::byte, kTagSize> tag,
                              MutableBytes plain) const noexcept {
  RTPM_ASSERT(sealed.size() == plain.size(), "opening keeps the size");
  // libsodium accepts no null pointer here, either; without an output it would only check the tag.
  unsigned char none = 0;
  unsigned char* const to = plain.empty() ? &none : raw(plain);
  const unsigned char* const from = sealed.empty() ? &none : raw(sealed);
  if (suite_ == Suite::kAesGcm) {
    return crypto_aead_aes256gcm_decrypt_detached_afternm(
               to, nullptr, from, sealed.size(), raw(tag), raw(associated), associated.size(),
               raw(nonce), state_of(expanded_)) == 0;
  }
  return crypto_aead_chacha20poly1305_ietf_decrypt_detached(
             to, nullptr, from, sealed.size(), raw(tag), raw(associated), associated.size(),
             raw(nonce), raw(key_.bytes())) == 0;
}

}  // namespace rtpm::crypto
