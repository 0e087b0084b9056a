#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "rtpm/base/bytes.hpp"
#include "rtpm/events/event.hpp"

/// A ring in memory that one writes and many read, none of whom the writer knows: it never waits.
/// Who reads too slowly is overrun, and sees that. Each record says by a bit for whom it is.
///
/// The memory begins with the control words, then the counts of each place, then the records, whose
/// number of bytes is a power of two.
namespace rtpm::events {

inline constexpr std::uint32_t kRingSlotCountMax = 1024;
inline constexpr std::size_t kRingSizeMin = std::size_t{64} * 1024;  ///< Bytes of records.

/// At the begin of the memory.
struct RingControl {
  std::atomic<std::uint64_t> magic{0};
  std::atomic<std::uint64_t> id{0};
  std::atomic<std::uint64_t> size{0};  ///< Bytes of records.
  /// All records before this position are whole.
  alignas(64) std::atomic<std::uint64_t> head{0};
  /// What stood `size` before this position may be overwritten already.
  alignas(64) std::atomic<std::uint64_t> reserved{0};
  /// Events written for each place.
  alignas(64) std::atomic<std::uint64_t> counts[kRingSlotCountMax]{};
  /// The subscription that has each place; 0: none.
  std::atomic<std::uint64_t> owners[kRingSlotCountMax]{};
};
static_assert(std::atomic<std::uint64_t>::is_always_lock_free);

inline constexpr std::size_t kRingDataOffset = 20'480;
static_assert(sizeof(RingControl) <= kRingDataOffset);

/// The bytes of a ring of `size` bytes of records.
[[nodiscard]] constexpr std::size_t ring_memory_size(std::size_t size) noexcept {
  return kRingDataOffset + size;
}

/// Bits for places. A sleeper is woken for its place modulo 32.
class SlotSet {
 public:
  void add(std::uint32_t place) noexcept {
    words_[place / 64] |= std::uint64_t{1} << (place % 64);
    if (place / 64 >= word_count_) word_count_ = place / 64 + 1;
    wake_bits_ |= 1U << (place % 32);
  }
  void clear() noexcept { *this = {}; }
  [[nodiscard]] std::span<const std::uint64_t> words() const noexcept {
    return {words_, word_count_};
  }
  [[nodiscard]] std::uint32_t wake_bits() const noexcept { return wake_bits_; }

 private:
  std::uint64_t words_[kRingSlotCountMax / 64]{};
  std::size_t word_count_ = 0;
  std::uint32_t wake_bits_ = 0;
};

/// The end that writes.
/// @ownership the memory must outlive it
/// @threads  one at a time
/// @realtime wait-free, alloc-free
class RingWriter {
 public:
  /// Makes a ring of the memory, which is zero and ring_memory_size(2^n) bytes, aligned to a page.
  RingWriter(MutableBytes memory, std::uint64_t id) noexcept;

  /// Writes `events`, `event_count` of them, for `places`; false if they are larger than a quarter
  /// of the ring. Then ring the bell of the memory.
  [[nodiscard]] bool write(const SlotSet& places, ConstBytes events,
                           std::uint32_t event_count) noexcept;
  /// Where the next record begins.
  [[nodiscard]] std::uint64_t position() const noexcept { return head_; }
  /// A new reader takes the place: the subscription `owner`, not 0.
  void begin_slot(std::uint32_t place, std::uint64_t owner) noexcept;
  /// Nobody has the place any more.
  void end_slot(std::uint32_t place) noexcept;

 private:
  void put_word(std::uint64_t position, std::uint64_t value) noexcept;
  void put_bytes(std::uint64_t position, ConstBytes bytes) noexcept;
  void count_for(std::span<const std::uint64_t> words, std::uint32_t event_count) noexcept;

  RingControl* control_;
  std::uint64_t* data_;
  std::uint64_t size_;
  std::uint64_t head_ = 0;
};

/// What a reader found.
enum class RingRead : std::uint8_t {
  kEvents,   ///< Events for its place.
  kNothing,  ///< It has read all that there is.
  kOverrun,  ///< It was too slow, and goes on behind what is there.
  kGone,     ///< The place is another's by now.
  kBroken,   ///< The memory is no ring, or its writer does not keep the rules. Read no more.
};

/// An end that reads. What it reads it copies, then looks whether it was whole all the time, as the
/// writer does not wait for anybody.
/// @ownership the memory must outlive it; a buffer of one largest record
/// @threads  one
/// @realtime wait-free; alloc-free but for construction
class RingReader {
 public:
  /// Of the place `place` (below kRingSlotCountMax), which `owner` has, from the position `begin`
  /// on.
  RingReader(ConstBytes memory, std::uint32_t place, std::uint64_t owner, std::uint64_t begin);
  /// Whether the memory is the ring `id`.
  [[nodiscard]] static bool is_ring(ConstBytes memory, std::uint64_t id) noexcept;

  /// The next events for its place. `events()` is valid until the next call.
  [[nodiscard]] RingRead read() noexcept;
  [[nodiscard]] ConstBytes events() const noexcept { return events_; }
  /// Whether something was written since.
  [[nodiscard]] bool has_more() const noexcept {
    return control_->head.load(std::memory_order_acquire) != position_;
  }
  /// Events that were written for it so far, read or not.
  [[nodiscard]] std::uint64_t written_count() const noexcept {
    return control_->counts[place_].load(std::memory_order_acquire);
  }
  /// Events of those that it was given by read().
  void count_read(std::uint64_t event_count) noexcept { read_count_ += event_count; }
  [[nodiscard]] std::uint64_t read_count() const noexcept { return read_count_; }
  /// Events that it will never get, as far as is known when it has read all that there is.
  [[nodiscard]] std::uint64_t missed_count() const noexcept { return missed_count_; }

  /// For which the bell rings when there is more.
  [[nodiscard]] std::uint32_t wake_bits() const noexcept { return 1U << (place_ % 32); }

 private:
  [[nodiscard]] std::uint64_t word_at(std::uint64_t position) const noexcept;
  [[nodiscard]] bool is_overwritten(std::uint64_t position) const noexcept {
    return control_->reserved.load(std::memory_order_acquire) > position + size_;
  }
  [[nodiscard]] RingRead overrun() noexcept;

  const RingControl* control_;
  const std::uint64_t* data_;
  std::uint64_t size_;
  std::uint32_t place_;
  std::uint64_t owner_;
  std::uint64_t position_;
  std::uint64_t read_count_ = 0;
  std::uint64_t missed_count_ = 0;
  bool has_missed_ = false;
  std::vector<std::uint64_t> buffer_;
  ConstBytes events_{};
};

}  // namespace rtpm::events
