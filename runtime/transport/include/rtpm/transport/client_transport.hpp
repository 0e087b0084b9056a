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

/// A client's end of a connection to one server: sends and receives frames. Every implementation
/// passes the same conformance suite.
/// @threads  one at a time
/// @realtime alloc-free, except set-up
class ClientTransport {
 public:
  ClientTransport() = default;
  ClientTransport(const ClientTransport&) = delete;
  ClientTransport& operator=(const ClientTransport&) = delete;
  virtual ~ClientTransport() = default;

  /// Sends one whole frame, which is copied. A stream with a full buffer waits for at most 100 ms.
  /// @realtime one system call (a stream: one per 32 KiB)
  [[nodiscard]] virtual expected<void, IoError> send(ConstBytes frame) noexcept = 0;
  /// Sends several frames, together if the transport supports it. After an error some may have been
  /// sent.
  /// @realtime one system call if sent together, otherwise as send() for each
  [[nodiscard]] virtual expected<void, IoError> send_batch(const DatagramBatch& batch) noexcept;
  /// Lets frames that a peer sends together be received together from now on. Set-up only.
  virtual void accept_batches() noexcept {}

  /// Returns one whole frame, if any; aligned to 16 bytes, valid until the next receive().
  /// Malformed input is returned unchanged, for the protocol to count. Never blocks.
  /// @realtime at most one system call (a stream: one per 32 KiB)
  [[nodiscard]] virtual expected<MutableBytes, IoError> receive() noexcept = 0;
  /// Whether receive() has a frame that arrived together with an earlier one.
  [[nodiscard]] virtual bool has_buffered() const noexcept { return false; }

  /// Waits until receive() may have something, at most until `until`; may return early. Call it
  /// only after receive() had nothing: frames that arrived together end only one wait.
  /// @realtime at most two system calls
  virtual void wait(MonotonicTime until) noexcept;
  /// Returns the next frame; if there is none, waits like wait().
  /// @realtime one system call if the transport supports it, otherwise three
  [[nodiscard]] virtual expected<MutableBytes, IoError> await(MonotonicTime until) noexcept;
  /// Makes descriptor() report frames until end_sleep(), for a caller that waits for several.
  /// @return false if a frame is already there, or receive() has an error to report
  /// @realtime no system call
  [[nodiscard]] virtual bool announce_sleep() noexcept { return !has_buffered(); }
  /// @realtime at most one system call
  virtual void end_sleep() noexcept {}
  /// The socket. For shared memory it only reports that the server is gone, and, after
  /// announce_sleep(), frames.
  [[nodiscard]] virtual int descriptor() const noexcept = 0;
  [[nodiscard]] virtual wire::Medium medium() const noexcept = 0;
  /// The number of sent frames that the server has not read; nullopt for transports other than
  /// shared memory. Stays valid after the server has ended.
  /// @realtime no system call
  [[nodiscard]] virtual std::optional<std::uint32_t> unread_count() const noexcept { return {}; }
  /// Checks whether the server hung up, if receive() alone would not notice soon; then receive()
  /// reports it.
  /// @realtime at most one system call
  virtual void check_peer() noexcept {}
  /// Whether frames never leave this host: then they get lost only in full buffers.
  [[nodiscard]] virtual bool is_on_host() const noexcept { return false; }
};

/// Opens a transport to host:port over UDP. Sends nothing yet.
/// @realtime set-up only
/// @errors   an unknown host; no descriptor left
[[nodiscard]] expected<std::unique_ptr<ClientTransport>, SetupError> open_udp_transport(
    const std::string& host, std::uint16_t port, Priority priority);

/// Connects to host:port over TCP, for messages of up to `message_size_max` bytes.
/// @realtime set-up only
/// @errors   an unknown host, no server, no answer by `deadline`, no descriptor left
[[nodiscard]] expected<std::unique_ptr<ClientTransport>, SetupError> open_tcp_transport(
    const std::string& host, std::uint16_t port, Priority priority, std::uint32_t message_size_max,
    MonotonicTime deadline);

}  // namespace rtpm::transport
