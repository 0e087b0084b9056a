#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "rtpm/base/priority.hpp"
#include "rtpm/base/record_ring.hpp"
#include "rtpm/base/setup_error.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/transport/client_transport.hpp"
#include "rtpm/transport/connection.hpp"
#include "rtpm/transport/socket.hpp"

/// Frames through memory that client and server share: a ring in each direction, set up over a UNIX
/// socket, which stays open as the bell and tells at once that the other side is gone. The memory
/// has no name, so nothing is left of it when both sides are gone, however they ended.
/// Source: spec/hprotocol.md#hp-16.
namespace rtpm::transport {

/// Where a server's UNIX socket is. Without a folder it is an abstract name of the network
/// namespace, of the same host and port as the server's UDP and TCP; so the two reach the same
/// server. With one it is the file "<folder>/<host>:<port>", which containers can share that share
/// nothing else.
struct SharedMemoryAddress {
  std::string host;  ///< Numeric, "127.0.0.1".
  std::uint16_t port = 0;
  std::string folder{};
};

/// Memory that two processes share, mapped in this one. Ownership: unmaps at its end.
/// Threads: any.   Set-up only.
class SharedMapping {
 public:
  /// Maps `size` bytes of the file and brings them into memory; empty if the system refuses.
  SharedMapping(int descriptor, std::size_t size) noexcept;
  SharedMapping(SharedMapping&& other) noexcept : bytes_(std::exchange(other.bytes_, {})) {}
  SharedMapping& operator=(SharedMapping&&) = delete;
  ~SharedMapping();
  [[nodiscard]] MutableBytes bytes() const noexcept { return bytes_; }

 private:
  MutableBytes bytes_;
};

/// The bytes of the two rings.
struct RingSizes {
  std::uint32_t to_server = 0;
  std::uint32_t to_client = 0;
};

/// One end of a connection through shared memory; the same for both sides. What the peer writes to
/// the memory is copied before it is looked at, and never trusted.
/// Ownership: the socket, the mapping, a buffer of one largest frame, allocated when built.
/// Threads: one at a time.   RT: send() and receive() are alloc-free; without a syscall, except one
/// to wake a peer that sleeps.
class SharedMemoryConnection final : public Connection {
 public:
  enum class Side : std::uint8_t { kServer, kClient };
  /// `event` is the eventfd with which the client wakes the server; `mapping` is not empty and
  /// holds rings of `sizes`.
  SharedMemoryConnection(Descriptor socket, Descriptor event, SharedMapping mapping,
                         RingSizes sizes, Side side);

  /// Errors: kFailed: larger than a frame may be; kBroken and kClosed: end the connection.
  expected<void, IoError> send(ConstBytes frame, MonotonicTime until) noexcept override;
  /// Half of the ring is for frames that may not wait.
  bool has_spare_capacity(std::size_t size) noexcept override {
    return writer_.has_spare_capacity(size);
  }
  expected<ConstBytes, IoError> receive() noexcept override;
  bool has_buffered() const noexcept override { return reader_.has_record(); }
  int descriptor() const noexcept override { return socket_.number(); }
  int event() const noexcept override { return event_.number(); }
  bool is_memory() const noexcept override { return true; }
  void on_ready() noexcept override;
  bool announce_sleep() noexcept override {
    return reader_.announce_sleep(RecordSleep::kAtEvent) && !is_closed_;
  }
  void end_sleep() noexcept override { reader_.end_sleep(); }

  /// Waits for frames alone, which wakes sooner than a poll, until one is there or until `until`.
  /// The end of the peer it does not tell.   RT: alloc-free, one syscall.
  void wait_for_frame(MonotonicTime until) noexcept;
  /// Asks the socket, which receive() does not, whether the peer is gone; then receive()
  /// tells.   RT: alloc-free, one syscall.
  void check_peer() noexcept;
  /// How many sent frames the peer has not taken out of the ring.   RT: no syscall.
  [[nodiscard]] std::uint32_t unread_count() const noexcept { return writer_.unread_count(); }

 private:
  void ring_bell() noexcept;
  void signal_event() noexcept;
  [[nodiscard]] bool await_room(MonotonicTime until) noexcept;

  struct alignas(64) CacheLine {
    std::byte bytes[64];
  };
  Descriptor socket_;
  Descriptor event_;
  SharedMapping mapping_;
  RecordWriter writer_;
  RecordReader reader_;
  std::vector<CacheLine> lines_;
  bool is_closed_ = false;  ///< The peer hung up; what it wrote before is still there.
};

/// A server's UNIX socket.   Set-up only: not for lanes.
class SharedMemoryListener {
 public:
  /// Errors: another program has the address; a folder that is not there or may not be written.
  [[nodiscard]] static expected<SharedMemoryListener, SetupError> open(
      const SharedMemoryAddress& address);
  SharedMemoryListener(SharedMemoryListener&&) noexcept = default;
  SharedMemoryListener& operator=(SharedMemoryListener&&) = delete;
  ~SharedMemoryListener();

  [[nodiscard]] int descriptor() const noexcept { return socket_.number(); }
  /// The next client, which will send its request. One for which no descriptor is left is turned
  /// away.
  [[nodiscard]] Accepted accept() noexcept;

 private:
  SharedMemoryListener(Descriptor socket, std::string file) noexcept;
  Descriptor socket_;
  Descriptor spare_;  ///< Given up for a moment when no other is left.
  std::string file_;  ///< Empty: an abstract name.
};

/// A client that has its rings.
struct SharedMemoryClient {
  Priority priority{};  ///< Which it asked for: it chooses the lane.
  std::unique_ptr<Connection> connection{};
  int shortage = 0;  ///< The error number for which there was no descriptor or memory; 0: none.
};

/// Reads the request of a client that was accepted, and answers it. No connection if it was refused
/// (it is told why), asked only whether it would be, or sent something else.   Set-up only.
[[nodiscard]] SharedMemoryClient welcome_shared_memory_client(Descriptor socket);

/// Whether a server is there that this process may share memory with, and trusts: one of the same
/// user, or of the superuser.   Set-up only; waits for its answer until `deadline`.
[[nodiscard]] bool is_shared_memory_served(const SharedMemoryAddress& address,
                                           MonotonicTime deadline) noexcept;

/// Connects to a server on this host by `deadline`.   Set-up only.
/// Errors: nobody there, another user's, no answer in time, no memory or descriptor left.
[[nodiscard]] expected<std::unique_ptr<ClientTransport>, SetupError> open_shared_memory_transport(
    const SharedMemoryAddress& address, Priority priority, MonotonicTime deadline);

}  // namespace rtpm::transport
