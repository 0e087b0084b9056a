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

/// Whether a call refused with unknown_session has certainly not run: the server still has the
/// epoch that opened the session, and would have kept a session that it heard since the call was
/// first sent, at `begun`.
/// @source   spec/hprotocol.md#hp-5.5-2
[[nodiscard]] bool has_not_run(std::uint64_t lost_epoch, std::uint64_t epoch_now,
                               MonotonicTime begun, MonotonicTime now) noexcept;

/// The configuration of a channel.
struct ClientChannelConfig {
  Medium medium = Medium::kDatagram;
  std::uint64_t client_epoch = 0;  ///< The program's epoch; not 0.
  std::uint64_t channel = 0;       ///< Unique for each channel of the program.
  std::uint64_t clock_domain = 0;
  std::uint32_t message_size_max = static_cast<std::uint32_t>(kDatagramPayloadSizeMax);
  std::uint16_t open_call_max = 1;  ///< Concurrent calls, 1…kCallWindow, if the server grants them.
  /// Random for each run of the program; the first handshake uses the next number. So an answer to
  /// an earlier run at the same address does not match (hp-4-2).
  std::uint32_t handshake_number = 0;
};

/// The parameters of a call, except its payload.
struct CallParameters {
  std::uint32_t service = 0;
  std::uint16_t method = 0;
  Priority priority{};
  std::uint64_t trace_id = 0;
  MonotonicTime deadline{};
  Delivery delivery = Delivery::kReply;
  /// How many items of a stream the client accepts at a time, up to kStreamWindow; 0 if it is not a
  /// stream.
  std::uint32_t stream_window = 0;
  /// The memory for collecting a stream's items.
  IncomingStream::Buffers stream_buffers{};
  /// How long a stream's client keeps asking without an answer, at most kStreamSilence.
  Duration stream_silence = kStreamSilence;
  /// How long the server keeps a stream without hearing from its client; over datagrams at most
  /// kStreamLeaseMax. A value beyond a budget's range means as long as the connection lasts.
  Duration stream_lease = kStreamLease;
};

/// The index of a channel's open call, below open_call_max.
using CallIndex = std::uint16_t;

/// A change in the channel's handshake or in one of its calls.
struct ChannelEvent {
  enum class Kind : std::uint8_t {
    kNothing,  ///< Keep waiting.
    kSend,     ///< Send `frame` and keep waiting.
    kReady,    ///< The handshake is done.
    /// The call's reply: `status` and `payload`. For a stream, its end: next_item() may still
    /// return items.
    kReply,
    kItems,    ///< The stream has items: call next_item() until it returns none.
    kRefused,  ///< The handshake was refused with `status`.
    kLost,     ///< The server does not know the session: all open calls have ended. Open it again.
    kClosed,   ///< The server closed the session normally: all open calls have ended.
    /// A reply of `reply_size` bytes is arriving: call set_reply_buffer(), then on_frame() again
    /// with the same frame.
    kNeedBuffer,
    kTimeout,  ///< The deadline of the handshake or call passed, or a stream's server fell silent.
    kBroken,   ///< Stream medium only: not this protocol; end the connection. The session is gone.
  };
  Kind kind = Kind::kNothing;
  CallIndex call = 0;  ///< The call, if the event concerns one.
  Status status = Status::kOk;
  ConstBytes frame{};    ///< Send it, for any kind, unless empty.
  ConstBytes payload{};  ///< Views the received frame, or the buffer of a large reply.
  std::uint32_t reply_size = 0;
};

/// The client's half of the protocol: handshake, calls, retransmission, matching of replies,
/// streams. Does no I/O: frames and times come in, frames go out.
/// @ownership writes into `buffer`, which must outlive it and hold the largest frame to send, at
///            least 128 bytes
/// @threads  one at a time
/// @realtime alloc-free except construction
class ClientChannel {
 public:
  ClientChannel(const ClientChannelConfig& config, MutableBytes buffer);
  ClientChannel(const ClientChannel&) = delete;
  ClientChannel& operator=(const ClientChannel&) = delete;

  /// Sets whether the path to the server stays on this host. If not, it may lose frames, so calls
  /// are repeated sooner. Call it before open().
  void set_on_host(bool is_on_host) noexcept {
    round_trip_.set_interval_min(is_on_host ? kRetransmitIntervalOnHost : kRetransmitIntervalMin);
  }
  /// Starts a handshake for the band of `priority`. Ends open calls; items of streams that have
  /// ended can still be taken.
  /// @return the frame to send
  [[nodiscard]] ConstBytes open(Priority priority, MonotonicTime deadline,
                                MonotonicTime now) noexcept;
  /// Whether another call can start now.
  [[nodiscard]] bool has_free_call() const noexcept;
  /// Starts a call on a channel that is_ready() and has_free_call(). Its index is last_call(); with
  /// Delivery::kSent the call ends at once and has none.
  /// @param payload  must stay valid until the call ends
  /// @return the frame to send; next_frame() may have more
  /// @errors   nothing was started. kTooLarge: for the server or for this channel's configuration ·
  ///           kWrongBand: the session does not serve the priority; open() one that does
  [[nodiscard]] expected<ConstBytes, Status> call(const CallParameters& parameters,
                                                  ConstBytes payload, MonotonicTime now) noexcept;
  [[nodiscard]] CallIndex last_call() const noexcept { return last_call_; }
  /// Returns further frames to send: fragments of requests, stream queries. Call it after each
  /// call(), next_item() and event, until it is empty.
  [[nodiscard]] ConstBytes next_frame(MonotonicTime now) noexcept;
  /// Sets the buffer for replies larger than a frame, for this call and later ones with its index.
  /// The buffer must stay valid until the channel ends or another buffer is set.
  void set_reply_buffer(MutableBytes buffer, CallIndex call = 0) noexcept;
  /// Returns the next item of a stream, in order; valid until the next call. nullopt if there is
  /// none now. After the stream's kReply and its last item the index is free.
  [[nodiscard]] std::optional<ConstBytes> next_item(CallIndex call) noexcept;
  /// Ends an open call whose caller gave up. It may have run.
  /// @return the frame to send, which may get lost
  [[nodiscard]] ConstBytes cancel(CallIndex call, MonotonicTime now) noexcept;

  /// Ends the session.
  /// @return the frame to send
  [[nodiscard]] ConstBytes close(MonotonicTime now) noexcept;
  /// Call it when the connection is gone: the next call then needs a handshake.
  void reset() noexcept;

  [[nodiscard]] ChannelEvent on_frame(ConstBytes frame, MonotonicTime now) noexcept;
  /// Call it at next_time(), until it returns kNothing.
  [[nodiscard]] ChannelEvent on_time(MonotonicTime now) noexcept;
  /// Repeats a call immediately.
  [[nodiscard]] ChannelEvent repeat(MonotonicTime now, CallIndex call = 0) noexcept;
  /// Like repeat(), for the first open call, if any.
  [[nodiscard]] ChannelEvent repeat_first(MonotonicTime now) noexcept;
  /// When on_time() is due, unless a frame arrives earlier.
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
  /// The server's clock, as estimated from the calls so far; nullopt before the first measurement.
  [[nodiscard]] std::optional<PeerClock> peer_clock(MonotonicTime now) const noexcept;
  [[nodiscard]] const RoundTrip& round_trip() const noexcept { return round_trip_; }
  [[nodiscard]] const FrameCounters& counters() const noexcept { return counters_; }
  [[nodiscard]] std::uint64_t repeat_count() const noexcept { return repeat_count_; }

 private:
  struct Call {
    explicit Call(RoundTrip& path) noexcept : timer(path) {}
    bool is_open = false;
    bool is_ended = false;            ///< A stream whose reply was reported; items may remain.
    bool has_answered = false;        ///< A stream whose server is known to have the call.
    bool is_credit_due = false;       ///< next_frame() sends a CREDIT.
    bool is_asking = false;           ///< The CREDIT requests an answer.
    Status end_status = Status::kOk;  ///< From a REPLY that arrived before the stream's last items.
    Header header{};
    ConstBytes payload{};
    OutgoingMessage request;  ///< In use if the call is sent in fragments.
    IncomingMessage reply;    ///< In use once a fragment of a reply arrived.
    MutableBytes reply_buffer{};
    IncomingStream items;
    std::uint32_t credit_sent = 0;  ///< The item limit of the last CREDIT.
    std::uint32_t bytes_sent = 0;   ///< The byte limit of the last CREDIT.
    std::uint32_t freed_sent = 0;   ///< The frames freed by then.
    Duration lease = kStreamLease;  ///< See CallParameters::stream_lease.
    Duration silence = kStreamSilence;
    MonotonicTime asked{};        ///< When the first unanswered query was sent.
    std::uint32_t ask_count = 0;  ///< The number of unanswered queries.
    MonotonicTime item_heard{};   ///< When the last item arrived.
    Duration item_gap{0};         ///< The smoothed time between items.
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
  std::uint32_t call_id_ = 0;  ///< The id of the last call started.
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
