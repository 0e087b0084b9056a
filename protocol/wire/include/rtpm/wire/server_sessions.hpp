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
#include "rtpm/wire/fragments.hpp"
#include "rtpm/wire/header.hpp"
#include "rtpm/wire/limits.hpp"
#include "rtpm/wire/medium.hpp"
#include "rtpm/wire/rate_limiter.hpp"
#include "rtpm/wire/stream.hpp"

namespace rtpm::wire {

/// How the sessions of one lane are set up.
struct ServerSessionsConfig {
  Medium medium = Medium::kDatagram;
  Band band{};                            ///< The lane's priorities.
  Priority ceiling = Priority::kHighest;  ///< Granted to every session.
  std::uint64_t epoch = 0;                ///< Of the server; not 0.
  std::uint64_t clock_domain = 0;
  /// Secret, for cookies and session numbers; the same for all lanes of the server.
  SipKey key{};
  std::uint32_t lane = 0;                 ///< Which of the server's lanes this is, from 0,
  std::uint32_t lane_count = 1;           ///< and how many it has; at most 65536.
  std::uint32_t session_count_max = 256;  ///< 1…65535
  std::uint32_t message_size_max = static_cast<std::uint32_t>(kDatagramPayloadSizeMax);
  /// The largest payload of a frame, where the transport allows less than the medium.
  std::uint32_t frame_payload_max = static_cast<std::uint32_t>(kStreamPayloadSizeMax);
  /// Memory for messages that are larger than a frame, each of which takes message_size_max bytes
  /// of it while it comes, is served, or is kept as a reply; and one more, where replies are
  /// written. Without, no message is larger than a frame. The caller's, aligned to 64 bytes;
  /// touched only when used.
  MutableBytes large_memory{};
  /// Memory for streams, stream_buffer_size() bytes for each that runs at a time. Without, calls
  /// that ask for a stream are refused. The caller's, aligned to 64 bytes; touched only when used.
  MutableBytes stream_memory{};
};

/// What one stream takes of ServerSessionsConfig::stream_memory: where frames may get lost, all
/// that are on their way are kept; else one frame at a time. An item itself stays with the caller
/// of push_item().
[[nodiscard]] constexpr std::size_t stream_buffer_size(Medium medium) noexcept {
  return medium == Medium::kDatagram ? kStreamWindow * kDatagramFrameSizeMax : kStreamFrameSizeMax;
}

/// A call that the lane is to run.
struct Request {
  Header header{};
  ConstBytes payload{};      ///< Views the frame.
  MonotonicTime deadline{};  ///< On this host's clock.
  MonotonicTime received{};
  std::uint32_t session_index = 0;
  std::uint32_t slot_index = 0;
  std::uint32_t caller_host = 0;  ///< The lane's, for its servants; the protocol leaves it alone.

  /// The caller is answered before the method runs: call accept() first.
  [[nodiscard]] bool wants_receipt() const noexcept {
    return (header.flags & kFlagReplyOnReceipt) != 0;
  }
  /// The caller takes a stream of items.
  [[nodiscard]] bool wants_stream() const noexcept { return header.item > 0; }
};

/// What is to be done with a received frame.
struct Verdict {
  enum class Action : std::uint8_t {
    kNothing,   ///< Dropped and counted, or taken note of.
    kSend,      ///< Send `frame` back to where the frame came from.
    kDispatch,  ///< Run `request`, then complete() it, now or later, and send what that gives.
    kHangUp,    ///< Stream only: the bytes are not our protocol; end the connection.
  };
  Action action = Action::kNothing;
  ConstBytes frame{};  ///< Valid until the next call on the same ServerSessions; there may be more.
  Request request{};
  /// Of a tagged stream (see set_tag) that may take more items now; 0: none.
  std::uint32_t credit_tag = 0;
};

/// A frame and where it is to be sent.
struct Outgoing {
  ConstBytes frame{};
  PeerAddress peer{};
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

  /// Where the reply to `request` is to be written, aligned to 16 bytes. It exists even when
  /// its session has ended and the reply will not be sent. Valid until the next frame is taken
  /// or request completed. At most reply_size_max(); one frame's while is_short_of_buffers().
  [[nodiscard]] MutableBytes reply_buffer(const Request& request, MonotonicTime now) noexcept;
  /// The largest reply that the session allows.
  [[nodiscard]] std::uint32_t reply_size_max(const Request& request) const noexcept;
  /// Whether a reply larger than a frame would find no buffer now: all are taken, or the caller's
  /// host has its share. It may wait until has_freed_buffer(), or until next_buffer_time().
  [[nodiscard]] bool is_short_of_buffers(const Request& request, MonotonicTime now) const noexcept;
  /// Whether a buffer for a large message became free since the last call.
  [[nodiscard]] bool has_freed_buffer() noexcept { return std::exchange(has_freed_buffer_, false); }
  /// When the next message after `now` may be evicted. Linear in the buffers.
  [[nodiscard]] MonotonicTime next_buffer_time(MonotonicTime now) const noexcept;

  /// Sets a buffer aside for a reply of `size` bytes, to be written while other frames are taken.
  /// Pass it to complete(), which frees it unless it sends it. The request is not read any more.
  /// @return empty: the reply fits a frame, nobody waits for it, or is_short_of_buffers()
  [[nodiscard]] MutableBytes reserve_reply(const Request& request, std::uint32_t size,
                                           MonotonicTime now) noexcept;

  /// Answers a request that wants_receipt(), before it runs: kOk if it will. Gives the frame to
  /// send. It is completed like any other afterwards, which then gives none.
  [[nodiscard]] ConstBytes accept(const Request& request, Status status,
                                  MonotonicTime now) noexcept;

  /// Ends `request`: with `payload_size` bytes of the reply buffer. Gives the frame to send, valid
  /// until the next request of the session takes the same slot; empty if nobody is to be told: the
  /// call wants no reply, was cancelled, or its session has ended, which is counted.
  /// A request may be completed long after others that came later, once.
  /// @param reserved  from reserve_reply(), with the payload; empty: it is in the reply buffer
  [[nodiscard]] ConstBytes complete(const Request& request, Status status,
                                    std::uint32_t payload_size, MonotonicTime now,
                                    MutableBytes reserved = {}) noexcept;

  /// Where what is sent for `request` goes; nothing once its session has ended.
  [[nodiscard]] std::optional<PeerAddress> peer_of(const Request& request) const noexcept;

  /// Names a request that will be completed later, by a number that is not 0, so that the lane can
  /// be told of it: by next_cancelled() and Verdict::credit_tag.
  void set_tag(const Request& request, std::uint32_t tag) noexcept;
  /// The tag of a request whose caller gave up, given once; 0 if there is none. It must
  /// be completed all the same. To be called after on_frame(), on_time() and forget() until it
  /// gives 0.
  [[nodiscard]] std::uint32_t next_cancelled() noexcept;

  /// The most bytes of an item of the stream `request`; 0 if it is none, or once nobody waits for
  /// it.
  [[nodiscard]] std::uint32_t item_size_max(const Request& request) noexcept;
  /// The most bytes of an item of the stream `request` that goes in one frame; 0 as above.
  [[nodiscard]] std::uint32_t item_frame_size_max(const Request& request) noexcept;
  /// Gives the next frame of `item`, which has at most item_size_max() bytes and is the same until
  /// is_item_midway() is false. The frame is to be sent before the next is asked for. Empty while
  /// the caller takes no more, and for good once its caller gave up.
  [[nodiscard]] ConstBytes push_item(const Request& request, ConstBytes item,
                                     MonotonicTime now) noexcept;
  /// A part of the item was given, and push_item() has more of it.
  [[nodiscard]] bool is_item_midway(const Request& request) noexcept;

  /// Ends streams whose caller was silent for too long.
  void on_time(MonotonicTime now) noexcept;
  /// Before this on_time() has nothing to do. Takes no look at the streams, so it may be asked
  /// each time that a lane goes to sleep.
  [[nodiscard]] MonotonicTime next_time() const noexcept;

  /// Stream only: the connection `peer` is gone, and its session with it.
  void end_connection(const PeerAddress& peer) noexcept;
  /// Stream only: whether the connection `peer` has a session. Looks at all sessions.
  [[nodiscard]] bool has_session(const PeerAddress& peer) const noexcept;
  /// Stream only: the answer to the first frame of a connection for which no slot is free: REFUSE
  /// overload to a HELLO, nothing to anything else. Valid like a Verdict's frame.
  [[nodiscard]] ConstBytes turn_away(ConstBytes frame, MonotonicTime now) noexcept;

  /// Ends a session because the server stops; gives the CLOSE to send, nothing if there is no
  /// session left.
  [[nodiscard]] std::optional<Outgoing> close_next(MonotonicTime now) noexcept;

  [[nodiscard]] const FrameCounters& counters() const noexcept { return counters_; }
  [[nodiscard]] std::uint32_t session_count() const noexcept { return session_count_; }
  /// Open streams.
  [[nodiscard]] std::uint32_t stream_count() const noexcept { return open_stream_count_; }
  /// Large messages whose peer was heard lately (hp-5.6-10).
  [[nodiscard]] std::uint32_t large_message_count(MonotonicTime now) const noexcept;

 private:
  static constexpr std::uint16_t kNoLargeBuffer = 0xffff;
  static constexpr std::uint16_t kNoStream = 0xffff;

  struct Slot {
    enum class State : std::uint8_t { kEmpty, kReceiving, kRunning, kDone };
    State state = State::kEmpty;
    bool is_unawaited = false;  ///< It runs, and without a waiting caller: a oneway, or cancelled.
    bool is_evicted = false;    ///< A request that was given up before it was whole.
    std::uint32_t call_id = 0;
    std::uint32_t newest_call_id = 0;      ///< Later than call_id: it was refused, as this one ran.
    std::uint32_t frame_size = 0;          ///< Of the kept reply; 0: it is in large, or not kept.
    std::uint16_t large = kNoLargeBuffer;  ///< Where the request or the reply is, if it is large.
    std::uint16_t stream = kNoStream;      ///< Of items, until all have arrived.
    std::uint32_t tag = 0;                 ///< Given by set_tag() while it runs.
  };
  /// Holds a message larger than a frame: one being received, served or sent.
  struct LargeBuffer {
    enum class Use : std::uint8_t { kFree, kScratch, kReserved, kRequest, kReply };
    Use use = Use::kFree;
    std::uint32_t session_index = 0;
    std::uint32_t slot_index = 0;
    MonotonicTime deadline{};  ///< Until when its caller waits.
    MonotonicTime heard{};     ///< When its peer showed last that it works on it.
    MutableBytes memory{};
    IncomingMessage incoming;
    OutgoingMessage outgoing;
  };
  /// The items that answer one call.
  struct Stream {
    std::uint32_t session_index = 0;
    std::uint32_t slot_index = 0;
    MonotonicTime deadline{};  ///< Until when its caller promised to be heard again.
    OutgoingStream items;      ///< Begun while in use.
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

  /// What is to be done with a frame, but for the request, which stays where it is.
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
  void free_stream(Slot& slot) noexcept;
  void cancel(Slot& slot) noexcept;
  [[nodiscard]] ConstBytes kept_reply(std::uint32_t session_index,
                                      std::uint32_t slot_index) noexcept;
  [[nodiscard]] Slot* slot_of(const Request& request) noexcept;
  [[nodiscard]] Stream* stream_of(const Request& request) noexcept;
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
  void put_in_place_of_scratch(MutableBytes reserved) noexcept;
  void make_large_buffers();
  void make_streams();
  [[nodiscard]] ConstBytes next_repair() noexcept;
  [[nodiscard]] bool is_awaited(const LargeBuffer& large, MonotonicTime now) const noexcept;
  [[nodiscard]] MonotonicTime idle_time(const LargeBuffer& large) const noexcept;
  [[nodiscard]] std::uint32_t large_buffer_count_max() const noexcept {
    return large_buffers_.empty() ? 0 : static_cast<std::uint32_t>(large_buffers_.size()) - 1;
  }
  [[nodiscard]] std::uint16_t find_large_buffer(const PeerAddress& peer,
                                                MonotonicTime now) const noexcept;
  [[nodiscard]] std::uint16_t take_large_buffer(LargeBuffer::Use use, const Request& request,
                                                MonotonicTime now) noexcept;
  [[nodiscard]] Answer send_large_again(const Slot& slot, MonotonicTime now) noexcept;
  void evict(LargeBuffer& large, MonotonicTime now) noexcept;
  void free_large_buffer(Slot& slot) noexcept;
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
  std::uint32_t payload_size_max_ = 0;  ///< Of one frame.
  std::uint32_t item_size_max_ = 0;     ///< Of a stream.
  std::vector<LargeBuffer> large_buffers_;
  std::uint32_t held_large_count_ = 0;  ///< Those that are neither free nor the scratch.
  bool has_freed_buffer_ = false;
  std::uint16_t scratch_ = kNoLargeBuffer;  ///< Where replies are written that may become large.
  std::uint16_t sending_ = kNoLargeBuffer;  ///< Whose window next_frame() goes on with.
  std::vector<Stream> streams_;
  std::uint32_t open_stream_count_ = 0;
  MonotonicTime streams_due_ = kNever;    ///< No stream's deadline is before this.
  std::uint16_t repairing_ = kNoStream;   ///< Whose lost items next_frame() goes on with,
  bool is_reply_due_ = false;             ///< and behind them its reply.
  std::vector<std::uint32_t> cancelled_;  ///< Tags that next_cancelled() tells.
  std::vector<Session> sessions_;
  struct alignas(64) CacheLine {
    std::byte bytes[64];
  };
  [[nodiscard]] static std::size_t lines_for(std::size_t size) noexcept {
    return (size + sizeof(CacheLine) - 1) / sizeof(CacheLine);
  }
  std::vector<CacheLine> frames_;
  std::vector<CacheLine> fragment_frame_;  ///< One frame of a large reply, as it is sent.
  std::vector<CacheLine> unsent_frame_;    ///< For replies that are not sent.
  alignas(64) std::array<std::byte, 256> answer_{};
  FrameCounters counters_{};
};

}  // namespace rtpm::wire
