#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "rtpm/base/assert.hpp"
#include "rtpm/base/bytes.hpp"

namespace rtpm::rpc {

/// What stands in front of a record's payloads.
struct alignas(16) TapRecord {
  /// Its size in units, stage, status and flags; 0 until the record is whole.
  std::uint64_t word = 0;
  std::uint64_t number = 0;
  std::uint64_t session = 0;
  std::uint64_t trace_id = 0;
  std::int64_t received_ns = 0;
  std::int64_t finished_ns = 0;
  std::uint32_t request_size = 0;
  std::uint32_t reply_size = 0;
  std::uint32_t service = 0;
  std::uint16_t method = 0;
  std::uint16_t priority = 0;
};
static_assert(sizeof(TapRecord) == 64);

/// The first word of a record, which says that it is whole.
struct TapWord {
  std::uint32_t unit_count = 0;
  std::uint8_t stage = 0;
  std::uint8_t status = 0;
  bool has_request = false;
  bool has_reply = false;
  bool is_padding = false;  ///< Up to the ring's end.

  [[nodiscard]] static constexpr TapWord of(std::uint64_t word) noexcept {
    return {static_cast<std::uint32_t>(word), static_cast<std::uint8_t>(word >> 32),
            static_cast<std::uint8_t>(word >> 40), (word >> 48 & 1) != 0, (word >> 49 & 1) != 0,
            (word >> 50 & 1) != 0};
  }
  [[nodiscard]] constexpr std::uint64_t value() const noexcept {
    return std::uint64_t{unit_count} | std::uint64_t{stage} << 32 | std::uint64_t{status} << 40 |
           std::uint64_t{has_request} << 48 | std::uint64_t{has_reply} << 49 |
           std::uint64_t{is_padding} << 50;
  }
};

/// Records of a lane's threads for one reader. A record is reserved, filled and committed; it is
/// never split, and what the reader is done with is zero.
/// @threads  reserve() and commit() any; front() and pop() one other
/// @realtime wait-free, alloc-free but for construction
class TapRing {
 public:
  static constexpr std::size_t kUnit = 16;

  /// A record's memory, and the number of its call in this lane.
  struct Reservation {
    TapRecord* record = nullptr;  ///< Null: the ring is full.
    std::uint32_t number = 0;
  };

  /// @param byte_count    a power of two
  /// @param first_number  of the call that is reserved first
  TapRing(std::uint32_t byte_count, std::uint32_t first_number)
      : units_(byte_count / kUnit), mask_(static_cast<std::uint32_t>(units_.size() - 1)) {
    RTPM_ASSERT(std::has_single_bit(byte_count) && byte_count >= 64 * kUnit,
                "a ring is a power of two of bytes");
    tail_.store(std::uint64_t{first_number} << 32, std::memory_order_relaxed);
  }

  /// @param counts  whether the record begins a call, and so takes the next number
  [[nodiscard]] Reservation reserve(std::uint32_t unit_count, bool counts) noexcept {
    // Only threads of one lane compete, so that more attempts are not needed in practice.
    constexpr int kAttemptCount = 16;
    std::uint64_t tail = tail_.load(std::memory_order_relaxed);
    for (int i = 0; i < kAttemptCount; ++i) {
      const auto position = static_cast<std::uint32_t>(tail);
      const std::uint32_t index = position & mask_;
      const std::uint32_t left = mask_ + 1 - index;
      const std::uint32_t padding = unit_count > left ? left : 0;
      // SYNC POINT tap-free: the reader is done with what is before, and it is zero.
      const std::uint32_t used = position - head_.load(std::memory_order_acquire);
      if (used + padding + unit_count > mask_ + 1) return {};
      const std::uint64_t next = ((tail >> 32) + (counts ? 1 : 0)) << 32 |
                                 static_cast<std::uint32_t>(position + padding + unit_count);
      if (!tail_.compare_exchange_weak(tail, next, std::memory_order_relaxed)) continue;
      if (padding > 0) commit(*at(index), {.unit_count = padding, .is_padding = true});
      return {at(padding > 0 ? 0 : index), static_cast<std::uint32_t>(tail >> 32)};
    }
    return {};
  }
  /// The record is whole.
  static void commit(TapRecord& record, const TapWord& word) noexcept {
    // SYNC POINT tap-whole
    std::atomic_ref(record.word).store(word.value(), std::memory_order_release);
  }

  /// The oldest record, or null while it is not whole or there is none.
  [[nodiscard]] TapRecord* front() noexcept {
    while (true) {
      TapRecord& record = *at(head_.load(std::memory_order_relaxed) & mask_);
      // SYNC POINT tap-whole
      const std::uint64_t word = std::atomic_ref(record.word).load(std::memory_order_acquire);
      if (word == 0) return nullptr;
      if (!TapWord::of(word).is_padding) return &record;
      pop();
    }
  }
  /// Frees the record that front() gave.
  void pop() noexcept {
    const std::uint32_t head = head_.load(std::memory_order_relaxed);
    TapRecord* const record = at(head & mask_);
    const std::uint32_t unit_count = TapWord::of(record->word).unit_count;
    std::fill_n(units_.begin() + (head & mask_), unit_count, Unit{});
    // SYNC POINT tap-free
    head_.store(head + unit_count, std::memory_order_release);
  }
  /// Of the next call.
  [[nodiscard]] std::uint32_t next_number() const noexcept {
    return static_cast<std::uint32_t>(tail_.load(std::memory_order_relaxed) >> 32);
  }

 private:
  struct alignas(kUnit) Unit {
    std::array<std::byte, kUnit> bytes{};
  };
  [[nodiscard]] TapRecord* at(std::uint32_t index) noexcept {
    return reinterpret_cast<TapRecord*>(units_.data() + index);
  }

  std::vector<Unit> units_;
  std::uint32_t mask_;
  /// Low half: units ever reserved; high half: calls. Both modulo 2^32.
  alignas(64) std::atomic<std::uint64_t> tail_{0};
  alignas(64) std::atomic<std::uint32_t> head_{0};  ///< Units ever freed, modulo 2^32.
};

}  // namespace rtpm::rpc
