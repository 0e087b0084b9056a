#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstring>
#include <string_view>

#include "rtpm/crypto/primitives.hpp"

namespace rtpm::crypto {

/// SHA-256, the hash of RTPM's handshakes, as SymmetricState needs it.
struct Sha256 {
  static constexpr std::size_t kSize = kHashSize;
  using Value = std::array<std::byte, kSize>;
  [[nodiscard]] static Value hash(ConstBytes first, ConstBytes second) noexcept {
    return sha256(first, second);
  }
  static void hmac(ConstBytes key, ConstBytes first, ConstBytes second, Value& out) noexcept {
    Secret secret;
    hmac_sha256(key, first, second, secret);
    std::ranges::copy(secret.bytes(), out.begin());
  }
};

/// Noise's SymmetricState: hashing and key derivation for both sides of a handshake. A template on
/// the hash, so that the public test vectors of other hashes apply, too.
/// @realtime alloc-free
/// @source   The Noise Protocol Framework, revision 34, 5.1 and 5.2
template <class Hash>
class SymmetricState {
 public:
  using Value = typename Hash::Value;

  SymmetricState(std::string_view protocol_name, Suite suite) noexcept : suite_(suite) {
    const ConstBytes name = std::as_bytes(std::span(protocol_name));
    if (name.size() <= Hash::kSize) {
      std::ranges::copy(name, hash_.begin());
    } else {
      hash_ = Hash::hash(name, {});
    }
    chaining_key_ = hash_;
  }
  SymmetricState(const SymmetricState&) = delete;
  SymmetricState& operator=(const SymmetricState&) = delete;
  ~SymmetricState() { wipe(chaining_key_); }

  /// Copies the state of `other`. Only one of the two may encrypt.
  void copy_from(const SymmetricState& other) noexcept {
    hash_ = other.hash_;
    chaining_key_ = other.chaining_key_;
    key_.copy_from(other.key_);
    suite_ = other.suite_;
    has_key_ = other.has_key_;
    number_ = other.number_;
  }

  void mix_hash(ConstBytes data) noexcept { hash_ = Hash::hash(hash_, data); }

  void mix_key(ConstBytes input) noexcept {
    Derived derived;
    derive(input, 2, derived);
    chaining_key_ = derived.values[0];
    take_key(derived.values[1]);
  }
  void mix_key_and_hash(ConstBytes input) noexcept {
    Derived derived;
    derive(input, 3, derived);
    chaining_key_ = derived.values[0];
    mix_hash(derived.values[1]);
    take_key(derived.values[2]);
  }

  /// How many bytes the next encrypt_and_hash() adds to the plain text.
  [[nodiscard]] std::size_t overhead() const noexcept { return has_key_ ? kTagSize : 0; }

  /// @param out  plain.size() + overhead() bytes
  void encrypt_and_hash(ConstBytes plain, MutableBytes out) noexcept {
    if (has_key_) {
      const MutableBytes sealed = out.first(plain.size());
      key_.seal(number_++, hash_, plain, sealed,
                std::span<std::byte, kTagSize>(out.subspan(plain.size(), kTagSize)));
    } else {
      std::ranges::copy(plain, out.begin());
    }
    mix_hash(out);
  }
  /// @param out  text.size() - overhead() bytes
  /// @return false if not authentic; nothing has changed then
  [[nodiscard]] bool decrypt_and_hash(ConstBytes text, MutableBytes out) noexcept {
    if (has_key_) {
      const ConstBytes tag = text.last(kTagSize);
      if (!key_.open(number_, hash_, text.first(text.size() - kTagSize),
                     std::span<const std::byte, kTagSize>(tag), out)) {
        return false;
      }
      ++number_;
    } else {
      std::ranges::copy(text, out.begin());
    }
    mix_hash(text);
    return true;
  }

  /// The keys of the two directions: the initiator seals with the first one.
  void split(Secret& initiator, Secret& responder) noexcept {
    Derived derived;
    derive({}, 2, derived);
    std::ranges::copy_n(derived.values[0].begin(), kKeySize, initiator.bytes().begin());
    std::ranges::copy_n(derived.values[1].begin(), kKeySize, responder.bytes().begin());
  }
  [[nodiscard]] const Value& handshake_hash() const noexcept { return hash_; }

 private:
  struct Derived {
    std::array<Value, 3> values{};
    ~Derived() {
      for (Value& value : values)
        wipe(value);
    }
  };

  // Noise's HKDF, 4.3.
  void derive(ConstBytes input, std::size_t count, Derived& derived) const noexcept {
    Value temporary;
    Hash::hmac(chaining_key_, input, {}, temporary);
    ConstBytes previous{};
    for (std::size_t i = 0; i < count; ++i) {
      const std::array<std::byte, 1> index{static_cast<std::byte>(i + 1)};
      Hash::hmac(temporary, previous, index, derived.values[i]);
      previous = derived.values[i];
    }
    wipe(temporary);
  }
  void take_key(const Value& value) noexcept {
    const Secret key(std::span<const std::byte, kKeySize>(value.data(), kKeySize));
    key_.set(suite_, key);
    has_key_ = true;
    number_ = 0;
  }

  Value hash_{};
  Value chaining_key_{};
  AeadKey key_;
  Suite suite_;
  bool has_key_ = false;
  std::uint64_t number_ = 0;
};

}  // namespace rtpm::crypto
