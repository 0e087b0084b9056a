#pragma once

#include <array>
#include <atomic>
#include <bit>
#include <cstddef>
#include <optional>
#include <type_traits>
#include <utility>

namespace rtpm::inline base {

/// A bounded queue from one thread to another, for example for accepted connections.
/// @ownership holds `Capacity` values in place
/// @threads  push() from one thread, pop() from one other
/// @realtime wait-free, alloc-free
template <class T, std::size_t Capacity>
requires(std::has_single_bit(Capacity) && std::is_default_constructible_v<T> &&
         std::is_nothrow_move_constructible_v<T> &&
         std::is_nothrow_move_assignable_v<T>) class SpscRing {
 public:
  /// @return false if the ring is full; `value` is then unchanged and still the caller's
  [[nodiscard]] bool push(T& value) noexcept {
    const std::size_t tail = tail_.load(std::memory_order_relaxed);
    // SYNC POINT ring-free: the consumer has finished with the slot.
    if (tail - head_.load(std::memory_order_acquire) == Capacity) return false;
    slots_[tail % Capacity] = std::move(value);
    // SYNC POINT ring-filled: the slot's value is complete.
    tail_.store(tail + 1, std::memory_order_release);
    return true;
  }
  [[nodiscard]] std::optional<T> pop() noexcept {
    const std::size_t head = head_.load(std::memory_order_relaxed);
    // SYNC POINT ring-filled
    if (tail_.load(std::memory_order_acquire) == head) return std::nullopt;
    std::optional<T> value{std::move(slots_[head % Capacity])};
    // SYNC POINT ring-free
    head_.store(head + 1, std::memory_order_release);
    return value;
  }

 private:
  alignas(64) std::atomic<std::size_t> head_{0};
  alignas(64) std::atomic<std::size_t> tail_{0};
  std::array<T, Capacity> slots_{};
};

}  // namespace rtpm::inline base
