#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <utility>

#include "rtpm/rpc/async.hpp"
#include "rtpm/rpc/deferred.hpp"
#include "rtpm/rpc/tables.hpp"

/// The parts of generated code for calls that are begun and end later, and for methods that answer
/// later, with a stream, or not at all.
namespace rtpm::rpc {

/// No `rtpm_max_size` in the schema.
inline constexpr std::uint32_t kAnySize = std::numeric_limits<std::uint32_t>::max();

/// Sends an encoded request without waiting for more than `delivery` says.
[[nodiscard]] inline expected<void, CallError> send_oneway(Binding& binding,
                                                           const MethodDescriptor& method,
                                                           ConstBytes request,
                                                           wire::Delivery delivery,
                                                           const CallOptions& options) noexcept {
  return binding.send(method, request, delivery, options);
}

/// A call that was begun, whatever its reply is. See PendingReply for ownership and threads.
class Pending {
 public:
  /// Whether take() would return at once; polls once.
  /// @realtime alloc-free, at most two syscalls
  [[nodiscard]] bool is_done() noexcept { return reply_.is_done(); }
  /// Waits for the end, but not beyond `until`; true if the call has ended.
  /// @realtime alloc-free
  [[nodiscard]] bool wait(MonotonicTime until) noexcept { return reply_.wait(until); }
  /// Ends the call: its caller no longer waits; it may have run.
  /// @realtime alloc-free
  void cancel() noexcept { reply_.cancel(); }

 protected:
  explicit Pending(PendingReply reply) noexcept : reply_(std::move(reply)) {}
  PendingReply reply_;
};

/// A call that was begun and gives nothing back.
class PendingNothing : public Pending {
 public:
  using Result = expected<void, CallError>;
  explicit PendingNothing(PendingReply reply) noexcept : Pending(std::move(reply)) {}
  /// Waits for the end, once.
  /// @realtime alloc-free
  /// @errors   as CallError says
  [[nodiscard]] Result take() noexcept { return read_nothing(reply_.take()); }
};

/// A call that was begun and gives a T back.
template <class T>
class PendingStruct : public Pending {
 public:
  using Result = expected<T, CallError>;
  explicit PendingStruct(PendingReply reply) noexcept : Pending(std::move(reply)) {}
  /// Waits for the end and gives the reply, once.
  /// @realtime alloc-free
  /// @errors   as CallError says
  [[nodiscard]] Result take() noexcept { return read_struct<T>(reply_.take()); }
};

/// A call that was begun and gives a table T back.
template <class T>
class PendingTable : public Pending {
 public:
  using Result = expected<TableReply<T>, CallError>;
  PendingTable(PendingReply reply, TableLimits limits) noexcept
      : Pending(std::move(reply)), limits_(limits) {}
  /// Waits for the end and gives the reply, once.
  /// @realtime alloc-free
  /// @errors   as CallError says
  [[nodiscard]] Result take() noexcept { return read_table<T>(reply_.take(), limits_); }

 private:
  TableLimits limits_;
};

/// Begins a call with an encoded request; `Handle` is made of its pending reply and `more`.
template <class Handle, class... More>
[[nodiscard]] expected<Handle, CallError> begin_call(Binding& binding,
                                                     const MethodDescriptor& method,
                                                     ConstBytes request, const CallOptions& options,
                                                     More... more) {
  auto reply = binding.begin(method, request, options);
  if (!reply) return unexpected{reply.error()};
  return Handle{std::move(*reply), more...};
}

/// A stream that was opened, whatever its items are. See ItemReader for ownership and threads.
class OpenStream {
 public:
  [[nodiscard]] bool is_open() const noexcept { return reader_.is_open(); }
  /// Ends the stream; the server is told.
  /// @realtime alloc-free
  void cancel() noexcept { reader_.cancel(); }

 protected:
  explicit OpenStream(ItemReader reader) noexcept : reader_(std::move(reader)) {}
  ItemReader reader_;
};

/// The items of a stream, each a T.
template <class T>
class StructStream : public OpenStream {
 public:
  explicit StructStream(ItemReader reader) noexcept : OpenStream(std::move(reader)) {}

  /// The next item, waiting until `until` at most; nullopt once the stream has ended in order.
  /// @realtime alloc-free
  /// @errors   kTimeout: none came in time; kBadReply: not a T; other errors: the stream ended
  [[nodiscard]] expected<std::optional<T>, CallError> next(MonotonicTime until) noexcept {
    const auto item = reader_.next(until);
    if (!item) return unexpected{item.error()};
    if (!*item) return std::optional<T>{};
    if ((*item)->size() != sizeof(T)) return unexpected{CallError::kBadReply};
    T value;
    std::memcpy(&value, (*item)->data(), sizeof value);
    return std::optional<T>{value};
  }
};

/// The items of a stream, each a table T.
template <class T>
class TableStream : public OpenStream {
 public:
  TableStream(ItemReader reader, TableLimits limits) noexcept
      : OpenStream(std::move(reader)), limits_(limits) {}

  /// The next item, valid until the next call; null once the stream has ended in order. Errors
  /// and RT class as StructStream::next().
  [[nodiscard]] expected<const T*, CallError> next(MonotonicTime until) noexcept {
    const auto item = reader_.next(until);
    if (!item) return unexpected{item.error()};
    if (!*item) return static_cast<const T*>(nullptr);
    if (!is_valid_table<T>(**item, limits_)) return unexpected{CallError::kBadReply};
    return flatbuffers::GetRoot<T>((*item)->data());
  }

 private:
  TableLimits limits_;
};

/// Opens a stream with an encoded request; `Stream` is made of its reader and `more`.
template <class Stream, class... More>
[[nodiscard]] expected<Stream, CallError> open_stream_of(Binding& binding,
                                                         const MethodDescriptor& method,
                                                         ConstBytes request,
                                                         const StreamOptions& options,
                                                         More... more) {
  auto reader = binding.open_stream(method, request, options);
  if (!reader) return unexpected{reader.error()};
  return Stream{std::move(*reader), more...};
}

/// The common part of all handles for an answer that comes later; Call is one of UnfinishedCall's
/// kinds.
/// @ownership move-only; a call that was not ended ends as failed
/// @threads  one at a time, any
template <class Call>
class DeferredAnswer {
 public:
  /// Ends the call without an answer.
  /// @realtime alloc-free, at most one syscall
  void fail(Refusal refusal) noexcept { end(to_status(refusal)); }
  /// False once the caller has cancelled, gone, or been told that the server stops.
  /// @realtime alloc-free
  [[nodiscard]] bool is_awaited() const noexcept { return call_.is_awaited(); }
  [[nodiscard]] CallEnding ending() const noexcept { return call_.ending(); }
  /// The time after which the caller no longer waits.
  /// @realtime alloc-free
  [[nodiscard]] MonotonicTime deadline() const noexcept { return call_.deadline(); }
  /// False once it was ended, or moved away.
  [[nodiscard]] explicit operator bool() const noexcept { return static_cast<bool>(call_); }

 protected:
  DeferredAnswer() noexcept = default;
  explicit DeferredAnswer(Call call) noexcept : call_(std::move(call)) {}
  void end(wire::Status status) noexcept {
    if constexpr (requires { call_.finish(status); }) {
      call_.finish(status);
    } else {
      call_.complete(status);
    }
  }
  Call call_;
};

/// Writes the items of a stream, whatever they are.
class StreamWriter : public DeferredAnswer<ItemWriter> {
 public:
  /// Ends the stream behind the items written so far.
  /// @realtime alloc-free, at most one syscall
  void finish() noexcept { call_.finish(); }
  /// The most bytes of an item: the smaller message_size_max of caller and server.
  [[nodiscard]] std::uint32_t item_size_max() const noexcept { return call_.item_size_max(); }
  /// The most bytes of an item that fits one frame of the caller's transport.
  [[nodiscard]] std::uint32_t item_frame_size_max() const noexcept {
    return call_.item_frame_size_max();
  }
  /// How many items wait for their caller to take more.
  [[nodiscard]] std::uint32_t waiting_count() const noexcept { return call_.waiting_count(); }

 protected:
  using DeferredAnswer::DeferredAnswer;
};

/// Writes the items of a stream, each a T.
template <class T>
class StructWriter : public StreamWriter {
 public:
  StructWriter() noexcept = default;
  explicit StructWriter(ItemWriter writer) noexcept : StreamWriter(std::move(writer)) {}

  /// @realtime alloc-free, at most one syscall
  /// @errors   as StreamError says
  [[nodiscard]] expected<void, StreamError> write(const T& item) noexcept {
    return call_.write(struct_bytes(item));
  }
};

/// Writes the items of a stream, each a finished FlatBuffer with a T as its root.
template <class T>
class TableWriter : public StreamWriter {
 public:
  TableWriter() noexcept = default;
  explicit TableWriter(ItemWriter writer, std::uint32_t size_max = kAnySize) noexcept
      : StreamWriter(std::move(writer)), size_max_(size_max) {}

  /// @realtime alloc-free, at most one syscall
  /// @errors   as StreamError says; kTooLarge also above the schema's `rtpm_max_size`
  [[nodiscard]] expected<void, StreamError> write(
      const flatbuffers::FlatBufferBuilder& finished) noexcept {
    return call_.write(table_bytes(finished), size_max_);
  }

 private:
  std::uint32_t size_max_ = kAnySize;
};

/// A reply without content that comes later.
class DeferredNothing : public DeferredAnswer<DeferredReply> {
 public:
  DeferredNothing() noexcept = default;
  explicit DeferredNothing(DeferredReply reply) noexcept : DeferredAnswer(std::move(reply)) {}
  /// Ends the call, once.
  /// @realtime alloc-free, at most one syscall
  void complete(const Result<void>& result = {}) noexcept {
    end(reply_with_nothing(result).status);
  }
};

/// A reply, a T, that comes later.
template <class T>
class DeferredStruct : public DeferredAnswer<DeferredReply> {
 public:
  DeferredStruct() noexcept = default;
  explicit DeferredStruct(DeferredReply reply) noexcept : DeferredAnswer(std::move(reply)) {}
  /// Ends the call, once.
  /// @realtime alloc-free, at most one syscall
  void complete(const Result<T>& result) noexcept {
    const DispatchResult done = reply_with_struct(result, call_.buffer());
    call_.complete(done.status, done.reply_size);
  }
};

/// A reply, a table T, that comes later.
template <class T>
class DeferredTable : public DeferredAnswer<DeferredReply> {
 public:
  DeferredTable() noexcept = default;
  explicit DeferredTable(DeferredReply reply, std::uint32_t size_max = kAnySize) noexcept
      : DeferredAnswer(std::move(reply)), size_max_(size_max) {}
  /// A builder for the answer, in the memory that it is sent from; pass it to complete(). An answer
  /// larger than the session or the schema's `rtpm_max_size` allows ends as kTooLarge.
  [[nodiscard]] ReplyBuilder<T> builder() noexcept {
    return ReplyBuilder<T>{at_most(call_.buffer(), size_max_)};
  }
  /// Ends the call, once.
  /// @realtime alloc-free, at most one syscall
  void complete(ReplyBuilder<T>& builder) noexcept {
    const DispatchResult done = builder.complete();
    call_.complete(done.status, done.reply_size);
  }

 private:
  std::uint32_t size_max_ = kAnySize;
};

/// Runs `method` with a handle of type Deferred for its answer, made of `handle` and `more`;
/// answers overload if there is no handle left.
template <class Deferred, class Handle, class Method, class... More>
[[nodiscard]] DispatchResult run_deferred(Handle handle, Method method, More... more) {
  if (!handle) return {wire::Status::kOverload, 0};
  method(Deferred{std::move(handle), more...});
  return {};
}

/// Returns a handle for a later answer. If it is empty, answer with overload.
[[nodiscard]] inline DeferredReply defer(const CallContext& context) noexcept {
  return context.deferral == nullptr ? DeferredReply{} : context.deferral->defer();
}
/// Returns a handle for a stream of answers. If it is empty, answer with overload.
[[nodiscard]] inline ItemWriter open_stream(const CallContext& context) noexcept {
  return context.deferral == nullptr ? ItemWriter{} : context.deferral->stream();
}

}  // namespace rtpm::rpc
