#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "model/report.hpp"
#include "rtpm/sealed/server.hpp"
#include "rtpm/transport/datagram_batch.hpp"
#include "rtpm/transport/udp.hpp"
#include "rtpm/wire/server_sessions.hpp"

namespace rtpm::rpc {

/// A lane's UDP port. Receives datagrams in batches and sends their answers together, except
/// answers that would have to wait for a slow call.
/// @threads  one at a time, with the lane's Lead
/// @realtime alloc-free
class DatagramPort {
 public:
  /// @param seals  the sessions' seals; null if sessions are not sealed
  DatagramPort(transport::UdpPort port, LaneReport& report, sealed::SealedServer* seals) noexcept
      : port_(std::move(port)), report_(report), seals_(seals) {}

  /// Whether a datagram is available, from the last batch or received now. Returns the time.
  /// @realtime at most one system call
  [[nodiscard]] std::optional<MonotonicTime> receive() noexcept;
  /// The next datagram of the batch, valid until the following next().
  [[nodiscard]] std::optional<MutableBytes> next() noexcept { return batch_.next(); }
  [[nodiscard]] bool has_leftovers() const noexcept { return !batch_.is_empty(); }
  [[nodiscard]] const wire::PeerAddress& peer() const noexcept { return batch_.peer(); }

  /// Call before running a call of the batch: sends the waiting answers, unless the call was quick
  /// last time.
  void begin_call(Lead&, const wire::Header& call) noexcept;
  /// Remembers whether the call was quick.
  void end_call(const wire::Header& call, MonotonicTime received) noexcept;
  /// Sends a frame and the frames of `sessions` that follow it; later, if more calls of the batch
  /// follow.
  void send(Lead&, wire::ServerSessions& sessions, const wire::PeerAddress& peer, ConstBytes frame,
            bool has_more) noexcept;
  /// Sends a frame as it is.
  void send_alone(Lead&, const wire::PeerAddress& peer, ConstBytes frame) noexcept;
  /// Sends the waiting frames.
  void flush(Lead&) noexcept;

  [[nodiscard]] transport::UdpPort& socket() noexcept { return *port_; }
  /// Where waits may receive while there are no leftovers.
  [[nodiscard]] MutableBytes buffer() noexcept { return buffer_; }
  /// Closes the port, so that callers see at once that no lane serves them.
  void close() noexcept { port_.reset(); }

 private:
  std::optional<transport::UdpPort> port_;  ///< Empty once closed.
  LaneReport& report_;
  sealed::SealedServer* seals_;
  transport::Datagrams batch_{};  ///< The datagrams left in buffer_.
  transport::DatagramBatch answers_ = transport::DatagramBatch::allocate();
  wire::PeerAddress answers_peer_{};
  std::uint32_t quick_service_ = wire::kSessionService;  ///< The service whose last call was quick.
  std::uint16_t quick_method_ = 0;                       ///< The method whose last call was quick.
  alignas(64) std::array<std::byte, transport::Datagrams::kSizeMax> buffer_{};
};

}  // namespace rtpm::rpc
