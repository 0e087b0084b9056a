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

/// A server's identity, shared by all lanes; must outlive them.
struct ServerIdentity {
  crypto::KeyPair key;
  crypto::PresharedKey preshared;  ///< All zeros if there is none.
  std::uint8_t suites = crypto::suites_here();
  RandomSource random{};
};

/// The public-key operations of a server for one HELLO. The lane hands the job out, a separate
/// thread calls run(), and the lane takes it back; this happens once for each of the two messages.
/// @threads  one at a time; handing it over synchronises
class HandshakeJob {
 public:
  /// Performs the pending operation.
  /// @realtime alloc-free, 100 to 140 µs: not on a lane
  void run() noexcept;
  /// The address of the handshake's client.
  [[nodiscard]] const wire::PeerAddress& peer() const noexcept { return peer_; }
  /// The key-log line of a new session, after the run() that wrote its message 2; nullopt if there
  /// is no such session.
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

  bool is_taken_ = false;  ///< Used only by the lane, even while run() executes.
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
  std::optional<crypto::SessionKeys> keys_;  ///< Set after message 2.
  std::optional<crypto::PublicKey> client_;  ///< nullopt if message 1 was not authentic.
  std::uint64_t former_ = 0;                 ///< The earlier session that message 1 names.
  wire::SealedWelcome granted_{};
  std::array<std::byte, wire::SealedWelcome::kSize> message_2_{};
  bool is_written_ = false;
};

}  // namespace rtpm::sealed
