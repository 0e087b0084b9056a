#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "calls/pending.hpp"
#include "media/media.hpp"
#include "model/report.hpp"
#include "rtpm/base/time.hpp"

namespace rtpm::rpc {

/// The calls of a lane that were not answered on arrival: deferred replies, streams, calls waiting
/// for a thread, large replies waiting for a buffer. Sends their output, ends them in time, and
/// notifies their methods when the caller no longer waits.
/// @threads  the leader
/// @realtime alloc-free except construction
class OpenCalls {
 public:
  OpenCalls(std::shared_ptr<PendingPool> pool, std::uint32_t call_count_max, Media& media,
            LaneReport& report, Doorbell& doorbell, LaneTap& tap);

  [[nodiscard]] const std::shared_ptr<PendingPool>& pool() const noexcept { return pool_; }
  /// Lets large replies be copied without `lock`, which every caller of this class holds.
  void share(transport::WaitLock* lock) noexcept { lock_ = lock; }
  [[nodiscard]] bool has_any() const noexcept { return pool_->open_count() > 0; }

  /// Starts a turn with the streams for which the last turn had no time.
  /// @return whether there were any
  [[nodiscard]] bool serve_backlog(Lead&) noexcept;
  /// Serves some calls that have ended or have items.
  /// @return whether there were any
  [[nodiscard]] bool serve_ready(Lead&) noexcept;
  /// Sends a call's items or reply; ends the call if its method has.
  void serve(Lead&, PendingCall& call) noexcept;
  /// Handles a received frame, which may have cancelled calls or freed buffers. `credit_tag`: the
  /// stream that got credit, or 0.
  void on_frame(Lead&, std::uint32_t credit_tag) noexcept;
  /// Notifies the methods of calls that were cancelled or whose sessions ended.
  void take_cancelled(Lead&, CallEnding why) noexcept;
  /// Runs the timers due at `now`.
  void on_time(Lead&, MonotonicTime now) noexcept;
  [[nodiscard]] MonotonicTime next_time() const noexcept;

  /// Ends all calls and closes all sessions when the lane ends (hp-4.5-2).
  void end(Lead&) noexcept;
  /// Accepts a new connection, evicting a silent one if necessary, or refuses it.
  void admit(Lead&, std::unique_ptr<transport::Connection> stream) noexcept;
  /// Sends an unsolicited frame and the frames that follow it.
  void send(Lead&, wire::ServerSessions& sessions, const wire::PeerAddress& peer,
            ConstBytes frame) noexcept;
  /// Ends a connection and the calls of its session.
  void retire(Lead&, Slot& slot) noexcept;
  /// Publishes the lane's counts since the last call.
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
  /// Streams that still have items after their turn, longest-waiting first. Has a fixed capacity.
  std::vector<PendingCall*> backlog_;
  std::size_t item_bytes_left_ = 0;           ///< Bytes of items that this turn may still send.
  MonotonicTime retry_time_ = kNever;         ///< When blocked streams are retried.
  std::uint32_t waiting_reply_count_ = 0;     ///< Large replies that wait for a buffer.
  MonotonicTime waiting_reply_due_ = kNever;  ///< Until then only a frame can free a buffer.
};

}  // namespace rtpm::rpc
