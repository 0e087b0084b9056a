#pragma once

#include <cstdint>
#include <string_view>

#include "rtpm/base/expected.hpp"
#include "rtpm/crypto/symmetric_state.hpp"

namespace rtpm::crypto {

/// Why a message of a handshake was rejected. The handshake is over then; no answer is sent.
enum class HandshakeError : std::uint8_t {
  kBadSize,    ///< The message has a size that this handshake does not have.
  kBadKey,     ///< A public key of small order: its secret would be public.
  kNotSealed,  ///< Made with other keys, another prologue or suite, or changed on its way.
  kOutOfTurn,  ///< This side neither takes nor gives such a message now.
};
[[nodiscard]] std::string_view to_string(HandshakeError error) noexcept;

/// The result of a handshake: one key per direction, and the handshake hash.
struct SessionKeys {
  Suite suite = Suite::kChaChaPoly;
  Secret send;
  Secret receive;
  Digest handshake_hash{};  ///< Public; differs for each handshake.
};

/// 32 secret bytes that both sides have besides their keys; all zeros if there is no such secret.
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

/// The client's side of Noise_IKpsk2. It is used once: write_message_1(), read_message_2(), keys().
/// @threads  one at a time
/// @realtime alloc-free; 100 µs for message 1, 100 µs for message 2: not on a lane
/// @source   The Noise Protocol Framework, revision 34, 7.5 and 9
class Initiator {
 public:
  /// @param own        the client's long-lived key
  /// @param server     the server's key, known in advance
  /// @param ephemeral  KeyPair::generate(); for this handshake alone, and never for a second
  ///                   message 1 that differs in any byte or in its prologue
  /// @param prologue   the bytes that both sides must have seen alike, as the handshake checks
  Initiator(Suite suite, KeyPair own, const PublicKey& server, PresharedKey preshared,
            KeyPair ephemeral, ConstBytes prologue) noexcept;

  /// @param out  message_1_size(payload.size()) bytes
  [[nodiscard]] expected<void, HandshakeError> write_message_1(ConstBytes payload,
                                                               MutableBytes out) noexcept;
  /// After an error that is not kOutOfTurn the handshake still waits for the right message 2, so
  /// that a forged one does not end it.
  /// @param payload  receives message.size() - message_2_size(0) bytes
  [[nodiscard]] expected<void, HandshakeError> read_message_2(ConstBytes message,
                                                              MutableBytes payload) noexcept;
  /// The keys of a handshake whose message 2 was read; once.
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

/// The server's side: read_message_1(), then judge the client's key, then write_message_2(),
/// keys().
/// @threads  one at a time
/// @realtime alloc-free; 100 µs for message 1, 140 µs for message 2: not on a lane
class Responder {
 public:
  Responder(Suite suite, KeyPair own, PresharedKey preshared, ConstBytes prologue) noexcept;

  /// @param payload  receives message.size() - message_1_size(0) bytes
  /// @return the client's key. The client has proved to own it, but perhaps long ago: message 1 can
  ///         be a replay, so nothing may change on it alone
  [[nodiscard]] expected<PublicKey, HandshakeError> read_message_1(ConstBytes message,
                                                                   MutableBytes payload) noexcept;
  /// @param ephemeral  KeyPair::generate(); for this handshake alone
  /// @param out        message_2_size(payload.size()) bytes
  [[nodiscard]] expected<void, HandshakeError> write_message_2(KeyPair ephemeral,
                                                               ConstBytes payload,
                                                               MutableBytes out) noexcept;
  /// The keys of a handshake whose message 2 was written; once. Only the client's first sealed
  /// frame proves that it takes part.
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
