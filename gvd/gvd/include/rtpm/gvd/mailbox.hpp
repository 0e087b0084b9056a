#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <optional>
#include <type_traits>

namespace rtpm::gvd {

/// Hands the newest value from any of several threads to one real-time thread. What was put and not
/// taken is replaced: a state, not a queue.
/// Ownership: holds three values in place.
/// Threads: put() from any, take() from one.   RT: both alloc-free and without waiting. A put()
/// that meets another one in progress gives up and says so; take() never fails because of a put().
template <class T>
requires std::is_trivially_copyable_v<T>
class Mailbox {
 public:
  /// Puts what `make` makes of the value last put; nothing is put when it makes nothing. Only one
  /// put runs at a time, so that `make` may compare and decide.
  /// False when another thread is putting at this very moment: drop the value or try again.
  template <class Make>
  requires std::is_invocable_r_v < std::optional<T>, Make,
  const T& > [[nodiscard]] bool put(Make make) noexcept {
    // SYNC POINT mailbox-writer: one writer's doing is seen whole by the next.
    if (is_writing_.test_and_set(std::memory_order_acquire)) return false;
    if (const std::optional<T> value = make(last_put_)) {
      last_put_ = *value;
      slots_[back_] = *value;
      // SYNC POINT mailbox-value: whoever takes the slot sees its value whole.
      back_ = static_cast<std::uint8_t>(
          middle_.exchange(static_cast<std::uint8_t>(back_ | kNew), std::memory_order_acq_rel) &
          kIndexMask);
    }
    // SYNC POINT mailbox-writer
    is_writing_.clear(std::memory_order_release);
    return true;
  }

  /// The newest value if one was put since the last take.
  [[nodiscard]] std::optional<T> take() noexcept {
    if ((middle_.load(std::memory_order_relaxed) & kNew) == 0) return std::nullopt;
    // SYNC POINT mailbox-value
    front_ =
        static_cast<std::uint8_t>(middle_.exchange(front_, std::memory_order_acq_rel) & kIndexMask);
    return slots_[front_];
  }

 private:
  static constexpr std::uint8_t kNew = 4;
  static constexpr std::uint8_t kIndexMask = 3;

  // One slot is the writer's, one the reader's, and the middle one changes hands.
  std::array<T, 3> slots_{};
  alignas(64) std::atomic<std::uint8_t> middle_{1};
  alignas(64) std::atomic_flag is_writing_{};
  std::uint8_t back_ = 0;
  T last_put_{};
  alignas(64) std::uint8_t front_ = 2;
};

}  // namespace rtpm::gvd
