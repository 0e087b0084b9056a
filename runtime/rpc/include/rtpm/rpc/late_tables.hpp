#pragma once

#include <optional>
#include <utility>

#include "rtpm/rpc/deferred.hpp"
#include "rtpm/rpc/tables.hpp"

/// What generated code is made of where a method answers later, with a stream, or not at all.
namespace rtpm::rpc {

/// Sends an encoded request without waiting for more than `delivery` says.
[[nodiscard]] inline expected<void, CallError> send_oneway(Binding& binding,
                                                           const MethodDescriptor& method,
                                                           ConstBytes request,
                                                           wire::Delivery delivery,
                                                           const CallOptions& options) noexcept {
  return binding.send(method, request, delivery, options);
}

/// The items of a stream, each a T. See ItemReader for all but the items' type.
template <class T>
class StructStream {
 public:
  explicit StructStream(ItemReader reader) noexcept : reader_(std::move(reader)) {}

  /// The next item, waiting until `until` at most; without one: the stream has ended in order.
  /// Errors: kTimeout: none came in time; kBadReply: an item is none; others: the stream ended.
  /// RT: alloc-free.
  [[nodiscard]] expected<std::optional<T>, CallError> next(MonotonicTime until) noexcept {
    const auto item = reader_.next(until);
    if (!item) return unexpected{item.error()};
    if (!*item) return std::optional<T>{};
    if ((*item)->size() != sizeof(T)) return unexpected{CallError::kBadReply};
    T value;
    std::memcpy(&value, (*item)->data(), sizeof value);
    return std::optional<T>{value};
  }
  [[nodiscard]] bool is_open() const noexcept { return reader_.is_open(); }
  void cancel() noexcept { reader_.cancel(); }

 private:
  ItemReader reader_;
};

/// The items of a stream, each a table T.
template <class T>
class TableStream {
 public:
  TableStream(ItemReader reader, TableLimits limits) noexcept
      : reader_(std::move(reader)), limits_(limits) {}

  /// The next item, valid until the next call; null: the stream has ended in order. Errors and
  /// RT class as StructStream::next().
  [[nodiscard]] expected<const T*, CallError> next(MonotonicTime until) noexcept {
    const auto item = reader_.next(until);
    if (!item) return unexpected{item.error()};
    if (!*item) return static_cast<const T*>(nullptr);
    if (!is_valid_table<T>(**item, limits_)) return unexpected{CallError::kBadReply};
    return flatbuffers::GetRoot<T>((*item)->data());
  }
  [[nodiscard]] bool is_open() const noexcept { return reader_.is_open(); }
  void cancel() noexcept { reader_.cancel(); }

 private:
  ItemReader reader_;
  TableLimits limits_;
};

/// Opens a stream of structs with an encoded request.
template <class T>
[[nodiscard]] expected<StructStream<T>, CallError> open_struct_stream(
    Binding& binding, const MethodDescriptor& method, ConstBytes request,
    const StreamOptions& options) {
  auto reader = binding.open_stream(method, request, options);
  if (!reader) return unexpected{reader.error()};
  return StructStream<T>{std::move(*reader)};
}

/// Opens a stream of tables with an encoded request.
template <class T>
[[nodiscard]] expected<TableStream<T>, CallError> open_table_stream(Binding& binding,
                                                                    const MethodDescriptor& method,
                                                                    ConstBytes request,
                                                                    const StreamOptions& options,
                                                                    TableLimits limits = {}) {
  auto reader = binding.open_stream(method, request, options);
  if (!reader) return unexpected{reader.error()};
  return TableStream<T>{std::move(*reader), limits};
}

/// Writes the items of a stream, each a T. See ItemWriter for all but the items' type.
template <class T>
class StructWriter {
 public:
  StructWriter() noexcept = default;
  explicit StructWriter(ItemWriter writer) noexcept : writer_(std::move(writer)) {}

  /// RT: alloc-free, at most one syscall.   Errors: kFull: the caller does not keep up; kEnded.
  [[nodiscard]] expected<void, StreamError> write(const T& item) noexcept {
    return writer_.write(struct_bytes(item));
  }
  void finish() noexcept { writer_.finish(); }
  void fail(Refusal refusal) noexcept { writer_.finish(to_status(refusal)); }
  [[nodiscard]] bool is_awaited() const noexcept { return writer_.is_awaited(); }
  [[nodiscard]] explicit operator bool() const noexcept { return static_cast<bool>(writer_); }

 private:
  ItemWriter writer_;
};

/// Writes the items of a stream, each a finished FlatBuffer with a T as its root.
template <class T>
class TableWriter {
 public:
  TableWriter() noexcept = default;
  explicit TableWriter(ItemWriter writer) noexcept : writer_(std::move(writer)) {}

  /// RT: alloc-free, at most one syscall.   Errors: as StreamError says.
  [[nodiscard]] expected<void, StreamError> write(
      const flatbuffers::FlatBufferBuilder& finished) noexcept {
    return writer_.write(table_bytes(finished));
  }
  void finish() noexcept { writer_.finish(); }
  void fail(Refusal refusal) noexcept { writer_.finish(to_status(refusal)); }
  [[nodiscard]] bool is_awaited() const noexcept { return writer_.is_awaited(); }
  [[nodiscard]] explicit operator bool() const noexcept { return static_cast<bool>(writer_); }

 private:
  ItemWriter writer_;
};

/// A reply without content that comes later.
class LateNothing {
 public:
  LateNothing() noexcept = default;
  explicit LateNothing(DeferredReply reply) noexcept : reply_(std::move(reply)) {}
  /// Ends the call, once.   RT: alloc-free, at most one syscall.
  void complete(const Result<void>& result = {}) noexcept {
    reply_.complete(reply_with_nothing(result).status);
  }
  [[nodiscard]] bool is_awaited() const noexcept { return reply_.is_awaited(); }
  [[nodiscard]] explicit operator bool() const noexcept { return static_cast<bool>(reply_); }

 private:
  DeferredReply reply_;
};

/// A reply, a T, that comes later.
template <class T>
class LateStruct {
 public:
  LateStruct() noexcept = default;
  explicit LateStruct(DeferredReply reply) noexcept : reply_(std::move(reply)) {}
  /// Ends the call, once.   RT: alloc-free, at most one syscall.
  void complete(const Result<T>& result) noexcept {
    const DispatchResult end = reply_with_struct(result, reply_.buffer());
    reply_.complete(end.status, end.reply_size);
  }
  [[nodiscard]] bool is_awaited() const noexcept { return reply_.is_awaited(); }
  [[nodiscard]] explicit operator bool() const noexcept { return static_cast<bool>(reply_); }

 private:
  DeferredReply reply_;
};

/// A reply, a table T, that comes later.
template <class T>
class LateTable {
 public:
  LateTable() noexcept = default;
  explicit LateTable(DeferredReply reply) noexcept : reply_(std::move(reply)) {}
  /// To build the answer in, in the memory that it is sent from; then complete() with it.
  [[nodiscard]] ReplyBuilder<T> builder() noexcept { return ReplyBuilder<T>{reply_.buffer()}; }
  /// Ends the call, once.   RT: alloc-free, at most one syscall.
  void complete(ReplyBuilder<T>& builder) noexcept {
    const DispatchResult end = builder.complete();
    reply_.complete(end.status, end.reply_size);
  }
  void fail(Refusal refusal) noexcept { reply_.complete(to_status(refusal)); }
  [[nodiscard]] bool is_awaited() const noexcept { return reply_.is_awaited(); }
  [[nodiscard]] explicit operator bool() const noexcept { return static_cast<bool>(reply_); }

 private:
  DeferredReply reply_;
};

/// Has `method` run with a handle of type Late for its answer; overload if there is none left.
template <class Late, class Handle, class Method>
[[nodiscard]] DispatchResult run_late(Handle handle, Method method) {
  if (!handle) return {wire::Status::kOverload, 0};
  method(Late{std::move(handle)});
  return {};
}

/// A handle to answer later, or none: then answer overload.
[[nodiscard]] inline DeferredReply defer(const CallContext& context) noexcept {
  return context.deferral == nullptr ? DeferredReply{} : context.deferral->defer();
}
/// A handle to answer with a stream, or none: then answer overload.
[[nodiscard]] inline ItemWriter open_stream(const CallContext& context) noexcept {
  return context.deferral == nullptr ? ItemWriter{} : context.deferral->stream();
}

}  // namespace rtpm::rpc
