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
#include "rtpm/wire/fragments.hpp"
#include "rtpm/wire/header.hpp"
#include "rtpm/wire/limits.hpp"
#include "rtpm/wire/medium.hpp"

namespace rtpm::wire {

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
  /// The largest payload of a frame, where the transport allows less than the medium.
  std::uint32_t frame_payload_max = static_cast<std::uint32_t>(kStreamPayloadSizeMax);
  /// Memory for messages that are larger than a frame, each of which takes message_size_max bytes
  /// of it while it comes, is served, or is kept as a reply. Without, no message is larger than a
  /// frame. The caller's, aligned to 64 bytes; touched only when used.
  MutableBytes bulk_memory{};
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
  ConstBytes frame{};  ///< Valid until the next call on the same ServerSessions; there may be more.
  Request request{};
};

/// The server's half of the protocol for one lane and medium: sessions, at-most-once, refusals.
/// It does no I/O: frames and times come in, frames go out.
/// Ownership: allocates all its memory when built: session_count_max × kCallWindow × 1.4 KiB for
/// datagrams, two frames for streams.
/// Threads: one.   RT: everything but construction is alloc-free.
class ServerSessions {
 public:
  explicit ServerSessions(const ServerSessionsConfig& config);

  /// Takes one frame, which may be anything, from `peer`.
  [[nodiscard]] Verdict on_frame(ConstBytes frame, const PeerAddress& peer,
                                 MonotonicTime now) noexcept;

  /// More to be sent to where the last frame came from: the window of a message in fragments. To be
  /// called after each on_frame() and complete() that gave a frame, until it is empty.
  [[nodiscard]] ConstBytes next_frame(MonotonicTime now) noexcept;

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
  static constexpr std::uint16_t kNoBulk = 0xffff;

  struct Slot {
    enum class State : std::uint8_t { kEmpty, kReceiving, kRunning, kDone };
    State state = State::kEmpty;
    std::uint32_t call_id = 0;
    std::uint32_t newest_call_id = 0;  ///< Later than call_id: it was refused, as this one ran.
    std::uint32_t frame_size = 0;      ///< Of the kept reply; 0: it is in bulk, or not kept.
    std::uint16_t bulk = kNoBulk;      ///< Where the request or the reply is, if it is large.
  };
  /// Room for a message larger than a frame: one that comes, is served, or goes.
  struct Bulk {
    enum class Use : std::uint8_t { kFree, kScratch, kRequest, kReply };
    Use use = Use::kFree;
    std::uint32_t session_index = 0;
    std::uint32_t slot_index = 0;
    MonotonicTime deadline{};  ///< Until when somebody waits for it.
    MutableBytes room{};
    IncomingMessage incoming;
    OutgoingMessage outgoing;
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
  [[nodiscard]] Verdict on_copy(Slot& slot, Session& session, const Header& header,
                                ConstBytes payload, MonotonicTime now) noexcept;
  [[nodiscard]] Verdict admit(Session& session, const Header& header, ConstBytes payload,
                              MonotonicTime now) noexcept;
  [[nodiscard]] Verdict receive_large(const Request& request, Slot& slot,
                                      Session& session) noexcept;
  [[nodiscard]] Verdict on_fragment(Slot& slot, Session& session, const Header& header,
                                    ConstBytes payload, MonotonicTime now) noexcept;
  [[nodiscard]] Verdict on_ack(const Header& header, ConstBytes payload, const PeerAddress& peer,
                               MonotonicTime now) noexcept;
  [[nodiscard]] Verdict acknowledge(const Header& about, const FragmentAck& ack,
                                    MonotonicTime now) noexcept;
  [[nodiscard]] MonotonicTime deadline_of(const Session& session, const Header& header,
                                          MonotonicTime now) const noexcept;
  void on_close(const Header& header, const PeerAddress& peer) noexcept;
  void end_session(Session& session) noexcept;
  [[nodiscard]] Verdict drop(DropReason reason) noexcept;
  [[nodiscard]] Verdict refuse(const Header& about, Status status, MonotonicTime now) noexcept;
  [[nodiscard]] Verdict refuse_call(const Request& request, Status status,
                                    MonotonicTime now) noexcept;
  [[nodiscard]] ConstBytes complete_large(const Request& request, Slot& slot, const Header& header,
                                          MonotonicTime now) noexcept;
  void make_bulks();
  [[nodiscard]] std::uint16_t take_bulk(Bulk::Use use, MonotonicTime now) noexcept;
  void free_bulk(Slot& slot) noexcept;
  [[nodiscard]] std::uint32_t index_of(const Session& session) const noexcept {
    return static_cast<std::uint32_t>(&session - sessions_.data());
  }
  [[nodiscard]] Session* find(std::uint64_t id) noexcept;
  [[nodiscard]] Session* find_or_open(const Hello& hello, std::uint32_t handshake_number,
                                      const PeerAddress& peer, MonotonicTime now) noexcept;
  [[nodiscard]] std::byte* frame_of(std::uint32_t session_index, std::uint32_t slot_index) noexcept;

  ServerSessionsConfig config_;
  CookieJar cookies_;
  std::uint64_t session_serial_ = 0;
  std::uint32_t session_count_ = 0;
  std::uint32_t payload_size_max_ = 0;  ///< Of one frame.
  std::vector<Bulk> bulks_;
  std::uint16_t scratch_ = kNoBulk;  ///< Where replies are written that may become large.
  std::uint16_t sending_ = kNoBulk;  ///< Whose window next_frame() goes on with.
  std::vector<Session> sessions_;
  struct alignas(64) CacheLine {
    std::byte bytes[64];
  };
  [[nodiscard]] static std::size_t lines_for(std::size_t size) noexcept {
    return (size + sizeof(CacheLine) - 1) / sizeof(CacheLine);
  }
  std::vector<CacheLine> frames_;
  std::vector<CacheLine> fragment_frame_;  ///< One frame of a large reply, as it is sent.
  alignas(64) std::array<std::byte, 256> answer_{};
  FrameCounters counters_{};
};

}  // namespace rtpm::wire
