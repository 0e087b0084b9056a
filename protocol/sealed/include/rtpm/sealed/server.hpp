#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "rtpm/crypto/session.hpp"
#include "rtpm/sealed/freshness.hpp"
#include "rtpm/sealed/handshake_job.hpp"
#include "rtpm/wire/server_sessions.hpp"

namespace rtpm::sealed {

/// The key of a session's client; null if the session is not sealed.
using ClientKey = const crypto::PublicKey*;

/// Decides which clients a server admits, and with which rights.
/// @threads  a lane's; alloc-free
class Admission {
 public:
  Admission() = default;
  Admission(const Admission&) = delete;
  Admission& operator=(const Admission&) = delete;
  virtual ~Admission() = default;
  [[nodiscard]] virtual bool admits(const crypto::PublicKey& client,
                                    const wire::PeerAddress& peer) noexcept = 0;
  /// Whether that address may have unsealed sessions, if these are allowed at all.
  [[nodiscard]] virtual bool admits_unsealed(const wire::PeerAddress&) noexcept { return true; }
  /// The highest priority granted to a session; the server's own ceiling still applies.
  [[nodiscard]] virtual Priority ceiling(ClientKey, const wire::PeerAddress&) noexcept {
    return Priority::kHighest;
  }
  /// Whether another handshake may start now, across all lanes.
  [[nodiscard]] virtual bool admits_handshake(MonotonicTime) noexcept { return true; }
  /// Changes with each change of the rights.
  [[nodiscard]] virtual std::uint32_t generation() noexcept { return 0; }
  /// Whether a session last judged in generation `since` may continue.
  [[nodiscard]] virtual bool keeps(ClientKey client, const wire::PeerAddress& peer,
                                   std::uint32_t since) noexcept {
    static_cast<void>(since);
    return client != nullptr ? admits(*client, peer) : admits_unsealed(peer);
  }
};

/// How a lane seals its sessions.
struct SealedServerConfig {
  wire::Medium medium = wire::Medium::kDatagram;
  const ServerIdentity* identity = nullptr;
  Admission* admission = nullptr;
  SipKey key{};                           ///< See ServerSessionsConfig.
  std::uint32_t session_count_max = 256;  ///< See ServerSessionsConfig.
  std::uint32_t job_count_max = 8;        ///< Concurrent handshakes.
  std::uint32_t job_burst = 32;           ///< The burst of handshakes for one host.
  /// After the burst, one handshake per interval.
  Duration job_interval = std::chrono::milliseconds{20};
  bool takes_unsealed = false;  ///< Whether unsealed sessions are also allowed.
  crypto::SessionLimits limits{};
  /// The memory for keys: memory_size() bytes, aligned to 64, wiped on fork, locked and not dumped.
  /// The caller owns it. If empty, ordinary memory is allocated.
  MutableBytes memory{};
};

/// Sits between a lane's wire::ServerSessions and its transport, and seals its sessions. The
/// sessions are unaware of it: their frame_payload_max is sealed_payload_max(). In a forked child
/// it has no keys if its memory is wiped on fork; then it sends and accepts nothing.
/// @ownership takes 3 KiB per session, see memory_size(). Objects that the configuration refers to
///            must outlive it
/// @threads   one, except HandshakeJob::run()
/// @realtime  alloc-free except construction; no public-key operations
class SealedServer {
 public:
  /// The caller's next step after a received frame or a finished job.
  struct Outcome {
    wire::Verdict verdict{};      ///< From ServerSessions; its frame is not sealed yet.
    HandshakeJob* job = nullptr;  ///< Run it elsewhere, then pass it to on_job(); may be null.
    wire::PeerAddress peer{};     ///< Set by on_job(): the destination of its frame.
  };

  /// The size required for SealedServerConfig::memory.
  [[nodiscard]] static std::size_t memory_size(const SealedServerConfig& config) noexcept;

  SealedServer(const SealedServerConfig& config, wire::ServerSessions& sessions);
  SealedServer(const SealedServer&) = delete;
  SealedServer& operator=(const SealedServer&) = delete;
  ~SealedServer();

  /// Handles a received frame, which may be malformed, and opens it in place.
  [[nodiscard]] Outcome on_frame(MutableBytes frame, const wire::PeerAddress& peer,
                                 MonotonicTime now) noexcept;
  /// Handles a job after its run().
  [[nodiscard]] Outcome on_job(HandshakeJob& job, MonotonicTime now) noexcept;
  /// Takes back a job that is no longer needed because its connection has ended.
  void give_up(HandshakeJob& job) noexcept;
  /// Seals a frame from the sessions or an Outcome; send the result instead, which is valid until
  /// the next call. Call it when sending, once per datagram.
  /// @return empty if nothing is to be sent
  [[nodiscard]] ConstBytes seal(ConstBytes frame) noexcept;
  /// Ends half-open sessions that have timed out.
  void on_time(MonotonicTime now) noexcept;
  /// When on_time() may be due.
  [[nodiscard]] MonotonicTime next_time() const noexcept { return half_open_due_; }
  /// Ends the session with this index, 0…session_count_max − 1, if Admission does not keep it.
  /// @return its address, and the CLOSE to send, already sealed; empty if its client has no keys
  ///         yet. nullopt if there is no session, or it continues
  [[nodiscard]] std::optional<wire::Outgoing> review(std::uint32_t index,
                                                     MonotonicTime now) noexcept;
  /// Ends all sessions that Admission does not keep, without notifying them.
  void end_unadmitted(MonotonicTime now) noexcept;

  /// The client's key of a session; nullopt if it is not sealed.
  [[nodiscard]] std::optional<crypto::PublicKey> client_of(std::uint64_t session) noexcept;
  [[nodiscard]] std::uint32_t half_open_count() const noexcept;
  /// Counts the frames dropped here. The sessions count the frames passed on to them.
  [[nodiscard]] const wire::FrameCounters& counters() const noexcept { return counters_; }

 private:
  static constexpr std::size_t kWelcomeSize = wire::kHeaderSize + wire::SealedWelcome::kSize;

  /// The seal of the session with the same index.
  struct Entry {
    std::uint64_t id = 0;  ///< 0 if free, or if the session is not sealed.
    wire::PeerAddress peer{};
    std::uint64_t client_epoch = 0;
    std::uint64_t channel = 0;
    std::uint32_t handshake_number = 0;
    crypto::PublicKey client{};
    crypto::Digest hello_hash{};
    wire::Welcome granted{};
    MonotonicTime opened{};
    MonotonicTime last_heard{};  ///< When the last authentic frame arrived.
    Freshness freshness;
    std::uint32_t generation = 0;  ///< The Admission's generation when it last judged the session.
    bool has_our_clock = false;
    bool is_confirmed = false;  ///< Its client has sent an authentic frame.
    bool has_welcome = false;
    std::array<std::byte, kWelcomeSize> welcome{};
    std::optional<crypto::SealedSession> session;
  };

  struct alignas(64) CacheLine {
    std::byte bytes[64];
  };
  /// The start of the memory.
  struct Guard {
    std::uint64_t is_alive = 1;  ///< A wiped page makes it zero.
  };
  /// Offsets of the memory's parts.
  struct Layout {
    std::size_t entries = 0;
    std::size_t jobs = 0;
    std::size_t size = 0;
  };
  [[nodiscard]] static Layout layout_of(const SealedServerConfig& config) noexcept;

  [[nodiscard]] bool is_wiped() const noexcept { return guard_->is_alive == 0; }
  [[nodiscard]] std::span<Entry> entries() noexcept { return entries_; }
  [[nodiscard]] std::span<const Entry> entries() const noexcept { return entries_; }
  [[nodiscard]] Entry* find(std::uint64_t session) noexcept;
  [[nodiscard]] bool has_confirmed_stream(const wire::PeerAddress& peer) const noexcept;
  void free(Entry& entry) noexcept;
  void close(Entry& entry, MonotonicTime now) noexcept;
  void end(Entry& entry, MonotonicTime now) noexcept;
  void confirm(Entry& entry, MonotonicTime now) noexcept;
  [[nodiscard]] bool is_held_back(Entry& entry, const wire::Header& header, MutableBytes frame,
                                  MonotonicTime now) noexcept;
  [[nodiscard]] bool make_place(const crypto::PublicKey& client, MonotonicTime now) noexcept;
  void make_half_open_place(const crypto::PublicKey& client, MonotonicTime now) noexcept;
  [[nodiscard]] Outcome drop(wire::DropReason reason) noexcept;
  [[nodiscard]] Outcome broken(wire::DropReason reason) noexcept;
  [[nodiscard]] Outcome on_sealed(MutableBytes frame, const wire::PeerAddress& peer,
                                  MonotonicTime now) noexcept;
  [[nodiscard]] Outcome on_hello(const wire::Header& header, ConstBytes frame,
                                 const wire::PeerAddress& peer, MonotonicTime now) noexcept;
  [[nodiscard]] Outcome on_sealed_hello(const wire::Header& header, ConstBytes frame,
                                        const wire::PeerAddress& peer, MonotonicTime now) noexcept;
  [[nodiscard]] Outcome on_unsealed_hello(const wire::Header& header, ConstBytes frame,
                                          const wire::PeerAddress& peer,
                                          MonotonicTime now) noexcept;
  [[nodiscard]] ConstBytes write_refusal(const wire::Header& about, wire::Status status,
                                         MonotonicTime now) noexcept;
  [[nodiscard]] ConstBytes seal_close(Entry& entry, MonotonicTime now) noexcept;
  [[nodiscard]] Outcome give_cookie(const wire::Header& header, ConstBytes hello,
                                    const wire::PeerAddress& peer, MonotonicTime now) noexcept;
  [[nodiscard]] Outcome begin_job(const wire::Header& header, ConstBytes frame,
                                  const wire::SealedHello& hello, const crypto::Digest& hash,
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
  wire::RateLimiter refusal_limit_;    ///< Limits refusals to unknown peers.
  std::vector<CacheLine> own_memory_;  ///< Used if the configuration has none.
  Guard* guard_ = nullptr;
  std::span<Entry> entries_;
  std::span<HandshakeJob> jobs_;
  MonotonicTime half_open_due_ = kNever;  ///< No half-open session ends before this.
  std::uint32_t unsealed_generation_;     ///< When unsealed sessions were last judged.
  std::uint32_t reviewing_generation_;
  MonotonicTime ended_until_{};  ///< Until then ended sessions may have open calls.
  wire::FrameCounters counters_{};
  std::array<std::byte, kWelcomeSize> answer_{};
  std::vector<std::byte> sealed_frame_;
};

}  // namespace rtpm::sealed
