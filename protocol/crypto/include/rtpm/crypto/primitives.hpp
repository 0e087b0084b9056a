#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "rtpm/base/bytes.hpp"

/// All cryptography in RTPM; no other code uses libsodium.
namespace rtpm::crypto {

inline constexpr std::size_t kKeySize = 32;
inline constexpr std::size_t kTagSize = 16;
inline constexpr std::size_t kHashSize = 32;
inline constexpr std::size_t kNonceSize = 12;

/// Overwrites `bytes` with zeros in a way that compilers can't optimize away.
void wipe(MutableBytes bytes) noexcept;

/// 32 secret bytes. Wiped on destruction; copied only by an explicit call.
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

/// An X25519 key, either long-lived or for one handshake.
struct KeyPair {
  PrivateKey private_key;
  PublicKey public_key{};

  /// @param private_key  any 32 random bytes
  [[nodiscard]] static KeyPair of(PrivateKey private_key) noexcept;
  /// Generates a key from the system's random numbers.
  [[nodiscard]] static KeyPair generate() noexcept;
  [[nodiscard]] KeyPair clone() const noexcept { return {private_key.clone(), public_key}; }
};

/// Fills `bytes` from the kernel's random source. libsodium buffers none, so a fork repeats none.
void fill_random(MutableBytes bytes) noexcept;

/// X25519 key agreement.
/// @return false if the result is all zeros because `theirs` is a point of small order; then refuse
///         it
/// @realtime alloc-free, 50 µs: not on a lane
[[nodiscard]] bool agree(const PrivateKey& ours, const PublicKey& theirs, Secret& shared) noexcept;

/// SHA-256 of both texts, concatenated.
[[nodiscard]] Digest sha256(ConstBytes first, ConstBytes second) noexcept;
/// HMAC-SHA-256 of both texts, concatenated.
void hmac_sha256(ConstBytes key, ConstBytes first, ConstBytes second, Secret& out) noexcept;

/// The ciphers that can seal frames. The numbers are the bits in COOKIE's payload.
enum class Suite : std::uint8_t {
  kChaChaPoly = 1,  ///< ChaCha20-Poly1305: every implementation has it.
  kAesGcm = 2,      ///< AES-256-GCM, if both sides have hardware for it.
};
/// The bits of all suites that this machine supports.
[[nodiscard]] std::uint8_t suites_here() noexcept;
// sec-2-2: all sides have ChaCha20-Poly1305.
/// Returns AES-256-GCM if both sides have it, otherwise ChaCha20-Poly1305.
[[nodiscard]] constexpr Suite best_suite(std::uint8_t ours, std::uint8_t theirs) noexcept {
  const bool has_aes = (ours & theirs & static_cast<std::uint8_t>(Suite::kAesGcm)) != 0;
  return has_aes ? Suite::kAesGcm : Suite::kChaChaPoly;
}

/// A key for authenticated encryption, expanded in advance if that speeds up frames. The caller
/// must never pass the same number to seal() twice.
/// @realtime alloc-free
class AeadKey {
 public:
  AeadKey() noexcept = default;
  AeadKey(const AeadKey&) = delete;
  AeadKey& operator=(const AeadKey&) = delete;
  ~AeadKey() { wipe_key(); }

  /// @param suite  one of suites_here()
  void set(Suite suite, const Secret& key) noexcept;
  /// Makes this the key after `previous`: Noise's REKEY.
  void set_next_of(const AeadKey& previous) noexcept;
  /// Makes this a copy of `other`. Only one of the two may seal.
  void copy_from(const AeadKey& other) noexcept;
  void wipe_key() noexcept;

  /// Seals `plain` under `number`; `associated` is authenticated with it.
  /// @param sealed  the same size as `plain`, at the same address or not overlapping
  void seal(std::uint64_t number, ConstBytes associated, ConstBytes plain, MutableBytes sealed,
            std::span<std::byte, kTagSize> tag) const noexcept;
  /// Opens what seal() sealed.
  /// @param plain  the same size as `sealed`, at the same address or not overlapping; zeros on
  ///           failure
  /// @return false if not sealed with this key, number, tag and associated data
  [[nodiscard]] bool open(std::uint64_t number, ConstBytes associated, ConstBytes sealed,
                          std::span<const std::byte, kTagSize> tag,
                          MutableBytes plain) const noexcept;

  /// Like seal(), with any nonce.
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
