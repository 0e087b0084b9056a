#pragma once

#include <memory>
#include <utility>

#include "rtpm/base/ring.hpp"
#include "rtpm/rt/memory.hpp"
#include "rtpm/transport/connection.hpp"
#include "rtpm/transport/wait_set.hpp"

namespace rtpm::rpc {

/// Connections on their way from the acceptor to a lane, and back to be freed where freeing is
/// allowed.
/// @threads  offer() and take_back(): the acceptor; the rest: the lane's leader
/// @realtime alloc-free
class Handover {
 public:
  Handover(transport::WaitSet& lane, transport::WaitSet& acceptor) noexcept
      : lane_(lane), acceptor_(acceptor) {}

  /// False if too many are waiting; then the caller keeps the connection.
  [[nodiscard]] bool offer(std::unique_ptr<transport::Connection>& stream) noexcept {
    if (!arriving_.push(stream)) return false;
    lane_.ring();
    return true;
  }
  /// An ended connection, or null.
  [[nodiscard]] std::unique_ptr<transport::Connection> take_back() noexcept {
    auto stream = leaving_.pop();
    return stream ? std::move(*stream) : nullptr;
  }

  /// The next new connection, or null.
  [[nodiscard]] std::unique_ptr<transport::Connection> take_arrival() noexcept {
    auto stream = arriving_.pop();
    return stream ? std::move(*stream) : nullptr;
  }
  void give_back(std::unique_ptr<transport::Connection> stream) noexcept {
    if (!leaving_.push(stream)) {
      // The acceptor is far behind. Freeing here violates the real-time rule once, but is
      // memory-safe.
      const rt::AllowAllocationScope is_allowed;
      stream.reset();
    }
    acceptor_.ring();
  }
  /// Ends all connections in transit, once neither side runs.
  void close() noexcept {
    while (arriving_.pop()) {
    }
    while (leaving_.pop()) {
    }
  }

 private:
  using Ring = SpscRing<std::unique_ptr<transport::Connection>, 128>;
  Ring arriving_;
  Ring leaving_;
  transport::WaitSet& lane_;
  transport::WaitSet& acceptor_;
};

}  // namespace rtpm::rpc
