#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <new>
#include <optional>
#include <type_traits>
#include <vector>

#include "rtpm/base/bytes.hpp"
#include "rtpm/rpc/async.hpp"
#include "rtpm/rpc/error.hpp"
#include "rtpm/rpc/node.hpp"
#include "rtpm/rt/lazy_memory.hpp"
#include "rtpm/transport/client_transport.hpp"
#include "rtpm/transport/datagram_batch.hpp"
#include "rtpm/wire/client_channel.hpp"
#include "security/sealed_transport.hpp"
#include "security/server_address.hpp"

namespace rtpm::rpc {

/// How a call ended on its channel.
struct CallOutcome {
  enum class Kind : std::uint8_t {
    kReply,   ///< The server answered: `status`, `payload`. For a stream: it ended.
    kItems,   ///< Streams only: items are ready, see next_item().
    kGoing,   ///< Still in progress.
    kFailed,  ///< `error` says why there is no answer.
    kLost,    ///< The server no longer knows the session: see Binding for the consequences.
    /// A oneway was not sent because the session has ended; another session may carry it.
    kUnsent,
  };
  Kind kind = Kind::kFailed;
  CallError error = CallError::kTimeout;
  wire::Status status = wire::Status::kOk;
  ConstBytes payload{};
};

/// A transport and a session on it. Carries the calls of the thread that has taken the channel, one
/// at a time. That thread sends and receives itself: no other thread stands between it and its
/// reply.
/// @threads  try_take(), serves() and has_unconfirmed(): any; the rest: the thread that took it
/// @realtime alloc-free, except make_ready() without a session, and keep() as it grows
class CallChannel {
 public:
  /// `lost_oneways` is incremented for oneways that may not have arrived because their session
  /// ended. `keys` is used if the address has a key.
  CallChannel(const ServerAddress& address, const NodeConfig& config, NodeKeys& keys,
              std::uint64_t client_epoch, std::uint64_t number, std::uint64_t clock_domain,
              std::atomic<std::uint64_t>& lost_oneways);
  /// Notifies the server that the session ends, if there is one.
  ~CallChannel();
  CallChannel(const CallChannel&) = delete;
  CallChannel& operator=(const CallChannel&) = delete;

  /// Reserves the channel for the caller; returns true if it was free.
  [[nodiscard]] bool try_take() noexcept {
    return !is_taken_.exchange(true, std::memory_order_acquire);
  }
  void release() noexcept { is_taken_.store(false, std::memory_order_release); }

  /// Whether its session serves the priority, according to the last handshake.
  [[nodiscard]] bool serves(Priority priority) const noexcept;
  /// True before the first handshake tells which band it serves.
  [[nodiscard]] bool is_new() const noexcept {
    return band_.load(std::memory_order_relaxed) == kNoBand;
  }

  /// How long a reader may pause a stream that sets no limit itself.
  [[nodiscard]] Duration stream_pause_max() const noexcept {
    return address_.transport == Transport::kUdp ? Duration{wire::kStreamLease} : Duration::max();
  }

  /// Ensures a session for `priority`. Makes a handshake if necessary; otherwise makes no syscall.
  [[nodiscard]] expected<void, CallError> make_ready(Priority priority,
                                                     MonotonicTime deadline) noexcept;
  /// Why the last make_ready() failed, as text; empty if the error alone says it.
  [[nodiscard]] const SetupError& transport_error() const noexcept { return transport_error_; }
  [[nodiscard]] bool is_ready(Priority priority) const noexcept {
    return wire_.is_ready() && serves(priority) && !is_renewal_due();
  }
  /// Sends the call and waits until it ends. The outcome's payload is valid until the next call.
  [[nodiscard]] CallOutcome call(const wire::CallParameters& parameters, ConstBytes request,
                                 MonotonicTime now) noexcept;
  /// Sends the call; finish() waits for its end. The request must live until then, see keep(). The
  /// channel holds the memory for the items of a stream.
  /// @errors   kTooLarge, kDisconnected
  [[nodiscard]] expected<void, CallError> begin(const wire::CallParameters& parameters,
                                                ConstBytes request, MonotonicTime now) noexcept;
  /// Waits until the call ends or has items, at most until `until`; then the outcome is kGoing.
  [[nodiscard]] CallOutcome finish(MonotonicTime until, MonotonicTime now) noexcept;
  /// Lets a descriptor report until end_sleep() that finish() has something to do.
  [[nodiscard]] Readiness announce_sleep() noexcept;
  /// @realtime at most one syscall
  void end_sleep() noexcept;
  /// Checks whether the session ended before oneways were confirmed, and counts them in
  /// `lost_oneways`.
  /// @realtime at most two syscalls and one per received frame
  void check_oneways(MonotonicTime now) noexcept;
  /// Whether check_oneways() has something to check.
  [[nodiscard]] bool has_unconfirmed() const noexcept {
    return unconfirmed_count_.load(std::memory_order_relaxed) > 0;
  }
  /// The stream's next received item, valid until the next call of this.
  [[nodiscard]] std::optional<ConstBytes> next_item() noexcept;
  /// Notifies the server that the caller no longer waits.
  void cancel() noexcept;
  /// Copies the request for the call's lifetime; nullopt if there is no memory for it.
  [[nodiscard]] std::optional<ConstBytes> keep(ConstBytes request);

  [[nodiscard]] const wire::Welcome& welcome() const noexcept { return wire_.welcome(); }
  [[nodiscard]] std::uint64_t server_epoch() const noexcept { return wire_.welcome().server_epoch; }
  [[nodiscard]] std::optional<wire::PeerClock> peer_clock(MonotonicTime now) const noexcept {
    return wire_.peer_clock(now);
  }
  /// When the last call was first sent.
  [[nodiscard]] MonotonicTime call_begun() const noexcept { return wire_.call_begun(); }

 private:
  static constexpr std::uint32_t kNoBand = 0x0000'ffff;  // Its low end is above its high end.

  /// Whether the session should switch to new keys now.
  [[nodiscard]] bool is_renewal_due() const noexcept {
    return sealed_ != nullptr && sealed_->wants_renewal() && !wire_.is_open(0);
  }
  [[nodiscard]] expected<void, CallError> open_transport(Priority priority,
                                                         MonotonicTime deadline) noexcept;
  [[nodiscard]] expected<void, CallError> shake_hands(Priority priority,
                                                      MonotonicTime deadline) noexcept;
  [[nodiscard]] unexpected<CallError> refused(CallError error) noexcept;
  [[nodiscard]] expected<void, CallError> begin_sent(wire::CallParameters parameters,
                                                     ConstBytes request,
                                                     MonotonicTime now) noexcept;
  [[nodiscard]] expected<void, CallError> begin_call(const wire::CallParameters& parameters,
                                                     ConstBytes request,
                                                     MonotonicTime now) noexcept;
  [[nodiscard]] wire::ChannelEvent wait_for_event(MonotonicTime now, bool may_spin,
                                                  MonotonicTime until) noexcept;
  void take(ConstBytes frame, MonotonicTime now, wire::ChannelEvent& event) noexcept;
  /// Constructs an event in place: copying a freshly written one field by field takes longer than
  /// writing it.
  template <class Make>
  static void set(wire::ChannelEvent& event, Make make) noexcept {
    static_assert(std::is_trivially_destructible_v<wire::ChannelEvent>);
    ::new (static_cast<void*>(&event)) wire::ChannelEvent(make());
  }
  [[nodiscard]] bool is_look_due(MonotonicTime now) const noexcept;
  void look_for_end(MonotonicTime now) noexcept;
  void count_lost_oneways() noexcept;
  [[nodiscard]] bool make_item_room(wire::CallParameters& parameters) noexcept;
  [[nodiscard]] expected<void, transport::IoError> send(ConstBytes frame) noexcept;
  template <class Send>
  [[nodiscard]] expected<void, transport::IoError> send_by(Send send) noexcept;
  [[nodiscard]] bool send_all(ConstBytes frame, MonotonicTime now) noexcept;
  [[nodiscard]] bool send_in_batches(ConstBytes frame, MonotonicTime now) noexcept;
  [[nodiscard]] bool send_batch() noexcept;
  [[nodiscard]] bool make_room(std::uint32_t size) noexcept;
  void drop_transport() noexcept;

  const ServerAddress& address_;
  const NodeConfig& config_;
  NodeKeys& keys_;
  bool accepts_batches_ = false;
  std::atomic<bool> is_taken_{false};
  std::atomic<std::uint32_t> band_{kNoBand};  // low << 16 | high
  std::unique_ptr<transport::ClientTransport> transport_;
  SealedTransport* sealed_ = nullptr;  ///< `transport_` if sessions are sealed.
  SetupError transport_error_{};       ///< The error of the last make_ready().
  std::vector<std::byte> buffer_;
  transport::DatagramBatch batch_;  // Frames to send together. Allocated on first use.
  rt::LazyMemory reply_;            // The buffer of a reply larger than a frame.
  rt::LazyMemory items_;            // The buffer for the items of a stream.
  rt::LazyMemory kept_;             // The copy of a request that outlives the caller's.
  std::atomic<std::uint64_t>& lost_oneways_;
  /// Oneways sent since the server last answered a call over the session. Written by the thread
  /// that took the channel.
  std::atomic<std::uint64_t> unconfirmed_count_{0};
  MonotonicTime last_look_{};
  MonotonicTime last_check_{};  ///< When finish() last checked whether the peer is gone.
  bool is_asleep_ = false;      ///< announce_sleep() was called.
  bool lacks_memory_ = false;  ///< There was no memory for a reply, so the connection was given up.
  wire::ClientChannel wire_;
};

}  // namespace rtpm::rpc
