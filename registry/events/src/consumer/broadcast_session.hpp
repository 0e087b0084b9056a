#pragma once

#include <cstdint>
#include <functional>
#include <span>

#include "consumer/local_queue.hpp"
#include "rtpm/events/delivery.hpp"
#include "rtpm/rt/wait.hpp"

namespace rtpm::events {

/// A consumer's end of a hub's ring or multicast. Applies the queue policy here; for streams the
/// hub does.
/// @threads  one at a time
class BroadcastSession {
 public:
  using Outcome = SessionOutcome;
  /// Receives one delivery.
  using Taker = std::function<void(std::span<const EventView>)>;
  /// Whether take() may request a due repair now. The request blocks until the hub replies.
  enum class Asking : std::uint8_t { kNow, kLater };

  virtual ~BroadcastSession() = default;
  /// Replaces the policy; keeps pending events that fit.
  virtual void set_policy(const DeliveryPolicy& policy) = 0;
  /// Passes one delivery to `taker`.
  /// @realtime alloc-free, except for requesting repair
  [[nodiscard]] virtual Outcome take(const Taker& taker, Asking asking) = 0;
  /// Whether a repair is pending. If so, call take() with kNow; wait() ends when it is due.
  [[nodiscard]] virtual bool is_lacking() const noexcept { return false; }
  /// Waits for an arrival or until `until`.
  virtual void wait(rt::WaitStrategy strategy, MonotonicTime until) noexcept = 0;
  /// Whether the last wait() ended with an arrival.
  [[nodiscard]] virtual bool has_more() const noexcept = 0;
  /// The bits of its source that wake it.
  [[nodiscard]] virtual std::uint32_t wake_bits() const noexcept = 0;
  /// Losses on the consumer's side.
  [[nodiscard]] virtual Losses losses() const noexcept = 0;
};

}  // namespace rtpm::events
