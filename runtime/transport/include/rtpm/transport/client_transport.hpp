#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "rtpm/base/bytes.hpp"
#include "rtpm/base/priority.hpp"
#include "rtpm/base/setup_error.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/transport/datagram_batch.hpp"
#include "rtpm/transport/error.hpp"
#include "rtpm/wire/server_sessions.hpp"

namespace rtpm::transport {

/// The client's end of a path to one server: frames go out and come in. Every transport implements
/// it and passes the same conformance suite.
/// Threads: one at a time.
class ClientTransport {
 public:
  ClientTransport() = default;
  ClientTransport(const ClientTransport&) = delete;
  ClientTransport& operator=(const ClientTransport&) = delete;
  virtual ~ClientTransport() = default;

  /// Sends one whole frame. Ownership: `frame` is copied before return.
  /// RT: alloc-free, one syscall (a stream: per 32 KiB); a stream whose buffer is full waits up to
  /// 100 ms for room.
  [[nodiscard]] virtual expected<void, IoError> send(ConstBytes frame) noexcept = 0;
  /// The same of several frames; together where the transport can. Some may have gone where it
  /// gives an error.   RT: alloc-free, one syscall where they go together, else as send() of each.
  [[nodiscard]] virtual expected<void, IoError> send_batch(const DatagramBatch& batch) noexcept;
  /// From here on, frames that a peer sends together may be received together.   Set-up only.
  virtual void accept_batches() noexcept {}

  /// One whole frame if one is there. It is aligned to 16 bytes and valid until the next receive().
  /// What a peer sent that is no frame is given as it is, for the protocol to count.
  /// RT: alloc-free, at most one syscall (a stream: per 32 KiB), never blocks.
  [[nodiscard]] virtual expected<ConstBytes, IoError> receive() noexcept = 0;
  /// Whether receive() has a frame that came together with an earlier one.   RT: no syscall.
  [[nodiscard]] virtual bool has_buffered() const noexcept { return false; }

  /// Waits, after receive() had nothing, until it may have something, or until `until`; it may end
  /// before. Frames that came together end one wait only.   RT: alloc-free, at most two syscalls.
  virtual void wait(MonotonicTime until) noexcept;
  /// The next frame, for which it waits as wait() does if none is there; which waits for no frame
  /// that came together with an earlier one.   RT: alloc-free, one syscall where the transport can,
  /// else three.
  [[nodiscard]] virtual expected<ConstBytes, IoError> await(MonotonicTime until) noexcept;
  /// The socket. Of one through memory it tells only that the server is gone.
  [[nodiscard]] virtual int descriptor() const noexcept = 0;
  [[nodiscard]] virtual wire::Medium medium() const noexcept = 0;
  /// How many sent frames the server has not taken yet, which only memory shared with it tells;
  /// nothing elsewhere. It outlasts the server's end.   RT: alloc-free, no syscall.
  [[nodiscard]] virtual std::optional<std::uint32_t> unread_count() const noexcept { return {}; }
  /// Asks the system whether the server hung up, where receive() alone would not notice at once;
  /// then receive() says so.   RT: alloc-free, at most one syscall.
  virtual void check_peer() noexcept {}
  /// Whether no frame leaves this host, so that none is lost but where an end has no room for it.
  [[nodiscard]] virtual bool is_on_host() const noexcept { return false; }
};

/// Opens a transport to host:port over UDP. Nothing is sent yet.   Set-up only.
/// Errors: an unknown host, no descriptor left.
[[nodiscard]] expected<std::unique_ptr<ClientTransport>, SetupError> open_udp_transport(
    const std::string& host, std::uint16_t port, Priority priority);

/// Connects to host:port over TCP by `deadline`, for messages of up to `message_size_max` bytes.
/// Set-up only.   Errors: an unknown host, nobody there, no answer in time, no descriptor left.
[[nodiscard]] expected<std::unique_ptr<ClientTransport>, SetupError> open_tcp_transport(
    const std::string& host, std::uint16_t port, Priority priority, std::uint32_t message_size_max,
    MonotonicTime deadline);

}  // namespace rtpm::transport
