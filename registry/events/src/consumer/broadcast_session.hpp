#pragma once

#include <cstdint>
#include <functional>
#include <span>

#include "consumer/local_queue.hpp"
#include "rtpm/events/delivery.hpp"
#include "rtpm/rt/wait.hpp"

namespace rtpm::events {

/// A consumer's end of what a hub sends once for all: its ring, or its multicast. Does by itself
/// what the hub would do for one that has a stream: drops what the policy says when the handler
/// does not keep up.
/// @threads  one at a time
class BroadcastSession {
 public:
  using Outcome = SessionOutcome;
  /// Is given one delivery at a time.
  using Taker = std::function<void(std::span<const EventView>)>;
  /// Whether what take() finds missing is asked for at once if it is due, which waits for the hub.
  enum class Asking : std::uint8_t { kNow, kLater };

  virtual ~BroadcastSession() = default;
  /// Another policy; what waits stays as far as there is room.
  virtual void set_policy(const DeliveryPolicy& policy) = 0;
  /// Takes one delivery and hands it over.
  /// @realtime alloc-free, but for asking
  [[nodiscard]] virtual Outcome take(const Taker& taker, Asking asking) = 0;
  /// Whether something is missing that is to be asked for: take() is to be called with kNow, and
  /// wait() ends when that is due.
  [[nodiscard]] virtual bool is_lacking() const noexcept { return false; }
  /// Waits until more comes, or until `until`.
  virtual void wait(rt::WaitStrategy strategy, MonotonicTime until) noexcept = 0;
  /// Whether there was more when it waited last.
  [[nodiscard]] virtual bool has_more() const noexcept = 0;
  /// By which bits of its source it is woken.
  [[nodiscard]] virtual std::uint32_t wake_bits() const noexcept = 0;
  /// What was lost since it began, on this side.
  [[nodiscard]] virtual Losses losses() const noexcept = 0;
};

}  // namespace rtpm::events
