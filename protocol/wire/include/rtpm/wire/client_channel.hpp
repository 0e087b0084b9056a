#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "rtpm/base/bytes.hpp"
#include "rtpm/base/expected.hpp"
#include "rtpm/base/priority.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/wire/clock_sync.hpp"
#include "rtpm/wire/counters.hpp"
#include "rtpm/wire/fragments.hpp"
#include "rtpm/wire/handshake.hpp"
#include "rtpm/wire/header.hpp"
#include "rtpm/wire/medium.hpp"
#include "rtpm/wire/retransmit.hpp"
#include "rtpm/wire/status.hpp"
#include "rtpm/wire/stream.hpp"

namespace rtpm::wire {

/// Whether a call that was refused with unknown_session has certainly not run: the server is still
/// in the epoch that opened the session, and would have kept a session that it heard since the call
/// was `begun`.
/// @source   spec/hprotocol.md#hp-5.5-2
[[nodiscard]] bool has_not_run(std::uint64_t lost_epoch, std::uint64_t epoch_now,
                               MonotonicTime begun, MonotonicTime now) noexcept;

/// How a channel is set up.
struct ClientChannelConfig {
  Medium medium = Medium::kDatagram;
  std::uint64_t client_epoch = 0;  ///< The program's epoch; not 0.
  std::uint64_t channel = 0;       ///< Different for each channel of the program.
  std::uint64_t clock_domain = 0;
  std::uint32_t message_size_max = static_cast<std::uint32_t>(kDatagramPayloadSizeMax);
  std::uint16_t open_call_max = 1;  ///< Calls at a time, 1…kCallWindow, if the server grants them.
  /// Random for each run of the program; the first handshake has the next number. So an answer to
  /// an earlier run at the same address does not match (hp-4-2).
  std::uint32_t handshake_number = 0;
};

/// The parameters of a call besides its payload.
struct CallParameters {
  std::uint32_t service = 0;
  std::uint16_t method = 0;
  Priority priority{};
  std::uint64_t trace_id = 0;
  MonotonicTime deadline{};
  Delivery delivery = Delivery::kReply;
  /// The items that a stream takes at a time, up to kStreamWindow; 0 if it is not a stream.
  std::uint32_t stream_window = 0;
  /// The memory in which a stream's items are collected.
  IncomingStream::Buffers stream_buffers{};
  /// How long a stream's client keeps asking without an answer, at most kStreamSilence.
  Duration stream_silence = kStreamSilence;
  /// How long the server keeps a stream without hearing its client. A value beyond the range of a
  /// budget: as long as its connection lasts. Over datagrams at most kStreamLeaseMax.
  Duration stream_lease = kStreamLease;
};

/// The slot of one of a channel's open calls, below open_call_max.
using CallIndex = std::uint16_t;

/// A change of the channel's handshake or of one of its calls.
struct ChannelEvent {
  enum class Kind : std::uint8_t {
    kNothing,  ///< Go on waiting.
    kSend,     ///< Send `frame` and go on waiting.
    kReady,    ///< The handshake is done.
    kReply,    ///< The call's reply: `status` and `payload`. A stream's end: next_item() may still
               ///< have items.
    kItems,    ///< The stream has items: call next_item() until it gives none.
    kRefused,  ///< The handshake was refused with `status`.
    kLost,     ///< The server does not know the session: every open call is over. Handshake again.
    kClosed,   ///< The server ended the session in order: every open call is over.
    kNeedBuffer,  ///< A reply of `reply_size` bytes comes: call set_reply_buffer(), then
                  ///< on_frame() again with the same frame.
    kTimeout,  ///< The deadline of the handshake or call passed, or a stream's server fell silent.
    kBroken,   ///< Stream medium only: not this protocol; end the connection. The session is gone.
  };
  Kind kind = Kind::kNothing;
  CallIndex call = 0;  ///< The call, if the event is one of a call.
  Status status = Status::kOk;
  ConstBytes frame{};    ///< Send it, whatever the kind, unless it is empty.
  ConstBytes payload{};  ///< Views the received frame, or the buffer of a large reply.
  std::uint32_t reply_size = 0;
};

/// The client's half of the protocol: handshake, calls, repetition, matching of replies, streams.
/// It does no I/O: frames and times come in, frames go out.
/// @ownership writes into `buffer`, which must outlive it and hold the largest frame to be sent, at
///           least 128 bytes
/// @threads  one at a time
/// @realtime alloc-free but for construction
class ClientChannel {
 public:
  ClientChannel(const ClientChannelConfig& config, MutableBytes buffer);
  ClientChannel(const ClientChannel&) = delete;
  ClientChannel& operator=(const ClientChannel&) = delete;

  /// Sets whether the path to the server stays on this host; if not, it may lose frames, and calls
  /// are repeated sooner. Call it before open().
  void set_on_host(bool is_on_host) noexcept {
    round_trip_.set_interval_min(is_on_host ? kRetransmitIntervalOnHost : kRetransmitIntervalMin);
  }
  /// Begins a handshake for the band of `priority`. Ends open calls; items of streams that ended
  /// before can still be taken.
  /// @return the frame to send
  [[nodiscard]] ConstBytes open(Priority priority, MonotonicTime deadline,
                                MonotonicTime now) noexcept;
  /// Whether one more call can begin now.
  [[nodiscard]] bool has_free_call() const noexcept;
  /// Begins a call on a channel that is_ready() and has_free_call(). last_call() is its index; with
  /// Delivery::kSent the call ends at once and has none.
  /// @param payload  stays valid until the call ends
  /// @return the frame to send; next_frame() may have more
  /// @errors   nothing was begun. kTooLarge: for the server or for this channel's configuration ·
  ///           kWrongBand: the session does not serve the priority, open() one that does
  [[nodiscard]] expected<ConstBytes, Status> call(const CallParameters& parameters,
                                                  ConstBytes payload, MonotonicTime now) noexcept;
  [[nodiscard]] CallIndex last_call() const noexcept { return last_call_; }
  /// Further frames to send: fragments of requests, questions of streams. Call it after each
  /// call(), next_item() and event, until it is empty.
  [[nodiscard]] ConstBytes next_frame(MonotonicTime now) noexcept;
  /// Sets the buffer for replies larger than a frame, for this call and later ones at its index.
  /// The buffer must stay until the channel ends or another is set.
  void set_reply_buffer(MutableBytes buffer, CallIndex call = 0) noexcept;
  /// The next item of a stream, in order; valid until the next call. Nothing if there is none now.
  /// After the stream's kReply and its last item the index is free.
  [[nodiscard]] std::optional<ConstBytes> next_item(CallIndex call) noexcept;
  /// Ends an open call whose caller gave up. It may have run.
  /// @return the frame to send, which may get lost
  [[nodiscard]] ConstBytes cancel(CallIndex call, MonotonicTime now) noexcept;

  /// Ends the session.
  /// @return the frame to send
  [[nodiscard]] ConstBytes close(MonotonicTime now) noexcept;
  /// Call it when the connection is gone: the next call needs a handshake.
  void reset() noexcept;

  [[nodiscard]] ChannelEvent on_frame(ConstBytes frame, MonotonicTime now) noexcept;
  /// Call it at next_time(), until it gives kNothing.
  [[nodiscard]] ChannelEvent on_time(MonotonicTime now) noexcept;
  /// Repeats a call at once, without waiting for its time.
  [[nodiscard]] ChannelEvent repeat(MonotonicTime now, CallIndex call = 0) noexcept;
  /// Like repeat(), for the first open call, if there is one.
  [[nodiscard]] ChannelEvent repeat_first(MonotonicTime now) noexcept;
  /// When on_time() is due, unless a frame comes first.
  [[nodiscard]] MonotonicTime next_time() const noexcept;

  [[nodiscard]] bool is_ready() const noexcept { return is_ready_; }
  [[nodiscard]] bool is_open(CallIndex call) const noexcept { return calls_[call].is_open; }
  /// The server's grants in the last handshake.
  [[nodiscard]] const Welcome& welcome() const noexcept { return welcome_; }
  [[nodiscard]] std::uint64_t session() const noexcept { return session_; }
  /// When the call was first sent.
  [[nodiscard]] MonotonicTime call_begun(CallIndex call = 0) const noexcept {
    return calls_[call].begun;
  }
  /// The server's clock as estimated from the calls so far; nothing before the first measurement.
  [[nodiscard]] std::optional<PeerClock> peer_clock(MonotonicTime now) const noexcept;
  [[nodiscard]] const RoundTrip& round_trip() const noexcept { return round_trip_; }
  [[nodiscard]] const FrameCounters& counters() const noexcept { return counters_; }
  [[nodiscard]] std::uint64_t repeat_count() const noexcept { return repeat_count_; }

 private:
  struct Call {
    explicit Call(RoundTrip& path) noexcept : timer(path) {}
    bool is_open = false;
    bool is_ended = false;            ///< A stream whose reply was reported; items may be left.
    bool has_answered = false;        ///< A stream whose server is known to have the call.
    bool is_credit_due = false;       ///< next_frame() sends a CREDIT.
    bool is_asking = false;           ///< That CREDIT wants an answer.
    Status end_status = Status::kOk;  ///< From a REPLY that came before the stream's last items.
    Header header{};
    ConstBytes payload{};
    OutgoingMessage request;  ///< Begun if the call goes in fragments.
    IncomingMessage reply;    ///< Begun once a fragment of a reply came.
    MutableBytes reply_buffer{};
    IncomingStream items;
    std::uint32_t credit_sent = 0;  ///< The item limit of the last CREDIT.
    std::uint32_t bytes_sent = 0;   ///< The byte limit of the last CREDIT.
    std::uint32_t freed_sent = 0;   ///< Frames that were freed at the last CREDIT.
    Duration lease = kStreamLease;  ///< See CallParameters::stream_lease.
    Duration silence = kStreamSilence;
    MonotonicTime asked{};        ///< When the first question without an answer was sent.
    std::uint32_t ask_count = 0;  ///< Questions without an answer.
    MonotonicTime item_heard{};   ///< When the last item came.
    Duration item_gap{0};         ///< Smoothed time between items.
    MonotonicTime begun{};
    MonotonicTime deadline = kNever;
    RetransmitTimer timer;
  };

  [[nodiscard]] std::optional<CallIndex> free_call() const noexcept;
  [[nodiscard]] std::uint32_t next_call_id() const noexcept;
  [[nodiscard]] CallIndex index_of(const Call& call) const noexcept {
    return static_cast<CallIndex>(&call - calls_.data());
  }
  [[nodiscard]] Call* find(const Header& header) noexcept;
  [[nodiscard]] std::uint32_t budget_of(const Call& call, MonotonicTime now) const noexcept;
  [[nodiscard]] ConstBytes begin_call(Call& call, MonotonicTime now) noexcept;
  [[nodiscard]] ChannelEvent on_reply(const Header& header, ConstBytes payload,
                                      MonotonicTime now) noexcept;
  [[nodiscard]] bool is_of_this_handshake(const Header& header) const noexcept;
  [[nodiscard]] ChannelEvent on_cookie(const Header& header, ConstBytes payload,
                                       MonotonicTime now) noexcept;
  [[nodiscard]] ChannelEvent on_welcome(const Header& header, ConstBytes payload,
                                        MonotonicTime now) noexcept;
  [[nodiscard]] ChannelEvent on_refuse(const Header& header, ConstBytes payload) noexcept;
  [[nodiscard]] ChannelEvent on_close(const Header& header, ConstBytes payload) noexcept;
  void learn_clock(const Call& call, const Header& reply, MonotonicTime now) noexcept;
  [[nodiscard]] ChannelEvent on_ack(const Header& header, ConstBytes payload,
                                    MonotonicTime now) noexcept;
  [[nodiscard]] ChannelEvent on_large_reply(Call& call, const Header& header, ConstBytes payload,
                                            MonotonicTime now) noexcept;
  [[nodiscard]] ChannelEvent on_item(const Header& header, ConstBytes payload,
                                     MonotonicTime now) noexcept;
  [[nodiscard]] ChannelEvent on_stream_end(Call& call, const Header& header, ConstBytes payload,
                                           MonotonicTime now) noexcept;
  [[nodiscard]] ChannelEvent end_of_stream(Call& call, MonotonicTime now) noexcept;
  static void hear(Call& call) noexcept;
  void hear_of_items(Call& call, MonotonicTime now) const noexcept;
  static void ask_after(Call& call, Duration wait, MonotonicTime now) noexcept;
  [[nodiscard]] bool is_stream_known(const Call& call) const noexcept;
  static void count_question(Call& call, MonotonicTime now) noexcept;
  static void look_at_credit(Call& call) noexcept;
  [[nodiscard]] MonotonicTime due(const Call& call) const noexcept;
  [[nodiscard]] ChannelEvent on_call_time(Call& call, MonotonicTime now) noexcept;
  [[nodiscard]] ConstBytes reply_ack(Call& call, bool is_asking, MonotonicTime now) noexcept;
  [[nodiscard]] ConstBytes credit_frame(Call& call, MonotonicTime now) noexcept;
  [[nodiscard]] ConstBytes cancel_frame(const Header& about, MonotonicTime now) noexcept;
  void end_call(Call& call) noexcept;
  void end_all() noexcept;
  [[nodiscard]] ChannelEvent drop(DropReason reason) noexcept;
  [[nodiscard]] ConstBytes hello_frame(MonotonicTime now) noexcept;
  [[nodiscard]] ConstBytes stamp_call(Call& call, MonotonicTime now) noexcept;

  ClientChannelConfig config_;
  MutableBytes buffer_;
  bool is_ready_ = false;
  bool is_opening_ = false;  ///< A handshake is under way.
  bool may_answer_cookie_ = false;
  Priority hello_priority_{};
  std::uint32_t handshake_number_;
  MonotonicTime hello_deadline_ = kNever;
  Cookie cookie_{};
  Welcome welcome_{};
  std::uint64_t session_ = 0;
  std::uint32_t frame_payload_max_ = 0;
  std::uint32_t call_id_ = 0;  ///< The id of the call begun last.
  CallIndex last_call_ = 0;
  RoundTrip hello_trip_{};
  RetransmitTimer hello_timer_{hello_trip_};
  RoundTrip round_trip_{};
  std::vector<Call> calls_;
  std::array<std::byte, kHeaderSize + FragmentAck::kSize> small_frame_{};
  ClockEstimator clock_{};
  std::uint64_t repeat_count_ = 0;
  FrameCounters counters_{};
};

}  // namespace rtpm::wire
