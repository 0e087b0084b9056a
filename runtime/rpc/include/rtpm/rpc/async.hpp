#pragma once

#include <cstdint>
#include <memory>
#include <optional>

#include "rtpm/base/bytes.hpp"
#include "rtpm/base/expected.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/rpc/error.hpp"

namespace rtpm::rpc {

class ReplyLease;

/// When a call or stream must be polled again, for a caller that waits by itself.
struct Readiness {
  bool is_ready = true;  ///< It has ended: take its result.
  /// Becomes readable when a frame arrives; negative if one is already there: poll again at once.
  int descriptor = -1;
  MonotonicTime due{};  ///< When to poll at the latest: to resend a lost frame, or to time out.
};

/// A call in flight whose reply is collected later. No thread works for it: lost frames are resent,
/// and the reply is received, only while the caller polls or waits. The call occupies a call
/// channel until it ends.
/// @ownership move-only; refers to its binding, which must outlive it. Destruction cancels the call
/// @threads  one at a time
/// @realtime alloc-free
class PendingReply {
 public:
  using Result = expected<ReplyLease, CallError>;

  PendingReply() noexcept;
  PendingReply(PendingReply&& other) noexcept;
  PendingReply& operator=(PendingReply&& other) noexcept;
  ~PendingReply();

  /// Whether take() would return at once. Polls once and resends lost frames, so call it regularly.
  /// @realtime at most two syscalls
  [[nodiscard]] bool is_done() noexcept;
  /// Polls like is_done(), and returns what to wait for before the next poll. Completions does so.
  /// @realtime at most three syscalls and one per received frame
  [[nodiscard]] Readiness readiness() noexcept;
  /// Waits until the call ends, at most until `until`. True if the call has ended.
  [[nodiscard]] bool wait(MonotonicTime until) noexcept;
  /// Waits for the reply and returns it, once.
  /// @errors   see CallError
  [[nodiscard]] Result take() noexcept;
  /// Cancels the call and notifies the server once. The call may have run, or may still run: a lane
  /// with one thread and no buffer receives nothing while it runs a call, so a waiting call runs
  /// before its cancellation is read. A lane that receives while it runs calls
  /// (LaneConfig::static_threads, buffered_request_max) skips a cancelled call. No lane starts a
  /// call after CallOptions::deadline. Does nothing if the call has ended.
  void cancel() noexcept;

 private:
  friend class Binding;
  struct State;
  explicit PendingReply(std::unique_ptr<State> state) noexcept;
  std::unique_ptr<State> state_;
};

/// The items that answer a call, read one at a time. No thread works for it, as with PendingReply.
/// While the reader does not call next(), the server waits, at most StreamOptions::pause_max
/// (spec/hprotocol.md#hp-5.10-7). Items may be as large as messages. Buffers for items in flight
/// take a few frames (43 KiB over UDP, 256 KiB over TCP, 64 KiB through shared memory); an item
/// larger than a frame also takes a buffer of its size, at most NodeConfig::message_size_max.
/// @ownership move-only; refers to its binding, which must outlive it. Destruction cancels the call
/// @threads  one at a time
/// @realtime alloc-free
class ItemReader {
 public:
  ItemReader() noexcept;
  ItemReader(ItemReader&& other) noexcept;
  ItemReader& operator=(ItemReader&& other) noexcept;
  ~ItemReader();

  /// Returns the next item, waiting at most until `until`. It is aligned to 16 bytes and valid
  /// until the next call. nullopt if the server finished the stream.
  /// @errors   kTimeout: none arrived in time; is_open() tells whether more may follow ·
  ///           kStreamLost: the reader paused for too long · kTooLarge: an item exceeded the limit
  ///           of caller or server · other errors ended the stream
  [[nodiscard]] expected<std::optional<ConstBytes>, CallError> next(MonotonicTime until) noexcept;
  [[nodiscard]] bool is_open() const noexcept;
  /// After next() returned kTimeout: what to wait for before the next call of it.
  /// @realtime no syscall
  [[nodiscard]] Readiness readiness() noexcept;
  /// Cancels the stream and notifies the server.
  void cancel() noexcept;

 private:
  friend class Binding;
  struct State;
  explicit ItemReader(std::unique_ptr<State> state) noexcept;
  std::unique_ptr<State> state_;
};

}  // namespace rtpm::rpc
