#pragma once

#include "rtpm/base/bytes.hpp"
#include "rtpm/base/expected.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/transport/error.hpp"
#include "rtpm/transport/socket.hpp"

namespace rtpm::transport {

/// A server lane's end of one client's connection: whole frames in both directions, in order,
/// without loss. Polls report incoming frames, except where noted.
/// @threads  one at a time
/// @realtime alloc-free
class Connection {
 public:
  Connection() = default;
  Connection(const Connection&) = delete;
  Connection& operator=(const Connection&) = delete;
  virtual ~Connection() = default;

  /// Sends one whole frame; while the buffer is full, waits until `until`.
  [[nodiscard]] virtual expected<void, IoError> send(ConstBytes frame,
                                                     MonotonicTime until) noexcept = 0;
  /// Whether the buffer is empty, or a frame of `size` bytes that may wait leaves a reserve for
  /// frames that may not, such as replies. Shared memory keeps half of the ring free; TCP limits
  /// the bytes that are unsent or unacknowledged.
  /// @realtime at most one system call
  [[nodiscard]] virtual bool has_spare_capacity(std::size_t size) noexcept = 0;
  /// Returns one whole frame, if it has arrived; aligned to 16 bytes, valid until the next
  /// receive(). The caller may modify it. Never blocks.
  [[nodiscard]] virtual expected<MutableBytes, IoError> receive() noexcept = 0;
  /// Whether there is a whole frame that no poll would report.
  [[nodiscard]] virtual bool has_buffered() const noexcept = 0;
  /// The client; see host_of().
  /// @realtime at most two system calls
  [[nodiscard]] virtual wire::PeerAddress host() const noexcept { return host_of(descriptor()); }
  /// The descriptor to poll for reading.
  [[nodiscard]] virtual int descriptor() const noexcept = 0;

  /// Whether frames arrive through shared memory: cheap to check, and reported by a poll only after
  /// announce_sleep().
  [[nodiscard]] virtual bool is_memory() const noexcept { return false; }
  /// A second descriptor that reports frames, by Trigger::kEdge and without on_ready(); negative if
  /// there is none.
  [[nodiscard]] virtual int event() const noexcept { return -1; }
  /// Call it when a poll has reported the descriptor.
  /// @realtime at most one system call
  virtual void on_ready() noexcept {}
  /// Makes polls report frames until end_sleep().
  /// @return false if a frame is already there
  [[nodiscard]] virtual bool announce_sleep() noexcept { return !has_buffered(); }
  virtual void end_sleep() noexcept {}
};

}  // namespace rtpm::transport
