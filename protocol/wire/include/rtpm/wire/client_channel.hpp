#pragma once

#include <cstdint>
#include <optional>

#include "rtpm/base/bytes.hpp"
#include "rtpm/base/expected.hpp"
#include "rtpm/base/priority.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/wire/clock_sync.hpp"
#include "rtpm/wire/counters.hpp"
#include "rtpm/wire/fragments.hpp"
#include "rtpm/wire/handshake.hpp"
#include "rtpm/wire/header.hpp"
#include "rtpm/wire/retransmit.hpp"
#include "rtpm/wire/server_sessions.hpp"

namespace rtpm::wire {

/// How a channel is set up.
struct ClientChannelConfig {
  Medium medium = Medium::kDatagram;
  std::uint64_t client_epoch = 0;  ///< Of the program; not 0.
  std::uint64_t channel = 0;       ///< Different for each channel of the program.
  std::uint64_t clock_domain = 0;
  std::uint32_t message_size_max = static_cast<std::uint32_t>(kDatagramPayloadSizeMax);
};

/// What a call is to carry besides its payload.
struct CallParameters {
  std::uint32_t service = 0;
  std::uint16_t method = 0;
  Priority priority{};
  std::uint64_t trace_id = 0;
  MonotonicTime deadline{};
};

/// What happened to the channel's current activity (handshake or call).
struct ChannelEvent {
  enum class Kind : std::uint8_t {
    kNothing,   ///< Go on waiting.
    kSend,      ///< Send `frame` and go on waiting.
    kReady,     ///< The handshake is done.
    kReply,     ///< The call's reply: `status` and `payload`.
    kRefused,   ///< The handshake was refused with `status`.
    kLost,      ///< The server does not know the session: handshake again.
    kNeedRoom,  ///< A reply of `room_size` bytes comes: give_room(), then on_frame() again with it.
    kTimeout,   ///< The deadline of the handshake or call passed.
    kBroken,    ///< Stream only: not our protocol; end the connection. The session is gone.
  };
  Kind kind = Kind::kNothing;
  Status status = Status::kOk;
  ConstBytes frame{};    ///< To be sent, whatever the kind, unless it is empty.
  ConstBytes payload{};  ///< Views the received frame, or the room of a large reply.
  std::uint32_t room_size = 0;
};

/// The client's half of the protocol for one call at a time: handshake, repetition, matching of
/// replies. It does no I/O: frames and times come in, frames go out.
/// Ownership: writes its frames into `buffer`, which must outlive it and holds the largest frame
/// that it shall send, at least 128 bytes. Threads: one at a time.   RT: alloc-free.
class ClientChannel {
 public:
  ClientChannel(const ClientChannelConfig& config, MutableBytes buffer) noexcept;

  /// Begins a handshake for the band of `priority`; gives the frame to send.
  [[nodiscard]] ConstBytes open(Priority priority, MonotonicTime deadline,
                                MonotonicTime now) noexcept;
  /// Begins a call with `payload`, which must live until the call ends; gives the frame to send,
  /// and next_frame() may have more. The channel is ready. Errors: kTooLarge: larger than what the
  /// server takes, or than what the channel is set up for; nothing was begun.
  [[nodiscard]] expected<ConstBytes, Status> call(const CallParameters& parameters,
                                                  ConstBytes payload, MonotonicTime now) noexcept;
  /// More to be sent: the window of a request in fragments. To be called after each call() and
  /// event that gave a frame, until it is empty.
  [[nodiscard]] ConstBytes next_frame(MonotonicTime now) noexcept;
  /// Where replies larger than a frame are collected; must outlive the use of their payload.
  void give_room(MutableBytes room) noexcept { room_ = room; }

  /// Ends the session; gives the frame to send.
  [[nodiscard]] ConstBytes close(MonotonicTime now) noexcept;
  /// The connection is gone: the next call needs a handshake.
  void reset() noexcept;

  [[nodiscard]] ChannelEvent on_frame(ConstBytes frame, MonotonicTime now) noexcept;
  [[nodiscard]] ChannelEvent on_time(MonotonicTime now) noexcept;
  /// Repeats the current call at once, without waiting for its time.
  [[nodiscard]] ChannelEvent repeat(MonotonicTime now) noexcept;
  /// When on_time() has something to do, unless a frame comes first.
  [[nodiscard]] MonotonicTime next_time() const noexcept;

  [[nodiscard]] bool is_ready() const noexcept { return is_ready_; }
  /// What the server granted; of the last handshake.
  [[nodiscard]] const Welcome& welcome() const noexcept { return welcome_; }
  [[nodiscard]] std::uint64_t session() const noexcept { return session_; }
  /// When the current call was sent first.
  [[nodiscard]] MonotonicTime call_begun() const noexcept { return call_begun_; }
  /// What the calls so far told of the server's clock; nothing before the first that told.
  [[nodiscard]] std::optional<PeerClock> peer_clock(MonotonicTime now) const noexcept;
  [[nodiscard]] const RetransmitTimer& timer() const noexcept { return call_timer_; }
  [[nodiscard]] const FrameCounters& counters() const noexcept { return counters_; }
  [[nodiscard]] std::uint64_t repeat_count() const noexcept { return repeat_count_; }

 private:
  enum class Activity : std::uint8_t { kNone, kHandshake, kCall };

  [[nodiscard]] ChannelEvent on_reply(const Header& header, ConstBytes payload,
                                      MonotonicTime now) noexcept;
  [[nodiscard]] bool is_of_this_handshake(const Header& header) const noexcept;
  [[nodiscard]] ChannelEvent on_cookie(const Header& header, ConstBytes payload,
                                       MonotonicTime now) noexcept;
  [[nodiscard]] ChannelEvent on_welcome(const Header& header, ConstBytes payload,
                                        MonotonicTime now) noexcept;
  [[nodiscard]] ChannelEvent on_refuse(const Header& header) noexcept;
  void learn_clock(const Header& reply, MonotonicTime now) noexcept;
  [[nodiscard]] bool is_of_this_call(const Header& header) const noexcept;
  [[nodiscard]] ChannelEvent on_ack(const Header& header, ConstBytes payload,
                                    MonotonicTime now) noexcept;
  [[nodiscard]] ChannelEvent on_large_reply(const Header& header, ConstBytes payload,
                                            MonotonicTime now) noexcept;
  [[nodiscard]] ConstBytes reply_ack(MonotonicTime now) noexcept;
  void end_call() noexcept;
  [[nodiscard]] ChannelEvent drop(DropReason reason) noexcept;
  [[nodiscard]] ConstBytes hello_frame(MonotonicTime now) noexcept;
  [[nodiscard]] ConstBytes stamp_call(MonotonicTime now) noexcept;

  ClientChannelConfig config_;
  MutableBytes buffer_;
  Activity activity_ = Activity::kNone;
  bool is_ready_ = false;
  Priority hello_priority_{};
  std::uint32_t handshake_number_ = 0;
  Cookie cookie_{};
  Welcome welcome_{};
  std::uint64_t session_ = 0;
  Header call_{};
  std::uint32_t frame_payload_max_ = 0;
  OutgoingMessage request_;  ///< Begun while the call is one in fragments.
  IncomingMessage reply_;    ///< Begun when the first fragment of a reply came.
  MutableBytes room_{};
  std::array<std::byte, kHeaderSize + FragmentAck::kSize> ack_frame_{};
  MonotonicTime call_begun_{};
  MonotonicTime deadline_ = kNever;
  RetransmitTimer hello_timer_{};
  RetransmitTimer call_timer_{};
  ClockEstimator clock_{};
  std::uint64_t repeat_count_ = 0;
  FrameCounters counters_{};
};

}  // namespace rtpm::wire
