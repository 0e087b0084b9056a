#pragma once

#include <flatbuffers/flatbuffers.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <type_traits>
#include <utility>

#include "rtpm/base/assert.hpp"
#include "rtpm/rpc/binding.hpp"
#include "rtpm/rpc/servant.hpp"

/// Support for generated code: the one place where RTPM meets FlatBuffers' types.
///
/// A request or reply is of one of three kinds (DESIGN: the payload rule):
///   Empty   `rtpm.Empty`: no bytes;
///   Struct  a table whose only field is a required struct: the bare struct, no verification walk;
///   Table   any other table: a finished FlatBuffer, verified once when it arrives.
namespace rtpm::rpc {

/// A received table; points into the call channel's buffer, which destruction returns. Read what
/// you need, do not keep it.
template <class T>
class TableReply {
 public:
  explicit TableReply(ReplyLease lease) noexcept : lease_(std::move(lease)) {}
  [[nodiscard]] const T& operator*() const noexcept {
    return *flatbuffers::GetRoot<T>(lease_.bytes().data());
  }
  [[nodiscard]] const T* operator->() const noexcept { return &**this; }
  /// The finished FlatBuffer, as received.
  [[nodiscard]] ConstBytes bytes() const noexcept { return lease_.bytes(); }

 private:
  ReplyLease lease_;
};

/// The memory that a builder writes in. A reply that does not fit goes to the heap, so that it ends
/// as kTooLarge instead of a crash.
class LentMemory final : public flatbuffers::Allocator {
 public:
  explicit LentMemory(MutableBytes memory) noexcept : memory_(memory) {}
  std::uint8_t* allocate(std::size_t size) override {
    if (!is_lent_ && size <= memory_.size()) {
      is_lent_ = true;
      return reinterpret_cast<std::uint8_t*>(memory_.data());
    }
    return new std::uint8_t[size];
  }
  void deallocate(std::uint8_t* memory, std::size_t) override {
    if (reinterpret_cast<std::byte*>(memory) == memory_.data()) {
      is_lent_ = false;
    } else {
      delete[] memory;
    }
  }

 private:
  MutableBytes memory_;
  bool is_lent_ = false;
};

/// Builds a reply of table T in the lane's own buffer.
/// @realtime alloc-free while the reply fits that buffer
template <class T>
class ReplyBuilder {
 public:
  explicit ReplyBuilder(MutableBytes memory) noexcept
      : memory_(memory), lent_(memory), builder_(memory.size() & ~std::size_t{15}, &lent_) {}

  /// The builder for strings, vectors and CreateT().
  [[nodiscard]] flatbuffers::FlatBufferBuilder& builder() noexcept { return builder_; }
  /// Completes the reply; call it once, after everything else.
  void finish(flatbuffers::Offset<T> root) {
    builder_.Finish(root);
    is_finished_ = true;
  }

  /// Moves the finished reply to the beginning of the memory. For generated code.
  [[nodiscard]] DispatchResult complete() noexcept {
    if (!is_finished_) return {wire::Status::kServantFailed, 0};
    const std::size_t size = builder_.GetSize();
    if (size > memory_.size()) return {wire::Status::kTooLarge, 0};
    // FlatBuffers writes downwards: the message is at the end of the buffer, and aligned there.
    std::memmove(memory_.data(), builder_.GetBufferPointer(), size);
    return {wire::Status::kOk, static_cast<std::uint32_t>(size)};
  }

 private:
  MutableBytes memory_;
  LentMemory lent_;
  flatbuffers::FlatBufferBuilder builder_;
  bool is_finished_ = false;
};

/// The limits of a table's verification; rtpmc derives them from the schema.
struct TableLimits {
  std::uint32_t depth = 32;  ///< Nesting depth of tables, including the root.
  /// The maximum number of tables. 0 for as many as the message can refer to (4 bytes each): then
  /// the message's size bounds the verification time.
  std::uint32_t tables = 0;
};

/// Whether the bytes are a valid T, so that reading it stays within them (hp-12-4). The message has
/// no size prefix, and a file identifier is not checked (hp-12-5).
template <class T>
[[nodiscard]] bool is_valid_table(ConstBytes bytes, TableLimits limits = {}) noexcept {
  if (bytes.size() < sizeof(flatbuffers::uoffset_t)) return false;
  const std::size_t by_size = bytes.size() / sizeof(flatbuffers::uoffset_t);
  const auto tables =
      limits.tables != 0 ? limits.tables : static_cast<flatbuffers::uoffset_t>(by_size);
  flatbuffers::Verifier verifier(reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size(),
                                 limits.depth, tables);
  return verifier.VerifyBuffer<T>(nullptr);
}

/// Reads a reply without content.
[[nodiscard]] inline expected<void, CallError> read_nothing(
    const expected<ReplyLease, CallError>& reply) noexcept {
  if (!reply) return unexpected{reply.error()};
  if (!reply->bytes().empty()) return unexpected{CallError::kBadReply};
  return {};
}

/// Reads a reply that is a bare struct.
template <class T>
[[nodiscard]] expected<T, CallError> read_struct(
    const expected<ReplyLease, CallError>& reply) noexcept {
  static_assert(std::is_trivially_copyable_v<T>);
  if (!reply) return unexpected{reply.error()};
  if (reply->bytes().size() != sizeof(T)) return unexpected{CallError::kBadReply};
  T value;
  std::memcpy(&value, reply->bytes().data(), sizeof value);
  return value;
}

/// Verifies and reads a reply that is a table.
template <class T>
[[nodiscard]] expected<TableReply<T>, CallError> read_table(expected<ReplyLease, CallError> reply,
                                                            TableLimits limits) noexcept {
  if (!reply) return unexpected{reply.error()};
  if (!is_valid_table<T>(reply->bytes(), limits)) return unexpected{CallError::kBadReply};
  return TableReply<T>{std::move(*reply)};
}

/// Calls with an encoded request and reads a reply without content.
[[nodiscard]] inline expected<void, CallError> call_for_nothing(
    Binding& binding, const MethodDescriptor& method, ConstBytes request,
    const CallOptions& options) noexcept {
  return read_nothing(binding.call(method, request, options));
}

/// Calls with an encoded request and reads a reply that is a bare struct.
template <class T>
[[nodiscard]] expected<T, CallError> call_for_struct(Binding& binding,
                                                     const MethodDescriptor& method,
                                                     ConstBytes request,
                                                     const CallOptions& options) noexcept {
  return read_struct<T>(binding.call(method, request, options));
}

/// Calls with an encoded request and reads a reply that is a table.
template <class T>
[[nodiscard]] expected<TableReply<T>, CallError> call_for_table(Binding& binding,
                                                                const MethodDescriptor& method,
                                                                ConstBytes request,
                                                                const CallOptions& options,
                                                                TableLimits limits = {}) noexcept {
  return read_table<T>(binding.call(method, request, options), limits);
}

/// The wire bytes of a struct.
template <class T>
[[nodiscard]] ConstBytes struct_bytes(const T& value) noexcept {
  static_assert(std::is_trivially_copyable_v<T> && FLATBUFFERS_LITTLEENDIAN);
  return std::as_bytes(std::span<const T, 1>(&value, 1));
}

/// Reads a struct request in place. Its size was checked, and servers align requests to 16 bytes.
template <class T>
[[nodiscard]] const T& view_struct(ConstBytes request) noexcept {
  static_assert(alignof(T) <= 16 && std::is_trivially_copyable_v<T>);
  RTPM_ASSERT(reinterpret_cast<std::uintptr_t>(request.data()) % alignof(T) == 0,
              "a request is not aligned to 16 bytes");
  return *static_cast<const T*>(static_cast<const void*>(request.data()));
}

/// The reply memory, limited to the schema's maximum size.
[[nodiscard]] inline MutableBytes at_most(MutableBytes reply, std::size_t size_max) noexcept {
  return reply.first(std::min(reply.size(), size_max));
}

/// The bytes of a builder's finished table.
[[nodiscard]] inline ConstBytes table_bytes(
    const flatbuffers::FlatBufferBuilder& builder) noexcept {
  return std::as_bytes(std::span(builder.GetBufferPointer(), builder.GetSize()));
}

/// Writes a servant's struct result as the reply.
template <class T>
[[nodiscard]] DispatchResult reply_with_struct(const Result<T>& result,
                                               MutableBytes reply) noexcept {
  if (!result) return {to_status(result.error()), 0};
  if (sizeof(T) > reply.size()) return {wire::Status::kTooLarge, 0};
  std::memcpy(reply.data(), &*result, sizeof(T));
  return {wire::Status::kOk, static_cast<std::uint32_t>(sizeof(T))};
}

/// Replies for a servant's method that returns nothing.
[[nodiscard]] inline DispatchResult reply_with_nothing(const Result<void>& result) noexcept {
  return {result ? wire::Status::kOk : to_status(result.error()), 0};
}

}  // namespace rtpm::rpc
