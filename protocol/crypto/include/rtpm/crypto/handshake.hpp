#pragma once

#include <cstdint>
#include <string_view>

#include "rtpm/base/expected.hpp"
#include "rtpm/crypto/symmetric_state.hpp"

namespace rtpm::crypto {

/// Why a handshake message was rejected. No answer is sent. A Responder accepts no other message
/// after kBadKey or kNotSealed.
enum class HandshakeError : std::uint8_t {
  kBadSize,    ///< The message has a size that this handshake does not have.
  kBadKey,     ///< A public key of small order, whose shared secret would be public.
  kNotSealed,  ///< Made with other keys, another prologue or suite, or modified in transit.
  kOutOfTurn,  ///< This side neither expects nor sends such a message now.
};
[[nodiscard]] std::string_view to_string(HandshakeError error) noexcept;

/// The result of a handshake: one key per direction, and the handshake hash.
struct SessionKeys {
  Suite suite = Suite::kChaChaPoly;
  Secret send;
  Secret receive;
  Digest handshake_hash{};  ///< Public; unique for each handshake.
};

/// A 32-byte secret that both sides share besides their keys; all zeros if there is none.
using PresharedKey = Secret;

/// The size of messages 1 and 2 with a payload of `payload_size` bytes.
[[nodiscard]] constexpr std::size_t message_1_size(std::size_t payload_size) noexcept {
  return 2 * kKeySize + kTagSize + payload_size + kTagSize;
}
[[nodiscard]] constexpr std::size_t message_2_size(std::size_t payload_size) noexcept {
  return kKeySize + payload_size + kTagSize;
}

/// "Noise_IKpsk2_25519_AESGCM_SHA256", …
[[nodiscard]] std::string_view protocol_name(Suite suite) noexcept;

/// The client's side of Noise_IKpsk2. Single use: write_message_1(), read_message_2(), keys().
/// @threads  one at a time
/// @realtime alloc-free; 100 µs for message 1, 100 µs for message 2: not on a lane
/// @source   The Noise Protocol Framework, revision 34, 7.5 and 9
class Initiator {
 public:
  /// @param own        the client's long-lived key
  /// @param server     the server's key, known in advance
  /// @param ephemeral  KeyPair::generate(); for this handshake only. Never reuse it for a message 1
  ///           that differs in any byte or in its prologue
  /// @param prologue   the bytes that both sides must agree on; the handshake checks this
  Initiator(Suite suite, KeyPair own, const PublicKey& server, PresharedKey preshared,
            KeyPair ephemeral, ConstBytes prologue) noexcept;

  /// @param out  message_1_size(payload.size()) bytes
  [[nodiscard]] expected<void, HandshakeError> write_message_1(ConstBytes payload,
                                                               MutableBytes out) noexcept;
  /// After an error other than kOutOfTurn, the handshake keeps waiting for the right message 2, so
  /// a forged one does not end it.
  /// @param payload  receives message.size() - message_2_size(0) bytes
  [[nodiscard]] expected<void, HandshakeError> read_message_2(ConstBytes message,
                                                              MutableBytes payload) noexcept;
  /// Returns the keys once message 2 was read; can be called once.
  [[nodiscard]] expected<SessionKeys, HandshakeError> keys() noexcept;

 private:
  enum class State : std::uint8_t { kFresh, kSent, kDone, kOver };
  State state_ = State::kFresh;
  Suite suite_;
  KeyPair own_;
  KeyPair ephemeral_;
  PublicKey server_;
  PresharedKey preshared_;
  SymmetricState<Sha256> symmetric_;
};

/// The server's side: call read_message_1(), check the client's key, then call write_message_2()
/// and keys().
/// @threads  one at a time
/// @realtime alloc-free; 100 µs for message 1, 140 µs for message 2: not on a lane
class Responder {
 public:
  Responder(Suite suite, KeyPair own, PresharedKey preshared, ConstBytes prologue) noexcept;

  /// @param payload  receives message.size() - message_1_size(0) bytes
  /// @return the client's key. The client has proved that it owns the key, but perhaps long ago:
  ///         message 1 may be a replay, so do not change any state because of it
  [[nodiscard]] expected<PublicKey, HandshakeError> read_message_1(ConstBytes message,
                                                                   MutableBytes payload) noexcept;
  /// @param ephemeral  KeyPair::generate(); for this handshake only
  /// @param out        message_2_size(payload.size()) bytes
  [[nodiscard]] expected<void, HandshakeError> write_message_2(KeyPair ephemeral,
                                                               ConstBytes payload,
                                                               MutableBytes out) noexcept;
  /// Returns the keys once message 2 was written; can be called once. Only the client's first
  /// sealed frame proves that the client takes part.
  [[nodiscard]] expected<SessionKeys, HandshakeError> keys() noexcept;

 private:
  enum class State : std::uint8_t { kFresh, kReceived, kDone, kOver };
  State state_ = State::kFresh;
  Suite suite_;
  KeyPair own_;
  PublicKey client_{};
  PublicKey client_ephemeral_{};
  PresharedKey preshared_;
  SymmetricState<Sha256> symmetric_;
};

}  // namespace rtpm::crypto
