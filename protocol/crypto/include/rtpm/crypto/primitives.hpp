#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "rtpm/base/bytes.hpp"

/// All the cryptography that RTPM uses, and the only code that uses libsodium.
namespace rtpm::crypto {

inline constexpr std::size_t kKeySize = 32;
inline constexpr std::size_t kTagSize = 16;
inline constexpr std::size_t kHashSize = 32;
inline constexpr std::size_t kNonceSize = 12;

/// Overwrites `bytes` with zeros in a way that no compiler optimizes away.
void wipe(MutableBytes bytes) noexcept;

/// 32 secret bytes. They are wiped at the end, and copied only by name.
class Secret {
 public:
  Secret() noexcept = default;
  explicit Secret(std::span<const std::byte, kKeySize> bytes) noexcept {
    std::ranges::copy(bytes, bytes_.begin());
  }
  Secret(const Secret&) = delete;
  Secret& operator=(const Secret&) = delete;
  Secret(Secret&& other) noexcept : bytes_(other.bytes_) { wipe(other.bytes_); }
  Secret& operator=(Secret&& other) noexcept {
    if (this != &other) {
      bytes_ = other.bytes_;
      wipe(other.bytes_);
    }
    return *this;
  }
  ~Secret() { wipe(bytes_); }

  [[nodiscard]] Secret clone() const noexcept { return Secret(bytes_); }
  [[nodiscard]] std::span<const std::byte, kKeySize> bytes() const noexcept { return bytes_; }
  [[nodiscard]] std::span<std::byte, kKeySize> bytes() noexcept { return bytes_; }

 private:
  std::array<std::byte, kKeySize> bytes_{};
};

using PublicKey = std::array<std::byte, kKeySize>;
using PrivateKey = Secret;
using Digest = std::array<std::byte, kHashSize>;

/// A key of X25519, long-lived or of one handshake.
struct KeyPair {
  PrivateKey private_key;
  PublicKey public_key{};

  /// @param private_key  any 32 random bytes
  [[nodiscard]] static KeyPair of(PrivateKey private_key) noexcept;
  /// Draws a key from the system's random numbers.
  [[nodiscard]] static KeyPair generate() noexcept;
  [[nodiscard]] KeyPair clone() const noexcept { return {private_key.clone(), public_key}; }
};

/// Fills `bytes` from the kernel's random numbers. libsodium keeps none, so a fork repeats none.
void fill_random(MutableBytes bytes) noexcept;

/// X25519.
/// @return false if the result is all zeros, because `theirs` is a point of small order; refuse it
/// @realtime alloc-free, 50 µs: not on a lane
[[nodiscard]] bool agree(const PrivateKey& ours, const PublicKey& theirs, Secret& shared) noexcept;

/// SHA-256 of both texts, one behind the other.
[[nodiscard]] Digest sha256(ConstBytes first, ConstBytes second) noexcept;
/// HMAC-SHA-256 of both texts, one behind the other.
void hmac_sha256(ConstBytes key, ConstBytes first, ConstBytes second, Secret& out) noexcept;

/// How frames are sealed. The numbers are the bits in COOKIE's payload.
enum class Suite : std::uint8_t {
  kChaChaPoly = 1,  ///< ChaCha20-Poly1305: every implementation has it.
  kAesGcm = 2,      ///< AES-256-GCM, where both sides have hardware for it.
};
/// The bits of all suites that this machine has.
[[nodiscard]] std::uint8_t suites_here() noexcept;
// sec-2-2: all have ChaCha20-Poly1305.
/// The suite for two sides that have these; ChaCha20-Poly1305 if there is nothing better.
[[nodiscard]] constexpr Suite best_suite(std::uint8_t ours, std::uint8_t theirs) noexcept {
  const bool has_aes = (ours & theirs & static_cast<std::uint8_t>(Suite::kAesGcm)) != 0;
  return has_aes ? Suite::kAesGcm : Suite::kChaChaPoly;
}

/// A key of authenticated encryption, expanded in advance if that makes frames cheaper. Its caller
/// never passes one number twice to seal().
/// @realtime alloc-free
class AeadKey {
 public:
  AeadKey() noexcept = default;
  AeadKey(const AeadKey&) = delete;
  AeadKey& operator=(const AeadKey&) = delete;
  ~AeadKey() { wipe_key(); }

  /// @param suite  one of suites_here()
  void set(Suite suite, const Secret& key) noexcept;
  /// Makes this the key that follows `previous`: Noise's REKEY.
  void set_next_of(const AeadKey& previous) noexcept;
  /// Makes this the same key. Only one of the two seals.
  void copy_from(const AeadKey& other) noexcept;
  void wipe_key() noexcept;

  /// Seals `plain` under `number`; `associated` is authenticated with it.
  /// @param sealed  as many bytes as `plain`, at the same place or apart from it
  void seal(std::uint64_t number, ConstBytes associated, ConstBytes plain, MutableBytes sealed,
            std::span<std::byte, kTagSize> tag) const noexcept;
  /// The reverse.
  /// @param plain  as many bytes as `sealed`, at the same place or apart from it; zeros after false
  /// @return false if not sealed under this key and number with this tag and associated data
  [[nodiscard]] bool open(std::uint64_t number, ConstBytes associated, ConstBytes sealed,
                          std::span<const std::byte, kTagSize> tag,
                          MutableBytes plain) const noexcept;

  /// Like seal(), under any nonce.
  void seal_with_nonce(std::span<const std::byte, kNonceSize> nonce, ConstBytes associated,
                       ConstBytes plain, MutableBytes sealed,
                       std::span<std::byte, kTagSize> tag) const noexcept;
  [[nodiscard]] bool open_with_nonce(std::span<const std::byte, kNonceSize> nonce,
                                     ConstBytes associated, ConstBytes sealed,
                                     std::span<const std::byte, kTagSize> tag,
                                     MutableBytes plain) const noexcept;

 private:
  // libsodium's expanded AES-256-GCM key.
  alignas(16) std::array<std::byte, 512> expanded_{};
  Secret key_;
  Suite suite_ = Suite::kChaChaPoly;
};

}  // namespace rtpm::crypto
