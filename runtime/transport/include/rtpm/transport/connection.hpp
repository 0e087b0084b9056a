#pragma once

#include "rtpm/base/bytes.hpp"
#include "rtpm/base/expected.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/transport/error.hpp"
#include "rtpm/transport/socket.hpp"

namespace rtpm::transport {

/// One peer's connection as a server's lane has it: whole frames in both directions, in order and
/// without loss. A poll tells when something comes, except where it says otherwise.
/// Threads: one at a time.   RT: alloc-free.
class Connection {
 public:
  Connection() = default;
  Connection(const Connection&) = delete;
  Connection& operator=(const Connection&) = delete;
  virtual ~Connection() = default;

  /// Sends one whole frame; waits for room until `until` if there is none.
  [[nodiscard]] virtual expected<void, IoError> send(ConstBytes frame,
                                                     MonotonicTime until) noexcept = 0;
  /// Whether a frame of so many bytes, which may wait, has room now: frames that may not, such as
  /// replies, find as much again.   RT: alloc-free, at most one syscall.
  [[nodiscard]] virtual bool has_spare_capacity(std::size_t size) noexcept = 0;
  /// One whole frame if it has arrived; valid until the next receive(), aligned to 16
  /// bytes. Never blocks.
  [[nodiscard]] virtual expected<ConstBytes, IoError> receive() noexcept = 0;
  /// Whether there is a whole frame that no poll would tell.
  [[nodiscard]] virtual bool has_buffered() const noexcept = 0;
  /// Whose it is: see host_of().   RT: alloc-free, at most two system calls.
  [[nodiscard]] virtual wire::PeerAddress host() const noexcept { return host_of(descriptor()); }
  /// To be polled for reading.
  [[nodiscard]] virtual int descriptor() const noexcept = 0;

  /// Whether frames come through memory, which is cheap to look at and which no poll tells of
  /// unless announce_sleep() was called before.
  [[nodiscard]] virtual bool is_memory() const noexcept { return false; }
  /// What else wakes: see Trigger::kEdge. Then the frames are there, and on_ready() is not
  /// called. Negative: nothing.
  [[nodiscard]] virtual int event() const noexcept { return -1; }
  /// The poll reported the descriptor.   RT: at most one syscall.
  virtual void on_ready() noexcept {}
  /// From here on until end_sleep() a poll tells of frames; false if there is one already.
  [[nodiscard]] virtual bool announce_sleep() noexcept { return !has_buffered(); }
  virtual void end_sleep() noexcept {}
};

}  // namespace rtpm::transport
