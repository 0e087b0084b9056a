#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "rtpm/crypto/session.hpp"
#include "rtpm/sealed/key_log.hpp"
#include "rtpm/sealed/random_source.hpp"
#include "rtpm/wire/client_channel.hpp"
#include "rtpm/wire/sealed.hpp"

namespace rtpm::sealed {

/// How a client seals a channel's session.
struct SealedClientConfig {
  wire::Medium medium = wire::Medium::kDatagram;
  const crypto::KeyPair* own = nullptr;             ///< The client's key.
  crypto::PublicKey server{};                       ///< The server's key, from the configuration.
  const crypto::PresharedKey* preshared = nullptr;  ///< May be null.
  std::uint8_t suites = crypto::suites_here();
  /// Random for each run of the program (hp-4-2).
  std::uint32_t handshake_number = 0;
  RandomSource random{};
  crypto::SessionLimits limits{};
  /// Keys older than this are due for renewal.
  Duration renewal_interval = std::chrono::hours{24};
  KeyListener key_listener{};
};

/// Sits between a wire::ClientChannel and its transport, and seals the channel's session. The
/// channel is unaware of it: the channel's buffer has at most kHeaderSize + sealed_payload_max()
/// bytes, so that sealed frames fit.
/// @ownership holds the session's keys: place it in memory that is wiped on fork and not dumped.
///            The configuration's keys must outlive it
/// @threads   one at a time
/// @realtime  alloc-free except construction; work() takes 100 µs, everything else about 1 µs
class SealedClient {
 public:
  /// The owner's next step. Valid until the next call.
  struct Step {
    ConstBytes send{};       ///< Send it, unless empty.
    ConstBytes deliver{};    ///< Pass it to ClientChannel::on_frame(), unless empty.
    bool is_broken = false;  ///< Stream only: end the connection.
  };

  explicit SealedClient(const SealedClientConfig& config);
  SealedClient(const SealedClient&) = delete;
  SealedClient& operator=(const SealedClient&) = delete;

  /// Handles a frame that the channel wants to send.
  [[nodiscard]] Step send(ConstBytes frame, MonotonicTime now) noexcept;
  /// Handles a received frame, which may be malformed, and opens it in place.
  [[nodiscard]] Step receive(MutableBytes frame, MonotonicTime now) noexcept;
  /// Whether work() has something to do. Check it after each send() and receive().
  [[nodiscard]] bool has_work() const noexcept { return is_message_1_due_ || is_message_2_due_; }
  /// Performs a handshake's public-key operations.
  [[nodiscard]] Step work(MonotonicTime now) noexcept;
  /// Call it when the connection is gone.
  void reset() noexcept;

  /// Whether the session's keys are old or near a limit; then call renew().
  [[nodiscard]] bool is_renewal_due(MonotonicTime now) const noexcept;
  /// Whether a limit is very near; then get new keys before the next call.
  [[nodiscard]] bool is_renewal_urgent() const noexcept { return is_past(7, 8); }
  /// Whether the session reached a limit, so that no frame can be sent or received on it.
  [[nodiscard]] bool has_ended() const noexcept {
    const bool is_replacing = is_opening_ && purpose_ == Purpose::kChannel;
    return !is_replacing && current().seal && current().seal->has_ended();
  }
  /// Starts a handshake alongside the session, which continues. A lost frame ends the handshake
  /// silently, so call it again after a second. Over a stream the handshake uses another connection
  /// to the server: send the frames of this step and of the following work() there, and the
  /// channel's frames, too, once it has moved.
  [[nodiscard]] Step renew(MonotonicTime now) noexcept;
  /// Whether a new session is ready for the channel; it stays ready for a second. Once the channel
  /// has no open call, open() moves it there without a frame. The server then ends the old session.
  [[nodiscard]] bool has_next(MonotonicTime now) const noexcept {
    return next().seal.has_value() && now < next_until_;
  }

  /// Whether the server's WELCOME was authentic and the session continues.
  [[nodiscard]] bool has_session() const noexcept { return current().seal.has_value(); }
  /// The status in an unsealed REFUSE or COOKIE of this handshake, for error texts; it is not
  /// authentic. kNotAllowed: the server may not admit this client's key; kVersionUnsupported: it
  /// may not support sealed sessions.
  [[nodiscard]] std::optional<wire::Status> hint() const noexcept { return hint_; }
  /// The key in a COOKIE, if it is not the configured one; it is not authentic, either.
  [[nodiscard]] const std::optional<wire::KeyBytes>& other_key() const noexcept {
    return other_key_;
  }
  [[nodiscard]] const wire::FrameCounters& counters() const noexcept { return counters_; }

 private:
  /// Whether this share of the session's limit of sent frames, or of forged ones, is used up.
  [[nodiscard]] bool is_past(std::uint64_t part, std::uint64_t of) const noexcept;

  /// The purpose of a handshake. The channel only knows its own handshakes.
  enum class Purpose : std::uint8_t {
    kChannel,
    kProbe,    ///< After a hint: asks whether the server still has the session.
    kRenewal,  ///< Gets new keys before the old ones expire.
  };
  static constexpr std::size_t kHelloSize = wire::kHeaderSize + wire::Hello::kSize;
  static constexpr std::size_t kSealedHelloSize = wire::kHeaderSize + wire::SealedHello::kSize;
  static constexpr std::size_t kWelcomeSize = wire::kHeaderSize + wire::SealedWelcome::kSize;

  /// A session, and what its WELCOME granted.
  struct Session {
    std::optional<crypto::SealedSession> seal;
    std::uint64_t id = 0;
    MonotonicTime opened{};
    wire::Welcome granted{};
  };
  [[nodiscard]] Session& current() noexcept { return sessions_[current_]; }
  [[nodiscard]] const Session& current() const noexcept { return sessions_[current_]; }
  [[nodiscard]] Session& next() noexcept { return sessions_[1 - current_]; }
  [[nodiscard]] const Session& next() const noexcept { return sessions_[1 - current_]; }
  static void end(Session& session) noexcept;
  [[nodiscard]] bool is_current(std::uint64_t session) const noexcept {
    return current().seal && current().id == session;
  }

  [[nodiscard]] Step send_hello(const wire::Header& header, ConstBytes frame,
                                MonotonicTime now) noexcept;
  void begin_handshake(Purpose purpose) noexcept;
  void write_hello(ConstBytes frame, std::uint32_t features) noexcept;
  [[nodiscard]] ConstBytes first_hello() noexcept;
  [[nodiscard]] bool begin_message_1() noexcept;
  [[nodiscard]] Step receive_sealed(MutableBytes frame) noexcept;
  [[nodiscard]] Step on_cookie(const wire::Header& header, ConstBytes payload) noexcept;
  [[nodiscard]] Step on_welcome(const wire::Header& header, ConstBytes frame) noexcept;
  [[nodiscard]] Step on_refuse(const wire::Header& header, MonotonicTime now) noexcept;
  [[nodiscard]] Step message_1() noexcept;
  [[nodiscard]] Step message_2(MonotonicTime now) noexcept;
  [[nodiscard]] Step welcome_channel() noexcept;
  [[nodiscard]] Step tell_closed() noexcept;
  [[nodiscard]] Step tell_lost(const wire::Header& about) noexcept;
  [[nodiscard]] Step drop(wire::DropReason reason) noexcept;

  SealedClientConfig config_;
  std::array<Session, 2> sessions_;  ///< The channel's session, and the next one.
  std::size_t current_ = 0;
  MonotonicTime next_until_{};
  std::uint64_t gone_session_ = 0;  ///< The session that the server reported as gone.
  wire::FrameCounters counters_{};
  std::optional<wire::Status> hint_;
  std::optional<wire::KeyBytes> other_key_;

  // The handshake in progress.
  bool is_opening_ = false;
  Purpose purpose_ = Purpose::kChannel;
  bool is_message_1_due_ = false;
  bool is_message_2_due_ = false;
  bool has_cookie_ = false;
  bool has_sealed_hello_ = false;     ///< sealed_hello_ answers cookie_.
  std::uint32_t number_;              ///< The handshake's number, as the server sees it.
  std::uint32_t channel_number_ = 0;  ///< The number by which the channel knows it.
  crypto::Suite suite_ = crypto::Suite::kChaChaPoly;
  std::array<std::byte, wire::SealedCookie::kSize> cookie_{};
  std::array<std::byte, kHelloSize> hello_{};  ///< The channel's last HELLO, as sent.
  std::array<std::byte, kSealedHelloSize> sealed_hello_{};
  std::array<std::byte, kWelcomeSize> welcome_{};
  std::optional<crypto::Initiator> initiator_;

  // The refused frame that a probe checks, and when another probe may start.
  wire::Header refused_{};
  MonotonicTime next_probe_{};
  Duration probe_interval_{};

  std::array<std::byte, wire::kHeaderSize + wire::Welcome::kSize> plain_{};  ///< To be delivered.
  std::vector<std::byte> sealed_frame_;
};

}  // namespace rtpm::sealed
