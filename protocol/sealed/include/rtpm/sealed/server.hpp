#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "rtpm/seal/session.hpp"
#include "rtpm/sealed/freshness.hpp"
#include "rtpm/sealed/handshake_job.hpp"
#include "rtpm/wire/server_sessions.hpp"

namespace rtpm::sealed {

/// Says which clients a server admits.
class Admission {
 public:
  Admission() = default;
  Admission(const Admission&) = delete;
  Admission& operator=(const Admission&) = delete;
  virtual ~Admission() = default;
  /// @threads  a lane's; alloc-free
  [[nodiscard]] virtual bool admits(const seal::PublicKey& client,
                                    const wire::PeerAddress& peer) noexcept = 0;
};

/// How a lane seals its sessions.
struct SealedServerConfig {
  wire::Medium medium = wire::Medium::kDatagram;
  const ServerIdentity* identity = nullptr;
  Admission* admission = nullptr;
  SipKey key{};                           ///< That of ServerSessionsConfig.
  std::uint32_t session_count_max = 256;  ///< Likewise.
  std::uint32_t job_count_max = 8;        ///< Handshakes at a time.
  std::uint32_t job_burst = 32;           ///< Over datagrams: handshakes of one host at once,
  Duration job_interval = std::chrono::milliseconds{20};  ///< then one in this time.
  bool takes_unsealed = false;  ///< Whether there are unsealed sessions as well.
  seal::SessionLimits limits{};
};

/// Stands between a lane's wire::ServerSessions and its transport, and seals its sessions. The
/// sessions do not know: their frame_payload_max is sealed_payload_max().
/// @ownership allocates all its memory in the constructor, 3 KiB for each session: place it in
///            memory that is wiped on fork and not dumped. What the configuration names outlives it
/// @threads   one, but for HandshakeJob::run()
/// @realtime  alloc-free but for construction; no work with public keys
class SealedServer {
 public:
  /// What to do about a received frame or a job that was run.
  struct Outcome {
    wire::Verdict verdict{};      ///< As of ServerSessions; its frame is not sealed yet.
    HandshakeJob* job = nullptr;  ///< To be run elsewhere, then for on_job(); null: none.
    wire::PeerAddress peer{};     ///< of on_job(): where its frame goes.
  };

  SealedServer(const SealedServerConfig& config, wire::ServerSessions& sessions);
  SealedServer(const SealedServer&) = delete;
  SealedServer& operator=(const SealedServer&) = delete;

  /// Takes a received frame, which may be anything, and opens it in place.
  [[nodiscard]] Outcome on_frame(MutableBytes frame, const wire::PeerAddress& peer,
                                 MonotonicTime now) noexcept;
  /// Takes back a job after its run().
  [[nodiscard]] Outcome on_job(HandshakeJob& job, MonotonicTime now) noexcept;
  /// What to send in place of a frame that the sessions or an Outcome gave, valid until the next
  /// call. Call it at the time of sending, once for each datagram.
  /// @return empty: nothing is to be sent
  [[nodiscard]] ConstBytes seal(ConstBytes frame) noexcept;
  /// Ends half-open sessions whose time is over.
  void on_time(MonotonicTime now) noexcept;
  /// Ends the sessions of all clients that are not admitted any more.
  void end_unadmitted(MonotonicTime now) noexcept;

  /// The client's key of a session; nothing if it is not sealed.
  [[nodiscard]] std::optional<seal::PublicKey> client_of(std::uint64_t session) noexcept;
  [[nodiscard]] std::uint32_t half_open_count() const noexcept;
  /// What was dropped here. Frames that reach the sessions count there.
  [[nodiscard]] const wire::FrameCounters& counters() const noexcept { return counters_; }

 private:
  static constexpr std::size_t kWelcomeSize = wire::kHeaderSize + wire::SealedWelcome::kSize;

  /// The seal of the session with the same index.
  struct Entry {
    std::uint64_t id = 0;  ///< 0: free, or the session is not sealed.
    wire::PeerAddress peer{};
    std::uint64_t client_epoch = 0;
    std::uint64_t channel = 0;
    std::uint32_t handshake_number = 0;
    seal::PublicKey client{};
    seal::Digest hello_hash{};
    wire::Welcome granted{};
    MonotonicTime opened{};
    MonotonicTime last_heard{};  ///< By an authentic frame.
    Freshness freshness;
    bool has_our_clock = false;
    bool is_confirmed = false;  ///< Its client has sent an authentic frame.
    bool has_welcome = false;
    std::array<std::byte, kWelcomeSize> welcome{};
    std::optional<seal::SealedSession> session;
  };

  [[nodiscard]] std::span<Entry> entries() noexcept {
    return {entries_.get(), config_.session_count_max};
  }
  [[nodiscard]] std::span<const Entry> entries() const noexcept {
    return {entries_.get(), config_.session_count_max};
  }
  [[nodiscard]] Entry* find(std::uint64_t session) noexcept;
  [[nodiscard]] bool has_confirmed_stream(const wire::PeerAddress& peer) const noexcept;
  void free(Entry& entry) noexcept;
  void close(Entry& entry, MonotonicTime now) noexcept;
  void end(Entry& entry, MonotonicTime now) noexcept;
  void confirm(Entry& entry, MonotonicTime now) noexcept;
  [[nodiscard]] bool is_held_back(Entry& entry, const wire::Header& header, MutableBytes frame,
                                  MonotonicTime now) noexcept;
  [[nodiscard]] bool make_place(const seal::PublicKey& client, MonotonicTime now) noexcept;
  void make_half_open_place(const seal::PublicKey& client, MonotonicTime now) noexcept;
  [[nodiscard]] Outcome drop(wire::DropReason reason) noexcept;
  [[nodiscard]] Outcome broken(wire::DropReason reason) noexcept;
  [[nodiscard]] Outcome on_sealed(MutableBytes frame, const wire::PeerAddress& peer,
                                  MonotonicTime now) noexcept;
  [[nodiscard]] Outcome on_hello(const wire::Header& header, ConstBytes frame,
                                 const wire::PeerAddress& peer, MonotonicTime now) noexcept;
  [[nodiscard]] Outcome on_sealed_hello(const wire::Header& header, ConstBytes frame,
                                        const wire::PeerAddress& peer, MonotonicTime now) noexcept;
  [[nodiscard]] Outcome give_cookie(const wire::Header& header, ConstBytes hello,
                                    const wire::PeerAddress& peer, MonotonicTime now) noexcept;
  [[nodiscard]] Outcome begin_job(const wire::Header& header, ConstBytes frame,
                                  const wire::SealedHello& hello, const seal::Digest& hash,
                                  const wire::PeerAddress& peer, MonotonicTime now) noexcept;
  [[nodiscard]] wire::Verdict pass_hello(const wire::Header& header, ConstBytes hello,
                                         const wire::PeerAddress& peer, MonotonicTime now) noexcept;
  [[nodiscard]] Outcome open_session(HandshakeJob& job, MonotonicTime now) noexcept;
  [[nodiscard]] Outcome finish(HandshakeJob& job, MonotonicTime now) noexcept;
  [[nodiscard]] Outcome refuse(HandshakeJob& job, wire::Status status, MonotonicTime now) noexcept;
  [[nodiscard]] wire::SealedCookie cookie_of(const wire::Cookie& cookie) const noexcept;

  SealedServerConfig config_;
  wire::ServerSessions& sessions_;
  wire::CookieJar cookies_;
  wire::RateLimiter job_limit_;
  std::unique_ptr<Entry[]> entries_;
  std::unique_ptr<HandshakeJob[]> jobs_;
  MonotonicTime ended_until_{};  ///< So long calls of sessions that the server ended may be open.
  wire::FrameCounters counters_{};
  std::array<std::byte, kWelcomeSize> answer_{};
  std::vector<std::byte> sealed_frame_;
};

}  // namespace rtpm::sealed
