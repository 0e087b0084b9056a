#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "rtpm/base/bytes.hpp"
#include "rtpm/base/hash.hpp"
#include "rtpm/base/priority.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/wire/cookie.hpp"
#include "rtpm/wire/counters.hpp"
#include "rtpm/wire/header.hpp"
#include "rtpm/wire/limits.hpp"

namespace rtpm::wire {

/// Whether frames travel as datagrams, which get lost, doubled and reordered and whose addresses
/// can be forged, or on a stream, where none of this happens.
enum class Medium : std::uint8_t { kDatagram, kStream };

/// How the sessions of one lane are set up.
struct ServerSessionsConfig {
  Medium medium = Medium::kDatagram;
  Band band{};                            ///< The lane's priorities.
  Priority ceiling = Priority::kHighest;  ///< Granted to every session.
  std::uint64_t epoch = 0;                ///< Of the server; not 0.
  std::uint64_t clock_domain = 0;
  SipKey key{};                           ///< Secret, for cookies and session numbers.
  std::uint32_t session_count_max = 256;  ///< 1…65535
  std::uint32_t message_size_max = static_cast<std::uint32_t>(kDatagramPayloadSizeMax);
};

/// A call that the lane is to run.
struct Request {
  Header header{};
  ConstBytes payload{};      ///< Views the frame.
  MonotonicTime deadline{};  ///< On this host's clock.
  MonotonicTime received{};
  std::uint32_t session_index = 0;
  std::uint32_t slot_index = 0;
};

/// What is to be done with a received frame.
struct Verdict {
  enum class Action : std::uint8_t {
    kNothing,   ///< Dropped and counted, or taken note of.
    kSend,      ///< Send `frame` back to where the frame came from.
    kDispatch,  ///< Run `request`, then complete() it and send what that gives.
    kHangUp,    ///< Stream only: the bytes are not our protocol; end the connection.
  };
  Action action = Action::kNothing;
  ConstBytes frame{};  ///< Valid until the next call on the same ServerSessions.
  Request request{};
};

/// The server's half of the protocol for one lane and medium: sessions, at-most-once, refusals.
/// It does no I/O: frames and times come in, frames go out.
/// Ownership: allocates all its memory when built: session_count_max × kCallWindow × 1.4 KiB for
/// datagrams, one message for streams.
/// Threads: one.   RT: everything but construction is alloc-free.
class ServerSessions {
 public:
  explicit ServerSessions(const ServerSessionsConfig& config);

  /// Takes one frame, which may be anything, from `peer`.
  [[nodiscard]] Verdict on_frame(ConstBytes frame, const PeerAddress& peer,
                                 MonotonicTime now) noexcept;

  /// Where the reply to `request` is to be written, aligned to 16 bytes.
  [[nodiscard]] MutableBytes reply_buffer(const Request& request) noexcept;

  /// Ends `request`: with `payload_size` bytes of the reply buffer. Gives the frame to send, valid
  /// until the next request of the session takes the same slot.
  [[nodiscard]] ConstBytes complete(const Request& request, Status status,
                                    std::uint32_t payload_size, MonotonicTime now) noexcept;

  /// Stream only: the connection `peer` is gone, and its session with it.
  void forget(const PeerAddress& peer) noexcept;

  [[nodiscard]] const FrameCounters& counters() const noexcept { return counters_; }
  [[nodiscard]] std::uint32_t session_count() const noexcept { return session_count_; }

 private:
  struct Slot {
    enum class State : std::uint8_t { kEmpty, kRunning, kDone };
    State state = State::kEmpty;
    std::uint32_t call_id = 0;
    std::uint32_t newest_call_id = 0;  ///< Later than call_id: it was refused, as this one ran.
    std::uint32_t frame_size = 0;
  };
  struct Session {
    std::uint64_t id = 0;  ///< 0: free.
    PeerAddress peer{};
    std::uint64_t client_epoch = 0;
    std::uint64_t channel = 0;
    std::uint32_t handshake_number = 0;
    MonotonicTime last_heard{};
    bool has_our_clock = false;
    std::uint32_t message_size_max = 0;  ///< That the client takes.
    std::array<Slot, kCallWindow> slots{};
  };

  [[nodiscard]] Verdict on_hello(const Header& header, ConstBytes payload, const PeerAddress& peer,
                                 MonotonicTime now) noexcept;
  [[nodiscard]] Verdict on_call(const Header& header, ConstBytes payload, const PeerAddress& peer,
                                MonotonicTime now) noexcept;
  void on_close(const Header& header, const PeerAddress& peer) noexcept;
  [[nodiscard]] Verdict drop(DropReason reason) noexcept;
  [[nodiscard]] Verdict refuse(const Header& about, Status status, MonotonicTime now) noexcept;
  [[nodiscard]] Verdict refuse_call(const Request& request, Status status,
                                    MonotonicTime now) noexcept;
  [[nodiscard]] Session* find(std::uint64_t id) noexcept;
  [[nodiscard]] Session* find_or_open(const Hello& hello, std::uint32_t handshake_number,
                                      const PeerAddress& peer, MonotonicTime now) noexcept;
  [[nodiscard]] std::byte* frame_of(std::uint32_t session_index, std::uint32_t slot_index) noexcept;

  ServerSessionsConfig config_;
  CookieJar cookies_;
  std::uint64_t session_serial_ = 0;
  std::uint32_t session_count_ = 0;
  std::uint32_t reply_frame_size_max_ = 0;
  std::vector<Session> sessions_;
  struct alignas(64) CacheLine {
    std::byte bytes[64];
  };
  std::vector<CacheLine> frames_;
  alignas(64) std::array<std::byte, 256> answer_{};
  FrameCounters counters_{};
};

}  // namespace rtpm::wire
