#pragma once

#include <atomic>
#include <cstdint>
#include <memory>

#include "os/linux/epoll_wait_set.hpp"
#include "rtpm/base/bytes.hpp"
#include "rtpm/transport/udp.hpp"

namespace rtpm::transport {

/// A lane's wait set. While the lane's UDP port is the only source, a wait without a lock receives
/// from the port instead of polling it, which saves a system call per datagram. It polls anyway if
/// the last wait was ended by the doorbell, or `until` is nearer than such a receive may take.
///
/// Such a wait may end up to kBlockTime before `until`. The doorbell ends it by sending a datagram
/// to the port. If that datagram is lost, for example in a packet filter, the ring is noticed when
/// the receive ends; from then on the set only polls.
class PortWaitSet final : public EpollWaitSet {
 public:
  using EpollWaitSet::EpollWaitSet;

  [[nodiscard]] bool add_port(UdpPort& port, MutableBytes buffer, SourceTag tag) noexcept override;
  void remove(int descriptor) noexcept override;
  [[nodiscard]] std::size_t wait(MonotonicTime until, std::span<SourceTag> ready,
                                 WaitLock* held = nullptr) noexcept override;
  void ring() noexcept override;

  /// Whether a doorbell datagram was lost.
  [[nodiscard]] bool only_polls() const noexcept { return only_polls_; }

 private:
  [[nodiscard]] bool may_receive(MonotonicTime until) noexcept;
  [[nodiscard]] std::size_t wait_by_receiving(std::span<SourceTag> ready) noexcept;
  [[nodiscard]] std::size_t report_received(std::span<SourceTag> ready, WaitLock* held) noexcept;

  UdpPort* port_ = nullptr;
  MutableBytes buffer_{};
  SourceTag tag_{};
  bool only_polls_ = false;
  bool is_in_doubt_ = false;  ///< A doorbell datagram had not arrived when a receive ended.
  /// The number of doorbell datagrams that had arrived when the doubt arose.
  std::uint64_t come_count_in_doubt_ = 0;
  /// The port, while a wait receives from it.
  alignas(64) std::atomic<UdpPort*> receiving_{nullptr};
  std::atomic<std::uint64_t> sent_count_{0};  ///< Doorbell datagrams sent.
};

}  // namespace rtpm::transport
