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

/// A client's end of a path to one server: frames go out and come in. Every implementation passes
/// the same conformance suite.
/// @threads  one at a time
/// @realtime alloc-free, but for set-up
class ClientTransport {
 public:
  ClientTransport() = default;
  ClientTransport(const ClientTransport&) = delete;
  ClientTransport& operator=(const ClientTransport&) = delete;
  virtual ~ClientTransport() = default;

  /// Sends one whole frame, which is copied. A stream with a full buffer waits for at most 100 ms.
  /// @realtime one system call (a stream: per 32 KiB)
  [[nodiscard]] virtual expected<void, IoError> send(ConstBytes frame) noexcept = 0;
  /// Sends several frames, together where the transport can. After an error some may have gone.
  /// @realtime one system call if they go together, else as send() for each
  [[nodiscard]] virtual expected<void, IoError> send_batch(const DatagramBatch& batch) noexcept;
  /// From now on frames that a peer sends together may be received together. Set-up only.
  virtual void accept_batches() noexcept {}

  /// One whole frame, if there is one; aligned to 16 bytes, valid until the next receive().
  /// Malformed input is passed on as it is, for the protocol to count. Never blocks.
  /// @realtime at most one system call (a stream: per 32 KiB)
  [[nodiscard]] virtual expected<MutableBytes, IoError> receive() noexcept = 0;
  /// Whether receive() has a frame that came together with an earlier one.
  [[nodiscard]] virtual bool has_buffered() const noexcept { return false; }

  /// Waits until receive() may have something, or until `until`, or shorter. Call it after
  /// receive() had nothing: frames that came together end only one wait.
  /// @realtime at most two system calls
  virtual void wait(MonotonicTime until) noexcept;
  /// The next frame; if there is none, waits as wait() does.
  /// @realtime one system call where the transport can, else three
  [[nodiscard]] virtual expected<MutableBytes, IoError> await(MonotonicTime until) noexcept;
  /// The socket. Through shared memory it reports only that the server is gone.
  [[nodiscard]] virtual int descriptor() const noexcept = 0;
  [[nodiscard]] virtual wire::Medium medium() const noexcept = 0;
  /// The number of sent frames that the server has not taken; nothing if no memory is shared. Stays
  /// valid after the server's end.
  /// @realtime no system call
  [[nodiscard]] virtual std::optional<std::uint32_t> unread_count() const noexcept { return {}; }
  /// Checks whether the server hung up, if receive() alone would not notice soon; then receive()
  /// reports it.
  /// @realtime at most one system call
  virtual void check_peer() noexcept {}
  /// Whether no frame leaves this host: then frames get lost only in full buffers.
  [[nodiscard]] virtual bool is_on_host() const noexcept { return false; }
};

/// Opens a transport to host:port over UDP. Sends nothing yet.
/// @realtime set-up only
/// @errors   an unknown host, no descriptor left
[[nodiscard]] expected<std::unique_ptr<ClientTransport>, SetupError> open_udp_transport(
    const std::string& host, std::uint16_t port, Priority priority);

/// Connects to host:port over TCP, for messages of up to `message_size_max` bytes.
/// @realtime set-up only
/// @errors   an unknown host, no server, no answer by `deadline`, no descriptor left
[[nodiscard]] expected<std::unique_ptr<ClientTransport>, SetupError> open_tcp_transport(
    const std::string& host, std::uint16_t port, Priority priority, std::uint32_t message_size_max,
    MonotonicTime deadline);

}  // namespace rtpm::transport
