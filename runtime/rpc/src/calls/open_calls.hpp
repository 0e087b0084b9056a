#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "calls/pending.hpp"
#include "media/media.hpp"
#include "model/report.hpp"
#include "rtpm/base/time.hpp"

namespace rtpm::rpc {

/// The calls of a lane that were not answered when they came: deferred replies, streams, calls that
/// wait for a thread, large replies that wait for a buffer. Sends what they have, ends them in
/// time, and reports to their methods when the caller no longer waits.
/// @threads  the leader's
/// @realtime alloc-free but for construction
class OpenCalls {
 public:
  OpenCalls(std::shared_ptr<PendingPool> pool, std::uint32_t call_count_max, Media& media,
            LaneReport& report, Doorbell& doorbell, LaneTap& tap);

  [[nodiscard]] const std::shared_ptr<PendingPool>& pool() const noexcept { return pool_; }
  /// Copies large replies without `lock`, which each caller holds.
  void share(transport::WaitLock* lock) noexcept { lock_ = lock; }
  [[nodiscard]] bool has_any() const noexcept { return pool_->open_count() > 0; }

  /// Begins a turn: goes on with the streams for which an earlier one had no time.
  /// @return whether there were some
  [[nodiscard]] bool serve_backlog(Lead&) noexcept;
  /// Serves some calls that have ended or have items.
  /// @return whether there were some
  [[nodiscard]] bool serve_ready(Lead&) noexcept;
  /// Sends a call's items or reply, and ends it if its method did.
  void serve(Lead&, PendingCall& call) noexcept;
  /// A frame was taken, which may have cancelled calls or freed buffers. `credit_tag`: the stream
  /// for which it brought credit, or 0.
  void on_frame(Lead&, std::uint32_t credit_tag) noexcept;
  /// Calls that were cancelled, or whose sessions ended: their methods may stop.
  void take_cancelled(Lead&, CallEnding why) noexcept;
  /// Does what is due at `now`.
  void on_time(Lead&, MonotonicTime now) noexcept;
  [[nodiscard]] MonotonicTime next_time() const noexcept;

  /// The lane ends: ends all calls, and closes all sessions (hp-4.5-2).
  void end(Lead&) noexcept;
  /// Takes in a connection that has arrived, in place of a silent one if need be, or refuses it.
  void admit(Lead&, std::unique_ptr<transport::Connection> stream) noexcept;
  /// Sends a frame that no request at hand asked for, and what belongs behind it.
  void send(Lead&, wire::ServerSessions& sessions, const wire::PeerAddress& peer,
            ConstBytes frame) noexcept;
  /// Ends a connection and the calls of its session.
  void retire(Lead&, Slot& slot) noexcept;
  /// Publishes the lane's counts since the last time.
  void publish(Lead&) noexcept;

 private:
  void serve_local(PendingCall& call) noexcept;
  [[nodiscard]] MutableBytes copy_unlocked(PendingCall& call, MonotonicTime now) noexcept;
  [[nodiscard]] bool must_wait_for_buffer(PendingCall& call, MonotonicTime now) noexcept;
  void serve_waiting_replies(Lead&) noexcept;
  [[nodiscard]] bool send_items(Lead&, PendingCall& call) noexcept;
  [[nodiscard]] bool send_item_frame(Lead&, PendingCall& call, std::uint32_t number,
                                     Slot* slot) noexcept;
  void retry_blocked(Lead&, MonotonicTime now) noexcept;

  std::shared_ptr<PendingPool> pool_;
  Media& media_;
  LaneReport& report_;
  Doorbell& doorbell_;
  LaneTap& tap_;
  transport::WaitLock* lock_ = nullptr;  ///< Null if the lane has one thread.
  /// Streams with items for which a turn had no time left, the one that waits longest first. Sized
  /// once.
  std::vector<PendingCall*> backlog_;
  std::size_t item_bytes_left_ = 0;           ///< Bytes of items that this turn may still send.
  MonotonicTime retry_time_ = kNever;         ///< When streams that are blocked are tried again.
  std::uint32_t waiting_reply_count_ = 0;     ///< Large ones for which there is no buffer yet.
  MonotonicTime waiting_reply_due_ = kNever;  ///< No buffer is freed before, unless by a frame.
};

}  // namespace rtpm::rpc
