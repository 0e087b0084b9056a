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

/// A call that was begun and whose reply is waited for later. It needs no thread: its
/// holder repeats frames and takes the reply while it asks or waits, on a call channel that belongs
/// to the call until this ends.
/// @ownership move-only; refers to its binding, which must outlive it. Ends by cancelling the call
/// @threads  one at a time
/// @realtime alloc-free
class PendingReply {
 public:
  PendingReply() noexcept;
  PendingReply(PendingReply&& other) noexcept;
  PendingReply& operator=(PendingReply&& other) noexcept;
  ~PendingReply();

  /// Whether take() would return at once; polls once. Call it now and then: it also repeats lost
  /// frames.
  /// @realtime at most two syscalls
  [[nodiscard]] bool is_done() noexcept;
  /// Waits for the end, but not beyond `until`; true if the call has ended.
  [[nodiscard]] bool wait(MonotonicTime until) noexcept;
  /// Waits for the end and gives the reply, once.
  /// @errors   as CallError says
  [[nodiscard]] expected<ReplyLease, CallError> take() noexcept;
  /// Ends the call: the caller no longer waits for it. The server is told, once; the call may have
  /// run, or may still run: a lane with one thread and no buffer receives nothing while it runs a
  /// call, so a call that waits for that one runs before its cancellation is read. A lane that
  /// receives meanwhile (LaneConfig::static_threads, buffered_request_max) no longer begins it; no
  /// lane does after CallOptions::deadline. Does nothing if the call has ended.
  void cancel() noexcept;

 private:
  friend class Binding;
  struct State;
  explicit PendingReply(std::unique_ptr<State> state) noexcept;
  std::unique_ptr<State> state_;
};

/// The items that answer a call, taken one by one. No thread stands behind it, as with
/// PendingReply: while nobody takes, the server waits, for as long as StreamOptions::pause_max says
/// (spec/hprotocol.md#hp-5.10-7). Items may be as large as messages; what is on its way takes
/// memory of some frames (43 KiB over UDP, 256 KiB over TCP, 64 KiB through shared memory), and an
/// item that is larger than a frame once more its size, at most NodeConfig::message_size_max.
/// @ownership move-only; refers to its binding, which must outlive it. Ends by cancelling the call
/// @threads  one at a time
/// @realtime alloc-free
class ItemReader {
 public:
  ItemReader() noexcept;
  ItemReader(ItemReader&& other) noexcept;
  ItemReader& operator=(ItemReader&& other) noexcept;
  ~ItemReader();

  /// The next item in order, waiting until `until` at most. It is aligned to 16 bytes and valid
  /// until the next call. nullopt once the stream has ended in order.
  /// @errors   kTimeout: none came in time, and is_open() tells whether more may; kStreamLost: the
  ///           reader was away for too long; kTooLarge: the servant had an item that is larger than
  ///           caller and server both take; other errors: the stream ended because of them
  [[nodiscard]] expected<std::optional<ConstBytes>, CallError> next(MonotonicTime until) noexcept;
  [[nodiscard]] bool is_open() const noexcept;
  /// Ends the stream; the server is told.
  void cancel() noexcept;

 private:
  friend class Binding;
  struct State;
  explicit ItemReader(std::unique_ptr<State> state) noexcept;
  std::unique_ptr<State> state_;
};

}  // namespace rtpm::rpc
