#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "rtpm/base/bytes.hpp"
#include "rtpm/base/hash.hpp"
#include "rtpm/base/priority.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/wire/cookie.hpp"
#include "rtpm/wire/counters.hpp"
#include "rtpm/wire/header.hpp"
#include "rtpm/wire/large_messages.hpp"
#include "rtpm/wire/limits.hpp"
#include "rtpm/wire/medium.hpp"
#include "rtpm/wire/rate_limiter.hpp"
#include "rtpm/wire/server_streams.hpp"

namespace rtpm::wire {

/// The configuration of a lane's sessions.
struct ServerSessionsConfig {
  Medium medium = Medium::kDatagram;
  Band band{};                            ///< The lane's priorities.
  Priority ceiling = Priority::kHighest;  ///< Granted to every session.
  std::uint64_t epoch = 0;                ///< The server's epoch; not 0.
  std::uint64_t clock_domain = 0;
  /// Secret, for cookies and session numbers; shared by all lanes of the server.
  SipKey key{};
  std::uint32_t lane = 0;                 ///< The lane's number, from 0.
  std::uint32_t lane_count = 1;           ///< The number of the server's lanes; at most 65536.
  std::uint32_t session_count_max = 256;  ///< 1…65535
  std::uint32_t message_size_max = static_cast<std::uint32_t>(kDatagramPayloadSizeMax);
  /// The largest payload of a frame, if the transport allows less than the medium.
  std::uint32_t frame_payload_max = static_cast<std::uint32_t>(kStreamPayloadSizeMax);
  /// Memory for messages larger than a frame: message_size_max bytes for each one that is received,
  /// served or kept as a reply, and once more for the reply being written. Without it, no message
  /// may be larger than a frame. Owned by the caller; aligned to 64 bytes; touched only when used.
  MutableBytes large_memory{};
  /// Memory for streams: stream_buffer_size() bytes for each concurrent stream. Without it, stream
  /// calls are refused. Owned by the caller; aligned to 64 bytes; touched only when used.
  MutableBytes stream_memory{};
};

/// A call for the lane to run.
struct Request {
  Header header{};
  ConstBytes payload{};      ///< Views the frame.
  MonotonicTime deadline{};  ///< On this host's clock.
  MonotonicTime received{};
  std::uint32_t session_index = 0;
  std::uint32_t slot_index = 0;
  std::uint64_t caller_host = 0;  ///< Passed on to the servants; not used by the protocol.

  /// Whether the caller is answered before the method runs; then call accept() first.
  [[nodiscard]] bool wants_receipt() const noexcept {
    return (header.flags & kFlagReplyOnReceipt) != 0;
  }
  /// Whether the caller expects a stream of items.
  [[nodiscard]] bool wants_stream() const noexcept { return header.item > 0; }
};

/// The caller's next step after a received frame.
struct Verdict {
  enum class Action : std::uint8_t {
    kNothing,   ///< The frame was dropped and counted, or needs no answer.
    kSend,      ///< Send `frame` back to the sender.
    kDispatch,  ///< Run `request`; call complete() now or later and send the frame that it returns.
    kHangUp,    ///< Stream only: not this protocol; end the connection.
  };
  Action action = Action::kNothing;
  ConstBytes frame{};  ///< Valid until the next call on the same ServerSessions; more may follow.
  Request request{};
  /// The tag of a stream (see set_tag()) that can now take more items; 0 if none.
  std::uint32_t credit_tag = 0;
};

/// A frame and its destination.
struct Outgoing {
  ConstBytes frame{};
  PeerAddress peer{};
};

/// The server's half of the protocol for one lane and medium: sessions, at-most-once, refusals.
/// Does no I/O: frames and times come in, frames go out.
/// @ownership allocates all its memory in the constructor: for datagrams 1.4 KiB × kCallWindow ×
///           session_count_max, for streams two frames
/// @threads  one
/// @realtime alloc-free except construction
class ServerSessions {
 public:
  explicit ServerSessions(const ServerSessionsConfig& config);

  /// @param frame  untrusted
  [[nodiscard]] Verdict on_frame(ConstBytes frame, const PeerAddress& peer,
                                 MonotonicTime now) noexcept;

  /// Returns further frames for the sender of the last frame: fragments and repetitions. Call it
  /// after each on_frame() and complete() that returned a frame, until it is empty.
  [[nodiscard]] ConstBytes next_frame(MonotonicTime now) noexcept;

  /// Where to write the reply to `request`, even if its session has ended: aligned to 16 bytes, of
  /// size reply_size_max(); while is_short_of_buffers(), of at most a frame's payload. Valid until
  /// the next on_frame() or complete().
  [[nodiscard]] MutableBytes reply_buffer(const Request& request, MonotonicTime now) noexcept;
  /// The largest reply that the session allows.
  [[nodiscard]] std::uint32_t reply_size_max(const Request& request) const noexcept;
  /// Whether a reply larger than a frame has no buffer now: all are in use, or the caller's host
  /// has used up its quota. The reply may wait for has_freed_buffer(), or until next_buffer_time().
  [[nodiscard]] bool is_short_of_buffers(const Request& request, MonotonicTime now) const noexcept;
  /// Whether a buffer for a large message became free since the last call.
  [[nodiscard]] bool has_freed_buffer() noexcept { return large_.take_freed(); }
  /// When, after `now`, the next message may be evicted.
  /// @realtime linear in the buffers
  [[nodiscard]] MonotonicTime next_buffer_time(MonotonicTime now) const noexcept {
    return large_.next_idle_time(now);
  }

  /// Reserves a buffer for a reply of `size` bytes, to be written while other frames are handled.
  /// The request is not read after this.
  /// @return the buffer to pass to complete(), which frees it unless it sends it; empty if the
  ///         reply fits a frame, its caller gave up, or is_short_of_buffers()
  [[nodiscard]] MutableBytes reserve_reply(const Request& request, std::uint32_t size,
                                           MonotonicTime now) noexcept;

  /// Answers a request that wants_receipt() before it runs; kOk if it will run. A later complete()
  /// returns no frame.
  /// @return the frame to send
  [[nodiscard]] ConstBytes accept(const Request& request, Status status,
                                  MonotonicTime now) noexcept;

  /// Ends `request` with `payload_size` bytes of the reply buffer. Complete each request once, in
  /// any order.
  /// @param reserved  from reserve_reply(), with the payload; empty if the payload is in the reply
  ///           buffer
  /// @return the frame to send, valid until the session's next request uses the same slot; empty if
  ///         the call wants no reply, was cancelled, or its session has ended, which is counted
  [[nodiscard]] ConstBytes complete(const Request& request, Status status,
                                    std::uint32_t payload_size, MonotonicTime now,
                                    MutableBytes reserved = {}) noexcept;

  /// The destination of frames for `request`; nullopt once its session has ended.
  [[nodiscard]] std::optional<PeerAddress> peer_of(const Request& request) const noexcept;

  /// Tags a request that will be completed later; next_cancelled() and Verdict::credit_tag report
  /// the tag.
  /// @param tag  must not be 0
  void set_tag(const Request& request, std::uint32_t tag) noexcept;
  /// The tag of a request whose caller gave up, reported once; 0 if there is none. The request must
  /// still be completed. Call it after on_frame(), on_time() and end_connection(), until it returns
  /// 0.
  [[nodiscard]] std::uint32_t next_cancelled() noexcept;

  /// The largest item of the stream `request`; 0 if it is not a stream or its caller gave up.
  [[nodiscard]] std::uint32_t item_size_max(const Request& request) noexcept;
  /// The largest item that fits one frame; 0 if item_size_max() is 0.
  [[nodiscard]] std::uint32_t item_frame_size_max(const Request& request) noexcept;
  /// Returns the next frame of `item`; send it before the next call.
  /// @param item  at most item_size_max() bytes; unchanged until is_item_midway() is false
  /// @return empty if the caller accepts no more now, or has given up
  [[nodiscard]] ConstBytes push_item(const Request& request, ConstBytes item,
                                     MonotonicTime now) noexcept;
  /// Whether push_item() has more frames of the last item.
  [[nodiscard]] bool is_item_midway(const Request& request) noexcept;

  /// Ends streams whose caller was silent for too long.
  void on_time(MonotonicTime now) noexcept;
  /// When on_time() may be due.
  /// @realtime constant time, for each sleep of a lane
  [[nodiscard]] MonotonicTime next_time() const noexcept { return streams_.next_time(); }

  /// Stream only: ends the session of the connection `peer`, which is gone.
  void end_connection(const PeerAddress& peer) noexcept;
  /// Stream only: whether the connection `peer` has a session.
  /// @realtime linear in the sessions
  [[nodiscard]] bool has_session(const PeerAddress& peer) const noexcept;
  /// Stream only: the answer to the first frame of a connection for which no slot is free: REFUSE
  /// overload to a HELLO, nothing to any other frame. Valid as long as a Verdict's frame.
  [[nodiscard]] ConstBytes turn_away(ConstBytes frame, MonotonicTime now) noexcept;

  /// Ends one session because the server stops.
  /// @return the CLOSE to send; nullopt if no session is left
  [[nodiscard]] std::optional<Outgoing> close_next(MonotonicTime now) noexcept;
  /// The peer of the session with this index, 0…session_count_max − 1; nullopt if there is none.
  [[nodiscard]] std::optional<PeerAddress> peer_at(std::uint32_t index) const noexcept;
  /// Ends the session with this index, which must exist.
  /// @return the CLOSE to send
  [[nodiscard]] Outgoing close_at(std::uint32_t index, MonotonicTime now) noexcept;

  /// Whether a session currently has this number.
  [[nodiscard]] bool is_known(std::uint64_t session) const noexcept;
  [[nodiscard]] const FrameCounters& counters() const noexcept { return counters_; }
  [[nodiscard]] std::uint32_t session_count() const noexcept { return session_count_; }
  /// The number of open streams.
  [[nodiscard]] std::uint32_t stream_count() const noexcept { return streams_.open_count(); }
  /// Large messages whose peer was recently heard (hp-5.6-10).
  [[nodiscard]] std::uint32_t large_message_count(MonotonicTime now) const noexcept {
    return large_.awaited_count(now);
  }

 private:
  struct Slot {
    enum class State : std::uint8_t { kEmpty, kReceiving, kRunning, kDone };
    State state = State::kEmpty;
    bool is_unawaited = false;  ///< Runs without a waiting caller: a oneway, or cancelled.
    bool is_evicted = false;    ///< An incomplete request was evicted.
    std::uint32_t call_id = 0;
    std::uint32_t newest_call_id = 0;  ///< May be a later call that was refused while this one ran.
    std::uint32_t frame_size = 0;      ///< The size of the kept reply; 0 if large or not kept.
    std::uint16_t large = LargeMessages::kNone;   ///< A large request or reply.
    std::uint16_t stream = ServerStreams::kNone;  ///< Kept until all items have arrived.
    std::uint32_t tag = 0;                        ///< From set_tag(), while the call runs.
    MonotonicTime deadline{};                     ///< When its caller stops waiting.
  };
  struct Session {
    std::uint64_t id = 0;  ///< 0 if free.
    PeerAddress peer{};
    std::uint64_t client_epoch = 0;
    std::uint64_t channel = 0;
    std::uint32_t handshake_number = 0;
    MonotonicTime last_heard{};
    bool has_our_clock = false;
    std::uint32_t message_size_max = 0;  ///< The client's limit.
    std::array<Slot, kCallWindow> slots{};
  };

  /// A Verdict without its request, which is constructed in place.
  struct Answer {
    Verdict::Action action = Verdict::Action::kNothing;
    ConstBytes frame{};
    std::uint32_t credit_tag = 0;
  };

  [[nodiscard]] Answer on_kind(Request& request, const PeerAddress& peer) noexcept;
  [[nodiscard]] Answer on_hello(const Header& header, ConstBytes payload, const PeerAddress& peer,
                                MonotonicTime now) noexcept;
  [[nodiscard]] std::optional<Status> fault_of(const Header& header,
                                               const Hello& hello) const noexcept;
  [[nodiscard]] Answer on_call(Request& request, const PeerAddress& peer) noexcept;
  [[nodiscard]] Answer on_duplicate(Request& request, Slot& slot, Session& session) noexcept;
  [[nodiscard]] Answer admit(Request& request, Session& session) noexcept;
  [[nodiscard]] Answer receive_large(Request& request, Slot& slot, Session& session) noexcept;
  [[nodiscard]] Answer on_fragment(Request& request, Slot& slot, Session& session) noexcept;
  [[nodiscard]] Answer on_ack(const Header& header, ConstBytes payload, const PeerAddress& peer,
                              MonotonicTime now) noexcept;
  [[nodiscard]] Answer acknowledge(const Header& about, const FragmentAck& ack,
                                   std::uint32_t item_count, MonotonicTime now) noexcept;
  [[nodiscard]] MonotonicTime deadline_of(const Session& session, const Header& header,
                                          MonotonicTime now) const noexcept;
  [[nodiscard]] Answer on_cancel(const Header& header, ConstBytes payload, const PeerAddress& peer,
                                 MonotonicTime now) noexcept;
  [[nodiscard]] Answer on_credit(const Header& header, ConstBytes payload, const PeerAddress& peer,
                                 MonotonicTime now) noexcept;
  [[nodiscard]] Answer begin_stream(const Request& request, Slot& slot) noexcept;
  [[nodiscard]] Answer dispatch(const Request& request, Slot& slot) noexcept;
  [[nodiscard]] MonotonicTime lease_of(const Session& session, const Header& header,
                                       MonotonicTime now) const noexcept;
  void free_stream(Slot& slot) noexcept {
    if (slot.stream != ServerStreams::kNone) {
      streams_.end(std::exchange(slot.stream, ServerStreams::kNone));
    }
  }
  void cancel(Slot& slot) noexcept;
  [[nodiscard]] ConstBytes kept_reply(std::uint32_t session_index,
                                      std::uint32_t slot_index) noexcept;
  [[nodiscard]] Slot* slot_of(const Request& request) noexcept;
  [[nodiscard]] OutgoingStream* stream_of(const Request& request) noexcept;
  [[nodiscard]] ConstBytes write_reply(const Request& request, Slot& slot, Status status,
                                       std::uint32_t payload_size, MonotonicTime now) noexcept;
  void on_close(const Header& header, ConstBytes payload, const PeerAddress& peer) noexcept;
  [[nodiscard]] bool has_capacity_for(const PeerAddress& peer) const noexcept;
  void end_session(Session& session) noexcept;
  [[nodiscard]] Answer drop(DropReason reason) noexcept;
  [[nodiscard]] Answer refuse(const Header& about, Status status, MonotonicTime now) noexcept;
  [[nodiscard]] Answer refuse_call(const Request& request, Status status,
                                   MonotonicTime now) noexcept;
  [[nodiscard]] Answer refuse_session(const Header& about, const PeerAddress& peer,
                                      MonotonicTime now) noexcept;
  [[nodiscard]] std::uint64_t new_session_id(std::uint64_t index) noexcept;
  [[nodiscard]] std::uint64_t lane_mask_of(std::uint64_t id) const noexcept;
  [[nodiscard]] bool is_of_another_lane(std::uint64_t id) const noexcept;
  [[nodiscard]] ConstBytes complete_large(const Request& request, Slot& slot, const Header& header,
                                          MonotonicTime now) noexcept;
  [[nodiscard]] ConstBytes next_repair() noexcept;
  [[nodiscard]] std::uint16_t take_large_buffer(const Request& request, MonotonicTime now) noexcept;
  void free_large_buffer(Slot& slot) noexcept {
    if (slot.large != LargeMessages::kNone) {
      large_.free(std::exchange(slot.large, LargeMessages::kNone));
    }
  }
  [[nodiscard]] std::uint32_t index_of(const Session& session) const noexcept {
    return static_cast<std::uint32_t>(&session - sessions_.data());
  }
  [[nodiscard]] Session* find(std::uint64_t id) noexcept;
  [[nodiscard]] static bool is_of(const Session& session, const Hello& hello,
                                  const PeerAddress& peer) noexcept;
  [[nodiscard]] bool is_late(const Hello& hello, std::uint32_t handshake_number,
                             const PeerAddress& peer) const noexcept;
  [[nodiscard]] Session* find_or_open(const Hello& hello, std::uint32_t handshake_number,
                                      const PeerAddress& peer, MonotonicTime now) noexcept;
  [[nodiscard]] std::byte* frame_of(std::uint32_t session_index, std::uint32_t slot_index) noexcept;

  ServerSessionsConfig config_;
  CookieJar cookies_;
  RateLimiter stranger_answers_;
  std::uint64_t session_serial_ = 0;
  std::uint32_t session_count_ = 0;
  std::uint32_t payload_size_max_;  ///< The limit for one frame.
  std::uint32_t item_size_max_;     ///< The limit for a stream's item.
  LargeMessages large_;
  ServerStreams streams_;
  bool is_reply_due_ = false;  ///< The kept reply is sent after its stream's repeated items.
  std::vector<std::uint32_t> cancelled_;  ///< Tags for next_cancelled().
  std::vector<Session> sessions_;
  struct alignas(64) CacheLine {
    std::byte bytes[64];
  };
  [[nodiscard]] static std::size_t lines_for(std::size_t size) noexcept {
    return (size + sizeof(CacheLine) - 1) / sizeof(CacheLine);
  }
  std::vector<CacheLine> frames_;
  std::vector<CacheLine> unsent_frame_;  ///< Receives replies that are not sent.
  alignas(64) std::array<std::byte, 256> answer_{};
  FrameCounters counters_{};
};

}  // namespace rtpm::wire
