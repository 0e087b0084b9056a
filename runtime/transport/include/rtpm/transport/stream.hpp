#pragma once

#include <cstdint>
#include <vector>

#include "rtpm/base/bytes.hpp"
#include "rtpm/base/expected.hpp"
#include "rtpm/transport/connection.hpp"
#include "rtpm/transport/error.hpp"
#include "rtpm/transport/socket.hpp"

namespace rtpm::transport {

/// A connected TCP socket that carries whole frames; either end uses it.
/// Ownership: a receive buffer of one largest message, allocated when built.
/// Threads: one at a time.   RT: send() and receive() are alloc-free, one syscall per 32 KiB.
class FrameStream final : public Connection {
 public:
  /// Has the socket block for kBlockTime where it is meant to.
  FrameStream(Descriptor socket, std::uint32_t message_size_max);

  expected<void, IoError> send(ConstBytes frame, MonotonicTime until) noexcept override;
  bool has_spare_capacity(std::size_t size) noexcept override;
  /// Bytes that can't be a frame of the stated size are given as they are.
  expected<ConstBytes, IoError> receive() noexcept override;
  /// The same, but where nothing is there it waits, for about kBlockTime.
  [[nodiscard]] expected<ConstBytes, IoError> await() noexcept;
  bool has_buffered() const noexcept override;
  int descriptor() const noexcept override { return socket_.number(); }

 private:
  /// The size of the frame that begins at that place in the buffer, 0 if it has not arrived.
  [[nodiscard]] std::size_t complete_size(std::size_t at) const noexcept;
  [[nodiscard]] MutableBytes buffer() noexcept;
  [[nodiscard]] expected<ConstBytes, IoError> receive(int flags) noexcept;
  void take_back_given() noexcept;
  [[nodiscard]] ssize_t fill(int flags) noexcept;

  struct alignas(64) CacheLine {
    std::byte bytes[64];
  };
  Descriptor socket_;
  std::vector<CacheLine> lines_;
  std::size_t waiting_max_ = 0;  ///< Bytes that may wait in the system, for what may itself wait.
  std::size_t given_size_ = 0;   ///< Bytes at the begin that the caller has and will be done with.
  std::size_t filled_size_ = 0;
};

}  // namespace rtpm::transport
