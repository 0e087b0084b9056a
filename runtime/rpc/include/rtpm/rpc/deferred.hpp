#pragma once

#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <string_view>
#include <utility>

#include "rtpm/base/bytes.hpp"
#include "rtpm/base/expected.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/wire/status.hpp"

namespace rtpm::rpc {

class PendingPool;
struct PendingCall;

/// Why an item was refused.
enum class StreamError : std::uint8_t {
  kFull,   ///< The caller does not keep up. Try later, or skip this item.
  kEnded,  ///< The caller takes no more items. Finish the stream.
  /// The item exceeds item_size_max(). Skip it or send it in parts. A stream that fails because of
  /// it ends with CallError::kTooLarge.
  kTooLarge,
};

/// "full", "ended" or "too large".
[[nodiscard]] std::string_view to_string(StreamError error) noexcept;

/// Why the caller of a call no longer waits.
enum class CallEnding : std::uint8_t {
  kNone,      ///< The caller still waits.
  kLeft,      ///< The caller cancelled, or its session or connection ended.
  kSilent,    ///< The caller of a stream missed too many keep-alives.
  kStopping,  ///< The server stops.
};

/// The common part of DeferredReply and ItemWriter.
class UnfinishedCall {
 public:
  UnfinishedCall() noexcept = default;
  UnfinishedCall(UnfinishedCall&& other) noexcept { *this = std::move(other); }
  UnfinishedCall& operator=(UnfinishedCall&& other) noexcept;
  /// Ends an unfinished call as failed, so that its caller does not wait needlessly.
  ~UnfinishedCall();

  /// False once the call was ended, or moved from.
  [[nodiscard]] explicit operator bool() const noexcept { return call_ != nullptr; }
  /// False once the caller has cancelled, disconnected, or been told that the server stops. Further
  /// work for the call is wasted.
  /// @threads  any
  /// @realtime alloc-free
  [[nodiscard]] bool is_awaited() const noexcept;
  /// Why the call is no longer awaited.
  /// @threads  any
  /// @realtime alloc-free
  [[nodiscard]] CallEnding ending() const noexcept;
  /// When the caller stops waiting. For a stream: when it had to start.
  [[nodiscard]] MonotonicTime deadline() const noexcept;

 protected:
  friend class Deferral;
  UnfinishedCall(std::shared_ptr<PendingPool> pool, PendingCall* call) noexcept
      : pool_(std::move(pool)), call_(call) {}
  void end(wire::Status status, std::uint32_t size) noexcept;

  std::shared_ptr<PendingPool> pool_;
  PendingCall* call_ = nullptr;
};

/// A call whose method has returned and whose reply is given later, by any thread. The request is
/// invalid once the method returns: copy what you need of it.
/// @ownership move-only; may outlive the server's stop()
/// @threads  one at a time, any
/// @realtime alloc-free; ending takes at most one syscall, to wake the lane
class DeferredReply : public UnfinishedCall {
 public:
  DeferredReply() noexcept = default;
  /// The memory for the reply, aligned to 16 bytes. The first use may page-fault.
  [[nodiscard]] MutableBytes buffer() noexcept;
  /// Ends the call with `size` bytes of the buffer.
  void complete(wire::Status status, std::uint32_t size = 0) noexcept { end(status, size); }

 private:
  friend class Deferral;
  using UnfinishedCall::UnfinishedCall;
};

/// A call that is answered with a stream of items, written by any thread.
/// @ownership move-only; may outlive the server's stop()
/// @threads  one at a time, any
/// @realtime alloc-free, at most one syscall per item, to wake the lane
class ItemWriter : public UnfinishedCall {
 public:
  ItemWriter() noexcept = default;
  /// The maximum size of an item in bytes: the smaller message_size_max of caller and server.
  [[nodiscard]] std::uint32_t item_size_max() const noexcept;
  /// The largest item, in bytes, that fits one frame of the caller's transport: it arrives as a
  /// whole or not at all.
  [[nodiscard]] std::uint32_t item_frame_size_max() const noexcept;
  /// The number of written items that the lane has not sent yet because the caller accepts no more.
  /// To send only the newest item, write only while it is 0.
  [[nodiscard]] std::uint32_t waiting_count() const noexcept;
  /// Queues an item for the caller. The item is copied; the lane sends it as soon as the caller
  /// accepts more. The queue holds 32 items, together at most ServerConfig::stream_byte_max bytes,
  /// or a single larger one.
  /// @errors   see StreamError; the item was not queued. kTooLarge also above `size_max`
  [[nodiscard]] expected<void, StreamError> write(
      ConstBytes item, std::uint32_t size_max = std::numeric_limits<std::uint32_t>::max()) noexcept;
  /// Ends the stream after the items written so far.
  void finish(wire::Status status = wire::Status::kOk) noexcept { end(status, 0); }

 private:
  friend class Deferral;
  using UnfinishedCall::UnfinishedCall;
  [[nodiscard]] std::optional<std::uint32_t> place_for(std::uint32_t size, bool is_empty,
                                                       std::uint32_t first_waiting) const noexcept;
};

/// Lets a method answer later instead of at once. Belongs to the lane; valid during the call.
class Deferral {
 public:
  virtual ~Deferral() = default;
  /// Lets the method return without a result. Returns an empty handle if too many calls are
  /// unfinished (ServerConfig::deferred_call_count_max): answer with overload.
  [[nodiscard]] virtual DeferredReply defer() noexcept = 0;
  /// Lets the method answer with a stream. Returns an empty handle as above, or if the caller wants
  /// no stream.
  [[nodiscard]] virtual ItemWriter stream() noexcept = 0;

 protected:
  [[nodiscard]] static DeferredReply reply_for(std::shared_ptr<PendingPool> pool,
                                               PendingCall* call) noexcept {
    return {std::move(pool), call};
  }
  [[nodiscard]] static ItemWriter writer_for(std::shared_ptr<PendingPool> pool,
                                             PendingCall* call) noexcept {
    return {std::move(pool), call};
  }
};

}  // namespace rtpm::rpc
