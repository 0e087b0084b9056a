#pragma once

#include <array>
#include <atomic>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "rtpm/base/assert.hpp"

namespace rtpm::rpc {

/// The header before a record's payloads. Padding has only its first unit.
struct alignas(16) TapRecord {
  std::uint32_t unit_count = 0;  ///< The size of the whole record.
  std::uint8_t stage = 0;
  std::uint8_t status = 0;
  bool has_request = false;
  bool has_reply = false;
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

/// A ring of records for one writer at a time and one reader. A record is never split.
/// @threads  reserve() and commit(): the writer; front() and pop(): the reader
/// @realtime wait-free, alloc-free except construction
class TapRing {
 public:
  static constexpr std::uint32_t kUnit = 16;
  /// The stage that marks padding up to the ring's end.
  static constexpr std::uint8_t kPadding = 255;

  /// @param byte_count  a power of two
  explicit TapRing(std::uint32_t byte_count) : units_(byte_count / kUnit) {
    RTPM_ASSERT(std::has_single_bit(byte_count) && byte_count >= 2 * sizeof(TapRecord),
                "a ring is a power of two of bytes");
  }

  /// Memory for a record; null if the ring is full.
  [[nodiscard]] TapRecord* reserve(std::uint32_t unit_count) noexcept {
    const auto size = static_cast<std::uint32_t>(units_.size());
    const std::uint32_t tail = tail_.load(std::memory_order_relaxed);
    const std::uint32_t index = tail & (size - 1);
    if (index + unit_count > size) [[unlikely]]
      return reserve_at_begin(unit_count);
    if (tail + unit_count - known_head_ > size && !learn_head(unit_count)) [[unlikely]] {
      return nullptr;
    }
    return at(index);
  }
  /// Publishes the reserved record.
  void commit(std::uint32_t unit_count) noexcept {
    // SYNC POINT tap-whole
    tail_.store(tail_.load(std::memory_order_relaxed) + unit_count, std::memory_order_release);
  }

  /// The oldest record, or null.
  [[nodiscard]] const TapRecord* front() noexcept {
    while (true) {
      const std::uint32_t head = head_.load(std::memory_order_relaxed);
      // SYNC POINT tap-whole
      if (head == tail_.load(std::memory_order_acquire)) return nullptr;
      const TapRecord* const record = at(head & static_cast<std::uint32_t>(units_.size() - 1));
      if (record->stage != kPadding) return record;
      pop(*record);
    }
  }
  /// Frees the record that front() returned.
  void pop(const TapRecord& record) noexcept {
    // SYNC POINT tap-free
    head_.store(head_.load(std::memory_order_relaxed) + record.unit_count,
                std::memory_order_release);
  }

 private:
  struct alignas(kUnit) Unit {
    std::array<std::byte, kUnit> bytes{};
  };
  [[nodiscard]] TapRecord* at(std::uint32_t index) noexcept {
    return reinterpret_cast<TapRecord*>(units_.data() + index);
  }
  /// Whether there is space, after reloading the reader's position.
  [[nodiscard]] bool learn_head(std::uint32_t unit_count) noexcept {
    // SYNC POINT tap-free: the reader has finished with everything before it.
    known_head_ = head_.load(std::memory_order_acquire);
    return tail_.load(std::memory_order_relaxed) + unit_count - known_head_ <= units_.size();
  }
  /// Reserves at the ring's beginning, and pads up to its end.
  [[nodiscard, gnu::noinline]] TapRecord* reserve_at_begin(std::uint32_t unit_count) noexcept {
    const auto size = static_cast<std::uint32_t>(units_.size());
    const std::uint32_t index = tail_.load(std::memory_order_relaxed) & (size - 1);
    if (!learn_head(size - index + unit_count)) return nullptr;
    TapRecord& padding = *at(index);
    padding.unit_count = size - index;
    padding.stage = kPadding;
    commit(size - index);
    return at(0);
  }

  std::vector<Unit> units_;
  alignas(64) std::atomic<std::uint32_t> tail_{0};  ///< Units ever written, modulo 2^32.
  std::uint32_t known_head_ = 0;                    ///< `head_` as last seen by the writer.
  alignas(64) std::atomic<std::uint32_t> head_{0};  ///< Units ever freed, modulo 2^32.
};

}  // namespace rtpm::rpc
