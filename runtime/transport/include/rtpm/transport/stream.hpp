#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "rtpm/base/bytes.hpp"
#include "rtpm/base/expected.hpp"
#include "rtpm/transport/connection.hpp"
#include "rtpm/transport/error.hpp"
#include "rtpm/transport/socket.hpp"

namespace rtpm::transport {

/// A connected TCP socket that carries whole frames, on either side.
/// @ownership a receive buffer for the largest message, allocated by the constructor
/// @threads  one at a time
/// @realtime send() and receive(): alloc-free, one system call per 32 KiB
class FrameStream final : public Connection {
 public:
  /// @param takes_sealed  if false, a sealed frame is malformed (sec-4-1)
  FrameStream(Descriptor socket, std::uint32_t message_size_max, bool takes_sealed = true);

  expected<void, IoError> send(ConstBytes frame, MonotonicTime until) noexcept override;
  bool has_spare_capacity(std::size_t size) noexcept override;
  /// Returns malformed bytes unchanged.
  expected<MutableBytes, IoError> receive() noexcept override;
  /// Like receive(), but waits about kBlockTime if there is no frame.
  [[nodiscard]] expected<MutableBytes, IoError> await() noexcept;
  bool has_buffered() const noexcept override;
  int descriptor() const noexcept override { return socket_.number(); }

 private:
  /// The size of the frame at that offset of the buffer; 0 if it is incomplete.
  [[nodiscard]] std::size_t complete_size(std::size_t at) const noexcept;
  [[nodiscard]] MutableBytes buffer() noexcept;
  [[nodiscard]] expected<MutableBytes, IoError> receive(int flags) noexcept;
  void release_given() noexcept;
  [[nodiscard]] std::ptrdiff_t fill(int flags) noexcept;

  struct alignas(64) CacheLine {
    std::byte bytes[64];
  };
  Descriptor socket_;
  bool takes_sealed_;
  std::vector<CacheLine> lines_;
  std::size_t waiting_max_ = 0;  ///< The most unsent bytes for which has_spare_capacity() is true.
  std::size_t given_size_ = 0;   ///< Bytes at the front that receive() has already returned.
  std::size_t filled_size_ = 0;
};

}  // namespace rtpm::transport
