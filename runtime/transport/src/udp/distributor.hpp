#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "os/doorbell.hpp"
#include "rtpm/base/bytes.hpp"
#include "rtpm/base/ring.hpp"
#include "rtpm/base/setup_error.hpp"
#include "rtpm/rt/thread.hpp"
#include "rtpm/transport/udp.hpp"
#include "rtpm/wire/limits.hpp"

namespace rtpm::transport {

/// A datagram with its sender and the address at which it arrived.
struct LaneDatagram {
  SocketAddress from{};
  SocketAddress to{};
  std::size_t size = 0;
  // One byte more than the largest frame, to detect larger datagrams.
  std::array<std::byte, wire::kDatagramFrameSizeMax + 1> bytes{};
};

/// The datagrams that a Distributor has handed to one lane and the lane has not taken yet.
/// @threads   put(): the distributor; the rest: one at a time
/// @realtime  alloc-free, except construction
class LaneInbox {
 public:
  /// Holds a burst while the lane runs a long call.
  static constexpr std::size_t kSlotCount = 256;

  LaneInbox(Priority low, os::Doorbell doorbell) noexcept
      : low_(low), doorbell_(std::move(doorbell)) {}

  [[nodiscard]] Priority low() const noexcept { return low_; }
  /// Readable while there are datagrams.
  [[nodiscard]] int descriptor() const noexcept { return doorbell_.descriptor(); }
  /// Keeps a copy of the datagram; false if the inbox is full, and it is lost.
  bool put(const SocketAddress& from, const SocketAddress& to, ConstBytes datagram) noexcept;
  /// Like receive_datagrams(): returns a datagram's size, or −1 with EAGAIN in errno.
  /// @param waits  waits for one, at most kBlockTime
  [[nodiscard]] std::ptrdiff_t take(MutableBytes buffer, SocketAddress& from, SocketAddress& to,
                                    bool waits, std::size_t& size) noexcept;

 private:
  void ring_unless_rung() noexcept;

  Priority low_;
  os::Doorbell doorbell_;
  SpscRing<LaneDatagram, kSlotCount> datagrams_{};
  std::atomic<bool> is_rung_{false};
};

/// Hands out the datagrams of a socket to lanes by their priorities, on a thread of its own: for
/// systems that can't steer them.
/// @threads  set-up: one
class Distributor {
 public:
  /// @param socket   a bound UDP socket
  /// @param inboxes  their `low` ascending from 0
  /// @realtime set-up only
  /// @errors   no thread or descriptor left; with kRequire, the process lacks a right
  [[nodiscard]] static expected<std::shared_ptr<Distributor>, SetupError> start(
      Descriptor socket, std::vector<std::unique_ptr<LaneInbox>> inboxes, Priority priority,
      rt::RealtimeMode realtime);
  /// Ends the thread.
  ~Distributor();
  Distributor(const Distributor&) = delete;
  Distributor& operator=(const Distributor&) = delete;

  /// The index of the inbox for a datagram: the last whose `low` is at most its priority.
  [[nodiscard]] std::size_t lane_of(ConstBytes datagram) const noexcept;
  [[nodiscard]] LaneInbox& inbox(std::size_t lane) noexcept { return *inboxes_[lane]; }

 private:
  Distributor(Descriptor socket, std::vector<std::unique_ptr<LaneInbox>> inboxes,
              os::Doorbell end) noexcept
      : socket_(std::move(socket)), inboxes_(std::move(inboxes)), end_(std::move(end)) {}
  void run() noexcept;

  Descriptor socket_;
  std::vector<std::unique_ptr<LaneInbox>> inboxes_;
  os::Doorbell end_;
  rt::Thread thread_;
};

}  // namespace rtpm::transport
