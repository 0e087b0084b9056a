#pragma once

#include <atomic>
#include <optional>

#include "rtpm/base/assert.hpp"
#include "rtpm/base/ring.hpp"
#include "rtpm/sealed/handshake_job.hpp"
#include "rtpm/transport/wait_set.hpp"

namespace rtpm::rpc {

/// A handshake step on its way.
struct HandshakeWork {
  sealed::HandshakeJob* job = nullptr;
  bool is_stream = false;  ///< True for a stream of the lane, false for datagrams.
};

/// Handshakes on their way from a lane to the gatekeeper and back, and the gatekeeper's requests to
/// the lane.
/// @threads  submit(), take_done() and take_sweep(): the lane's leader; the rest: the gatekeeper
/// @realtime alloc-free, lock-free
class GatekeeperLink {
 public:
  /// The most jobs of each medium. Over datagrams clients retry.
  static constexpr std::uint32_t kDatagramJobCountMax = 16;
  static constexpr std::uint32_t kStreamJobCountMax = 64;

  GatekeeperLink(transport::WaitSet& lane, transport::WaitSet& gatekeeper) noexcept
      : lane_(lane), gatekeeper_(gatekeeper) {}

  void submit(HandshakeWork work) noexcept {
    const bool has_space = submitted_.push(work);
    RTPM_ASSERT(has_space, "a lane has no more jobs than the ring holds");
    gatekeeper_.ring();
  }
  [[nodiscard]] std::optional<HandshakeWork> take_done() noexcept { return done_.pop(); }

  [[nodiscard]] std::optional<HandshakeWork> take_submitted() noexcept { return submitted_.pop(); }
  void give_back(HandshakeWork work) noexcept {
    const bool has_space = done_.push(work);
    RTPM_ASSERT(has_space, "a lane has no more jobs than the ring holds");
    lane_.ring();
  }

  /// Wakes the lane because the grants have changed.
  void ring() noexcept { lane_.ring(); }
  /// Asks the lane to note which sessions have ended.
  void request_sweep() noexcept {
    is_sweep_due_.store(true, std::memory_order_relaxed);
    ring();
  }
  /// Whether a sweep was requested; false until the next request.
  [[nodiscard]] bool take_sweep() noexcept {
    if (!is_sweep_due_.load(std::memory_order_relaxed)) [[likely]]
      return false;
    is_sweep_due_.store(false, std::memory_order_relaxed);
    return true;
  }

 private:
  static constexpr std::size_t kCapacity = 128;
  static_assert(kDatagramJobCountMax + kStreamJobCountMax <= kCapacity);
  using Ring = SpscRing<HandshakeWork, kCapacity>;
  Ring submitted_;
  Ring done_;
  std::atomic<bool> is_sweep_due_{false};
  transport::WaitSet& lane_;
  transport::WaitSet& gatekeeper_;
};

}  // namespace rtpm::rpc
