#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <type_traits>

namespace rtpm::gvd {

/// Orders the values of one writer by `sequence`, modulo 2^32; values of different writers by the
/// time of put().
struct MailStamp {
  std::uint16_t writer = 0;
  std::uint32_t sequence = 0;
};

/// Result of put().
enum class MailOutcome : std::uint8_t {
  kPut,
  kOld,      ///< The writer's newest value is at least as new.
  kRefused,  ///< The writer is not allowed.
  kBusy,     ///< Too many concurrent puts: drop the value or retry.
};

/// Passes the newest value from several threads to one real-time thread: a state, not a queue. A
/// thread preempted in put() blocks no other thread, and its late value never replaces a newer one.
/// @ownership holds kSlotCount values in place
/// @threads  put() from any, take() from one
/// @realtime alloc-free; take() is wait-free, put() lock-free
template <class T>
requires std::is_trivially_copyable_v<T>
class Mailbox {
 public:
  /// One slot pending, one being taken, the others for concurrent puts.
  static constexpr std::size_t kSlotCount = 16;

  /// Puts `value` if `is_allowed()` holds just before, and the current value is not newer.
  template <class Allowed>
  requires std::is_invocable_r_v<bool, Allowed>
  [[nodiscard]] MailOutcome put(MailStamp stamp, const T& value, Allowed is_allowed) noexcept {
    const std::size_t slot = claim();
    if (slot == kSlotCount) return MailOutcome::kBusy;
    slots_[slot].value = value;
    std::uint64_t before = newest_.load(std::memory_order_acquire);
    MailOutcome outcome = MailOutcome::kPut;
    while (true) {
      outcome = is_allowed() ? outcome_of(stamp, before) : MailOutcome::kRefused;
      if (outcome != MailOutcome::kPut) break;
      // SYNC POINT mailbox-value: the thread that takes or replaces the slot sees its complete
      // value.
      if (newest_.compare_exchange_weak(before, word_of(stamp, slot), std::memory_order_acq_rel,
                                        std::memory_order_acquire)) {
        free_slot_of(before);
        return outcome;
      }
    }
    free(slot);
    return outcome;
  }

  /// The newest value; nullopt if none was put since the last take().
  [[nodiscard]] std::optional<T> take() noexcept {
    if ((newest_.load(std::memory_order_relaxed) & kSlotMask) == 0) return std::nullopt;
    // SYNC POINT mailbox-value
    const std::uint64_t taken = newest_.fetch_and(~kSlotMask, std::memory_order_acq_rel);
    const T value = slots_[(taken & kSlotMask) - 1].value;
    free_slot_of(taken);
    return value;
  }

 private:
  // The word of the newest value: its slot + 1 in the low byte, or 0 once taken; a bit that tells
  // whether a value was ever put; and the value's stamp, which is kept when it is taken.
  static constexpr std::uint64_t kSlotMask = 0xff;
  static constexpr std::uint64_t kStamped = 0x100;

  struct alignas(64) Slot {
    std::atomic<bool> is_claimed{false};
    T value{};
  };

  [[nodiscard]] static std::uint64_t word_of(MailStamp stamp, std::size_t slot) noexcept {
    return std::uint64_t{stamp.sequence} << 32 | std::uint64_t{stamp.writer} << 16 | kStamped |
           (slot + 1);
  }
  [[nodiscard]] static MailOutcome outcome_of(MailStamp stamp, std::uint64_t before) noexcept {
    const auto writer = static_cast<std::uint16_t>(before >> 16);
    const auto sequence = static_cast<std::uint32_t>(before >> 32);
    const bool is_comparable = (before & kStamped) != 0 && writer == stamp.writer;
    const bool is_newer = static_cast<std::int32_t>(stamp.sequence - sequence) > 0;
    return is_comparable && !is_newer ? MailOutcome::kOld : MailOutcome::kPut;
  }

  [[nodiscard]] std::size_t claim() noexcept {
    for (std::size_t slot = 0; slot < kSlotCount; ++slot) {
      // SYNC POINT mailbox-slot: the claiming thread sees what the slot's last user did.
      if (!slots_[slot].is_claimed.load(std::memory_order_relaxed) &&
          !slots_[slot].is_claimed.exchange(true, std::memory_order_acquire)) {
        return slot;
      }
    }
    return kSlotCount;
  }
  void free(std::size_t slot) noexcept {
    // SYNC POINT mailbox-slot
    slots_[slot].is_claimed.store(false, std::memory_order_release);
  }
  void free_slot_of(std::uint64_t word) noexcept {
    if ((word & kSlotMask) != 0) free((word & kSlotMask) - 1);
  }

  std::array<Slot, kSlotCount> slots_{};
  alignas(64) std::atomic<std::uint64_t> newest_{0};
};

}  // namespace rtpm::gvd
