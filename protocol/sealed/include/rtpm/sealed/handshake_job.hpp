#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>

#include "rtpm/crypto/handshake.hpp"
#include "rtpm/sealed/random_source.hpp"
#include "rtpm/wire/cookie.hpp"
#include "rtpm/wire/sealed.hpp"

namespace rtpm::sealed {

/// A server's identity, for all its lanes. It outlives them.
struct ServerIdentity {
  crypto::KeyPair key;
  crypto::PresharedKey preshared;  ///< All zeros if there is none.
  std::uint8_t suites = crypto::suites_here();
  RandomSource random{};
};

/// A server's work with public keys for one HELLO. The lane gives it out, a separate thread calls
/// run(), and the lane takes it back. This happens twice, once for each message.
/// @threads  one at a time: passing it on synchronises
class HandshakeJob {
 public:
  /// Does the work that is due.
  /// @realtime alloc-free, 100 to 140 µs: not on a lane
  void run() noexcept;
  /// The address of the handshake's client.
  [[nodiscard]] const wire::PeerAddress& peer() const noexcept { return peer_; }
  /// After a run() that wrote message 2 of a new session: its line for a key log. Nothing if
  /// there is no such session.
  /// @realtime set-up only: allocates
  [[nodiscard]] std::optional<std::string> key_log_line() const;

 private:
  friend class SealedServer;
  enum class State : std::uint8_t {
    kReading,  ///< run() reads message 1.
    kRead,
    kWriting,  ///< run() writes message 2.
    kWritten,
  };
  static constexpr std::size_t kHelloSize = wire::kHeaderSize + wire::SealedHello::kSize;

  bool is_taken_ = false;  ///< Used by the lane alone, also while run() works.
  State state_ = State::kReading;
  const ServerIdentity* identity_ = nullptr;
  wire::PeerAddress peer_{};
  wire::Header header_{};
  wire::Hello hello_{};
  crypto::Suite suite_ = crypto::Suite::kChaChaPoly;
  std::array<std::byte, kHelloSize> frame_{};  ///< The HELLO.
  crypto::Digest frame_hash_{};
  wire::Prologue prologue_{};
  std::optional<crypto::Responder> responder_;
  std::optional<crypto::SessionKeys> keys_;  ///< After message 2.
  std::optional<crypto::PublicKey> client_;  ///< Nothing if message 1 was not authentic.
  std::uint64_t former_ = 0;               ///< The session that message 1 names.
  wire::SealedWelcome granted_{};
  std::array<std::byte, wire::SealedWelcome::kSize> message_2_{};
  bool is_written_ = false;
};

}  // namespace rtpm::sealed
