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
#include "rtpm/transport/mapping.hpp"
#include "rtpm/transport/socket.hpp"

/// Frames through memory shared by client and server: a ring in each direction, set up over a UNIX
/// socket. The socket stays open as the bell, and immediately reports that the peer is gone. The
/// memory has no name, so nothing remains when both sides are gone, however they ended.
/// @source   spec/hprotocol.md#hp-16
namespace rtpm::transport {

/// Whether this system offers it.
[[nodiscard]] bool offers_shared_memory() noexcept;

/// Where a server's UNIX socket is. Without a folder it has an abstract name in the network
/// namespace, built from the server's host and port. With a folder it is the file
/// "<folder>/<host>:<port>", for containers that share nothing else.
struct SharedMemoryAddress {
  std::string host;  ///< Numeric, "127.0.0.1", "::1".
  std::uint16_t port = 0;
  std::string folder{};
  /// The users whose servers a caller trusts, besides its own user and root.
  std::vector<std::uint32_t> trusted_users{};
};

/// The sizes of the two rings in bytes.
struct RingSizes {
  std::uint32_t to_server = 0;
  std::uint32_t to_client = 0;
};

/// One end of a shared-memory connection, on either side. The peer's data is copied before it is
/// checked, and never trusted.
/// @ownership the socket, the mapping, and a buffer for the largest frame
/// @threads  one at a time
/// @realtime send() and receive(): alloc-free, no system call except one to wake a sleeping peer
class SharedMemoryConnection final : public Connection {
 public:
  enum class Side : std::uint8_t { kServer, kClient };
  /// @param event    the eventfd by which the client wakes the server
  /// @param mapping  not empty, holds rings of `sizes`
  SharedMemoryConnection(Descriptor socket, Descriptor event, SharedMapping mapping,
                         RingSizes sizes, Side side);

  /// @errors   kFailed: larger than a frame may be · kBroken and kClosed: end the connection
  expected<void, IoError> send(ConstBytes frame, MonotonicTime until) noexcept override;
  bool has_spare_capacity(std::size_t size) noexcept override {
    return writer_.has_spare_capacity(size);
  }
  expected<MutableBytes, IoError> receive() noexcept override;
  bool has_buffered() const noexcept override { return reader_.has_record(); }
  int descriptor() const noexcept override { return socket_.number(); }
  int event() const noexcept override { return event_.number(); }
  bool is_memory() const noexcept override { return true; }
  void on_ready() noexcept override { check_peer(); }
  bool announce_sleep() noexcept override { return reader_.announce_sleep(sleep_) && !is_closed_; }
  void end_sleep() noexcept override { reader_.end_sleep(); }

  /// Waits for a frame until `until`. Wakes faster than a poll, but not when the peer ends.
  /// @realtime alloc-free, one system call
  void wait_for_frame(MonotonicTime until) noexcept;
  /// Checks the socket, which receive() does not read, for whether the peer is gone; then receive()
  /// reports it. Takes a bell, which would hide the end.
  /// @realtime alloc-free, one system call
  void check_peer() noexcept;
  /// The number of sent frames that the peer has not read.
  [[nodiscard]] std::uint32_t unread_count() const noexcept { return writer_.unread_count(); }

 private:
  void ring_bell() noexcept;
  void signal_event() noexcept;
  [[nodiscard]] bool await_space(MonotonicTime until) noexcept;

  struct alignas(64) CacheLine {
    std::byte bytes[64];
  };
  Descriptor socket_;
  Descriptor event_;
  SharedMapping mapping_;
  RecordWriter writer_;
  RecordReader reader_;
  RecordSleep sleep_;  ///< How polls report frames: a server's by its event, a client's by a bell.
  std::vector<CacheLine> lines_;
  bool is_closed_ = false;  ///< The peer hung up; its earlier frames can still be read.
};

/// A server's UNIX socket.
/// @realtime set-up only; not for lanes
class SharedMemoryListener {
 public:
  /// @errors   another program has the address; the folder does not exist or is not writable
  [[nodiscard]] static expected<SharedMemoryListener, SetupError> open(
      const SharedMemoryAddress& address);
  SharedMemoryListener(SharedMemoryListener&&) noexcept = default;
  SharedMemoryListener& operator=(SharedMemoryListener&&) = delete;
  ~SharedMemoryListener();

  [[nodiscard]] int descriptor() const noexcept { return socket_.number(); }
  /// Accepts the next client, which will send its request. Closes it if no descriptor is left.
  [[nodiscard]] Accepted accept() noexcept;

 private:
  SharedMemoryListener(Descriptor socket, std::string file) noexcept;
  Descriptor socket_;
  Descriptor spare_;  ///< Closed temporarily when no other descriptor is left.
  std::string file_;  ///< Empty for an abstract name.
};

/// A client with its rings.
struct SharedMemoryClient {
  Priority priority{};  ///< The requested priority; selects the lane.
  std::unique_ptr<Connection> connection{};
  int shortage = 0;  ///< The error number if no descriptor or memory was left, otherwise 0.
};

/// Decides which users a server shares memory with.
class UserPolicy {
 public:
  [[nodiscard]] virtual bool admits(std::uint32_t user) const noexcept = 0;

 protected:
  UserPolicy() = default;
  ~UserPolicy() = default;
};

/// Reads and answers the request of an accepted client. The result has no connection if the client
/// was refused and told why, only asked, or sent something else.
/// @param policy  null to admit this process's user and root
/// @realtime set-up only
[[nodiscard]] SharedMemoryClient welcome_shared_memory_client(Descriptor socket,
                                                              const UserPolicy* policy = nullptr);

/// Whether a server shares memory with this process, and this process trusts it: a server of the
/// same user, root, or SharedMemoryAddress::trusted_users.
/// @realtime set-up only; waits for the server's answer until `deadline`
[[nodiscard]] bool is_shared_memory_served(const SharedMemoryAddress& address,
                                           MonotonicTime deadline) noexcept;

/// Connects to a server on this host.
/// @realtime set-up only
/// @errors   no server; a user that is not trusted; no answer by `deadline`; no memory or
///           descriptor left
[[nodiscard]] expected<std::unique_ptr<ClientTransport>, SetupError> open_shared_memory_transport(
    const SharedMemoryAddress& address, Priority priority, MonotonicTime deadline);

}  // namespace rtpm::transport
