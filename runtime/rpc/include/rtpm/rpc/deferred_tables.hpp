#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <utility>

#include "rtpm/rpc/async.hpp"
#include "rtpm/rpc/deferred.hpp"
#include "rtpm/rpc/tables.hpp"

/// Support for generated code: asynchronous calls, oneways, and methods that reply later or with a
/// stream.
namespace rtpm::rpc {

/// The size limit if the schema gives no `rtpm_max_size`.
inline constexpr std::uint32_t kAnySize = std::numeric_limits<std::uint32_t>::max();

/// Sends an encoded request and waits only as `delivery` says.
[[nodiscard]] inline expected<void, CallError> send_oneway(Binding& binding,
                                                           const MethodDescriptor& method,
                                                           ConstBytes request,
                                                           wire::Delivery delivery,
                                                           const CallOptions& options) noexcept {
  return binding.send(method, request, delivery, options);
}

/// An asynchronous call with any kind of reply. See PendingReply for ownership and threads.
class Pending {
 public:
  /// Whether take() would return at once; polls once.
  /// @realtime alloc-free, at most two syscalls
  [[nodiscard]] bool is_done() noexcept { return reply_.is_done(); }
  /// See PendingReply::readiness().
  [[nodiscard]] Readiness readiness() noexcept { return reply_.readiness(); }
  /// Waits until the call ends, at most until `until`. True if the call has ended.
  /// @realtime alloc-free
  [[nodiscard]] bool wait(MonotonicTime until) noexcept { return reply_.wait(until); }
  /// Cancels the call; it may have run.
  /// @realtime alloc-free
  void cancel() noexcept { reply_.cancel(); }

 protected:
  explicit Pending(PendingReply reply) noexcept : reply_(std::move(reply)) {}
  PendingReply reply_;
};

/// An asynchronous call that returns nothing.
class PendingNothing : public Pending {
 public:
  using Result = expected<void, CallError>;
  explicit PendingNothing(PendingReply reply) noexcept : Pending(std::move(reply)) {}
  /// Waits for the result and returns it, once.
  /// @realtime alloc-free
  /// @errors   see CallError
  [[nodiscard]] Result take() noexcept { return read_nothing(reply_.take()); }
};

/// An asynchronous call that returns a T.
template <class T>
class PendingStruct : public Pending {
 public:
  using Result = expected<T, CallError>;
  explicit PendingStruct(PendingReply reply) noexcept : Pending(std::move(reply)) {}
  /// Waits for the reply and returns it, once.
  /// @realtime alloc-free
  /// @errors   see CallError
  [[nodiscard]] Result take() noexcept { return read_struct<T>(reply_.take()); }
};

/// An asynchronous call that returns a table T.
template <class T>
class PendingTable : public Pending {
 public:
  using Result = expected<TableReply<T>, CallError>;
  PendingTable(PendingReply reply, TableLimits limits) noexcept
      : Pending(std::move(reply)), limits_(limits) {}
  /// Waits for the reply and returns it, once.
  /// @realtime alloc-free
  /// @errors   see CallError
  [[nodiscard]] Result take() noexcept { return read_table<T>(reply_.take(), limits_); }

 private:
  TableLimits limits_;
};

/// Starts a call with an encoded request. `Handle` is constructed from the pending reply and
/// `more`.
template <class Handle, class... More>
[[nodiscard]] expected<Handle, CallError> begin_call(Binding& binding,
                                                     const MethodDescriptor& method,
                                                     ConstBytes request, const CallOptions& options,
                                                     More... more) {
  auto reply = binding.begin(method, request, options);
  if (!reply) return unexpected{reply.error()};
  return Handle{std::move(*reply), more...};
}

/// An open stream with any kind of items. See ItemReader for ownership and threads.
class OpenStream {
 public:
  [[nodiscard]] bool is_open() const noexcept { return reader_.is_open(); }
  /// See ItemReader::readiness().
  [[nodiscard]] Readiness readiness() noexcept { return reader_.readiness(); }
  /// Cancels the stream and notifies the server.
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

  /// Returns the next item, waiting at most until `until`; nullopt if the server finished the
  /// stream.
  /// @realtime alloc-free
  /// @errors   kTimeout: none arrived in time · kBadReply: not a T · other errors ended the stream
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

  /// Returns the next item, valid until the next call; null if the server finished the stream.
  /// Errors and real-time class are those of StructStream::next().
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

/// Opens a stream with an encoded request. `Stream` is constructed from the reader and `more`.
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

/// The common part of all handles for a later answer. Call is DeferredReply or ItemWriter.
/// @ownership move-only; destruction ends an unfinished call as failed
/// @threads  one at a time, any
template <class Call>
class DeferredAnswer {
 public:
  /// Ends the call with a refusal.
  /// @realtime alloc-free, at most one syscall
  void fail(Refusal refusal) noexcept { end(to_status(refusal)); }
  /// False once the caller has cancelled, disconnected, or been told that the server stops.
  /// @realtime alloc-free
  [[nodiscard]] bool is_awaited() const noexcept { return call_.is_awaited(); }
  [[nodiscard]] CallEnding ending() const noexcept { return call_.ending(); }
  /// The time at which the caller stops waiting.
  /// @realtime alloc-free
  [[nodiscard]] MonotonicTime deadline() const noexcept { return call_.deadline(); }
  /// False once the call was ended, or moved from.
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

/// Writes the items of a stream of any kind.
class StreamWriter : public DeferredAnswer<ItemWriter> {
 public:
  /// Ends the stream after the items written so far.
  /// @realtime alloc-free, at most one syscall
  void finish() noexcept { call_.finish(); }
  /// The largest item in bytes: the smaller message_size_max of caller and server.
  [[nodiscard]] std::uint32_t item_size_max() const noexcept { return call_.item_size_max(); }
  /// The largest item, in bytes, that fits one frame of the caller's transport.
  [[nodiscard]] std::uint32_t item_frame_size_max() const noexcept {
    return call_.item_frame_size_max();
  }
  /// The number of written items that are not sent yet because the caller accepts no more.
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
  /// @errors   see StreamError
  [[nodiscard]] expected<void, StreamError> write(const T& item) noexcept {
    return call_.write(struct_bytes(item));
  }
};

/// Writes the items of a stream, each a finished FlatBuffer whose root is a T.
template <class T>
class TableWriter : public StreamWriter {
 public:
  TableWriter() noexcept = default;
  explicit TableWriter(ItemWriter writer, std::uint32_t size_max = kAnySize) noexcept
      : StreamWriter(std::move(writer)), size_max_(size_max) {}

  /// @realtime alloc-free, at most one syscall
  /// @errors   see StreamError; kTooLarge also above the schema's `rtpm_max_size`
  [[nodiscard]] expected<void, StreamError> write(
      const flatbuffers::FlatBufferBuilder& finished) noexcept {
    return call_.write(table_bytes(finished), size_max_);
  }

 private:
  std::uint32_t size_max_ = kAnySize;
};

/// A later reply without content.
class DeferredNothing : public DeferredAnswer<DeferredReply> {
 public:
  DeferredNothing() noexcept = default;
  explicit DeferredNothing(DeferredReply reply) noexcept : DeferredAnswer(std::move(reply)) {}
  /// Replies, once.
  /// @realtime alloc-free, at most one syscall
  void complete(const Result<void>& result = {}) noexcept {
    end(reply_with_nothing(result).status);
  }
};

/// A later reply with a T.
template <class T>
class DeferredStruct : public DeferredAnswer<DeferredReply> {
 public:
  DeferredStruct() noexcept = default;
  explicit DeferredStruct(DeferredReply reply) noexcept : DeferredAnswer(std::move(reply)) {}
  /// Replies, once.
  /// @realtime alloc-free, at most one syscall
  void complete(const Result<T>& result) noexcept {
    const DispatchResult done = reply_with_struct(result, call_.buffer());
    call_.complete(done.status, done.reply_size);
  }
};

/// A later reply with a table T.
template <class T>
class DeferredTable : public DeferredAnswer<DeferredReply> {
 public:
  DeferredTable() noexcept = default;
  explicit DeferredTable(DeferredReply reply, std::uint32_t size_max = kAnySize) noexcept
      : DeferredAnswer(std::move(reply)), size_max_(size_max) {}
  /// A builder that writes in the memory that is sent; pass it to complete(). A reply larger than
  /// the session or the schema's `rtpm_max_size` allows ends as kTooLarge.
  [[nodiscard]] ReplyBuilder<T> builder() noexcept {
    return ReplyBuilder<T>{at_most(call_.buffer(), size_max_)};
  }
  /// Replies, once.
  /// @realtime alloc-free, at most one syscall
  void complete(ReplyBuilder<T>& builder) noexcept {
    const DispatchResult done = builder.complete();
    call_.complete(done.status, done.reply_size);
  }

 private:
  std::uint32_t size_max_ = kAnySize;
};

/// Runs `method` with a handle of type Deferred, constructed from `handle` and `more`. Answers with
/// overload if no handle is left.
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
