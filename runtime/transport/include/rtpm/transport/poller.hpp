#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <span>

#include "rtpm/base/expected.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/transport/connection.hpp"
#include "rtpm/transport/socket.hpp"
#include "rtpm/transport/udp.hpp"

namespace rtpm::transport {

class SideWatch;

/// What is waited for, and as what it is reported: not as kBell.
struct Watched {
  int descriptor = -1;
  std::uint64_t tag = 0;
};

/// One wait for everything that may happen to a lane: its sockets and a bell that other threads
/// ring.
/// Threads: ring() from any, the rest from one.
class Poller {
 public:
  static constexpr std::uint64_t kBell = ~std::uint64_t{0};
  static constexpr std::size_t kFewMax = 5;
  static constexpr int kAloneMin = 8;
  /// For wait(): only look.
  static constexpr MonotonicTime kAlready = MonotonicTime::min();

  /// Set-up only.   Errors: no descriptor left.
  [[nodiscard]] static expected<Poller, TransportError> open();

  Poller() noexcept;
  Poller(Poller&&) noexcept;
  Poller& operator=(Poller&&) noexcept;
  ~Poller();

  /// Lets receive_for() receive from connections, where the system has io_uring and allows it.
  /// Set-up only.
  void allow_receives();

  /// Reports `descriptor` as `tag` (not kBell) while it can be read. False if the system refuses.
  [[nodiscard]] bool add(int descriptor, std::uint64_t tag) noexcept;
  /// Reports an eventfd as `tag` each time that it is signalled. Nobody takes the signals: that
  /// spares a syscall each, and their count has room for more than come in a lifetime.
  [[nodiscard]] bool add_event(int descriptor, std::uint64_t tag) noexcept;
  void remove(int descriptor) noexcept;

  /// Waits until something can be read, the bell rang, or `until` (kNever: for ever; kAlready: only
  /// looks). Writes the tags and gives how many.   RT: alloc-free, one syscall.
  [[nodiscard]] std::size_t wait(MonotonicTime until, std::span<std::uint64_t> tags) noexcept;
  /// As wait(), but for the bell and up to kFewMax descriptors that were not added. What is added
  /// is told of by the system with each frame in or out, whether anybody waits or not: a tenth of
  /// what a datagram costs.   RT: alloc-free, one syscall.
  [[nodiscard]] std::size_t wait_for(std::span<const Watched> few, MonotonicTime until,
                                     std::span<std::uint64_t> tags) noexcept;
  /// The same for a port alone, by a receive into `buffer`, which the port's next receive() gives:
  /// one syscall less. It may end kBlockTime before `until`. Where that is near, or it was the bell
  /// last that ended a wait, it polls. Ownership: the port stays where it is for as long as anybody
  /// rings. RT: alloc-free, one syscall.
  [[nodiscard]] std::size_t receive_for(UdpPort& port, MutableBytes buffer, std::uint64_t tag,
                                        MonotonicTime until,
                                        std::span<std::uint64_t> tags) noexcept;
  /// The same for a connection beside another descriptor, by the connection's await_news(), which
  /// the other and the bell end (side_watch.hpp): once the connection alone has ended kAloneMin
  /// waits in a row, and where allow_receives() could do it; else it polls. It may end with nothing
  /// kBlockTime before `until`, or where the next wait will tell. What comes of the other, or the
  /// bell, in the very nanoseconds in which the receive begins, may be heard that late, too. Waits
  /// are to be on one thread, from the first of these to end_receives().   RT: alloc-free, one
  /// syscall; a few where it begins or ends to receive.
  [[nodiscard]] std::size_t receive_for(Connection& connection, std::uint64_t tag,
                                        const Watched& other, MonotonicTime until,
                                        std::span<std::uint64_t> tags) noexcept;
  /// From here on nothing but a wait holds on to the other's descriptor.
  /// RT: alloc-free, one syscall.
  void end_receives() noexcept;
  /// RT: alloc-free, one syscall.
  void ring() noexcept;

 private:
  /// What those who ring share with the one who waits.
  struct Rings {
    std::atomic<std::uint64_t> count{0};
    std::atomic<UdpPort*> receiver{nullptr};  ///< Through which to wake; none: by the bell.
  };

  [[nodiscard]] bool has_rung() noexcept;
  void take_rings() noexcept;
  [[nodiscard]] bool may_receive_beside(const Watched& other) noexcept;

  Descriptor epoll_;
  Descriptor bell_;
  std::unique_ptr<Rings> rings_ = std::make_unique<Rings>();
  std::uint64_t heard_count_ = 0;
  bool was_rung_ = false;  ///< In the last wait.
  std::unique_ptr<SideWatch> side_;
  int alone_count_ = 0;  ///< Waits in a row that a connection ended alone, at most kAloneMin.
};

}  // namespace rtpm::transport
