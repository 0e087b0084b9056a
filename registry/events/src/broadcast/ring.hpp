#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "rtpm/base/bytes.hpp"
#include "rtpm/events/event.hpp"

/// A ring in shared memory with one writer that never waits, and any number of readers that it does
/// not know. A slow reader is overrun and detects that. Each record has one bit per slot that it is
/// for.
///
/// Memory layout: control words, counts of each slot, then 2^n bytes of records.
namespace rtpm::events {

inline constexpr std::uint32_t kRingSlotCountMax = 1024;
/// The size of the records, in bytes.
inline constexpr std::size_t kRingSizeMin = std::size_t{64} * 1024;

/// The beginning of the memory.
struct RingControl {
  std::atomic<std::uint64_t> magic{0};
  std::atomic<std::uint64_t> id{0};
  std::atomic<std::uint64_t> size{0};  ///< The size of the records, in bytes.
  /// All records before this position are complete.
  alignas(64) std::atomic<std::uint64_t> head{0};
  /// Positions `size` before this one may already be overwritten.
  alignas(64) std::atomic<std::uint64_t> reserved{0};
  /// Events written for each slot.
  alignas(64) std::atomic<std::uint64_t> counts[kRingSlotCountMax]{};
  /// The subscription of each slot; 0 if none.
  std::atomic<std::uint64_t> owners[kRingSlotCountMax]{};
};
static_assert(std::atomic<std::uint64_t>::is_always_lock_free);

inline constexpr std::size_t kRingDataOffset = 20'480;
static_assert(sizeof(RingControl) <= kRingDataOffset);

/// Total bytes of a ring with `size` bytes of records.
[[nodiscard]] constexpr std::size_t ring_memory_size(std::size_t size) noexcept {
  return kRingDataOffset + size;
}

/// A set of slots. Sleepers wake by slot modulo 32.
class SlotSet {
 public:
  void add(std::uint32_t slot) noexcept {
    words_[slot / 64] |= std::uint64_t{1} << (slot % 64);
    if (slot / 64 >= word_count_) word_count_ = slot / 64 + 1;
    wake_bits_ |= 1U << (slot % 32);
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

/// The writing end.
/// @ownership the memory must outlive it
/// @realtime wait-free, alloc-free
class RingWriter {
 public:
  /// Initializes the ring in zeroed, page-aligned memory of ring_memory_size(2^n) bytes.
  RingWriter(MutableBytes memory, std::uint64_t id) noexcept;

  /// Writes a record for `slots`; false if it is larger than a quarter of the ring. The caller then
  /// rings the memory's doorbell.
  [[nodiscard]] bool write(const SlotSet& slots, ConstBytes events,
                           std::uint32_t event_count) noexcept;
  /// Position of the next record.
  [[nodiscard]] std::uint64_t position() const noexcept { return head_; }
  /// Assigns the slot to the subscription `owner`, which must not be 0.
  void begin_slot(std::uint32_t slot, std::uint64_t owner) noexcept;
  /// Frees the slot.
  void end_slot(std::uint32_t slot) noexcept;

 private:
  void put_word(std::uint64_t position, std::uint64_t value) noexcept;
  void put_bytes(std::uint64_t position, ConstBytes bytes) noexcept;
  void count_for(std::span<const std::uint64_t> words, std::uint32_t event_count) noexcept;

  RingControl* control_;
  std::uint64_t* data_;
  std::uint64_t size_;
  std::uint64_t head_ = 0;
};

/// Result of RingReader::read().
enum class RingRead : std::uint8_t {
  kEvents,   ///< Events for its slot.
  kNothing,  ///< No further records.
  kOverrun,  ///< Records were overwritten; continues with the newest.
  kGone,     ///< The slot has another owner.
  kBroken,   ///< The memory is malformed: stop reading.
};

/// The reading end. Copies a record, then checks that it was not overwritten meanwhile.
/// @ownership a buffer for the largest record; the memory must outlive it
/// @realtime wait-free; alloc-free except construction
class RingReader {
 public:
  /// Reads for `owner` in slot `slot` (below kRingSlotCountMax), from position `begin` on.
  RingReader(ConstBytes memory, std::uint32_t slot, std::uint64_t owner, std::uint64_t begin);
  /// Whether the memory is the ring `id`.
  [[nodiscard]] static bool is_ring(ConstBytes memory, std::uint64_t id) noexcept;

  /// The next events for its slot. `events()` is valid until the next call.
  [[nodiscard]] RingRead read() noexcept;
  [[nodiscard]] ConstBytes events() const noexcept { return events_; }
  /// Whether there are unread records.
  [[nodiscard]] bool has_more() const noexcept {
    return control_->head.load(std::memory_order_acquire) != position_;
  }
  /// Events written for this slot, read or not.
  [[nodiscard]] std::uint64_t written_count() const noexcept {
    return control_->counts[slot_].load(std::memory_order_acquire);
  }
  /// If the unread records, also those for other slots, take more than half of the ring, skips the
  /// oldest, down to a quarter. They count as missed.
  void catch_up() noexcept;
  /// Counts events that read() returned.
  void count_read(std::uint64_t event_count) noexcept { read_count_ += event_count; }
  [[nodiscard]] std::uint64_t read_count() const noexcept { return read_count_; }
  /// Events lost; complete once all records are read.
  [[nodiscard]] std::uint64_t missed_count() const noexcept { return missed_count_; }

  /// The doorbell bits that signal new records.
  [[nodiscard]] std::uint32_t wake_bits() const noexcept { return 1U << (slot_ % 32); }

 private:
  [[nodiscard]] std::uint64_t word_at(std::uint64_t position) const noexcept;
  [[nodiscard]] bool is_overwritten(std::uint64_t position) const noexcept {
    return control_->reserved.load(std::memory_order_acquire) > position + size_;
  }
  [[nodiscard]] RingRead overrun() noexcept;

  const RingControl* control_;
  const std::uint64_t* data_;
  std::uint64_t size_;
  std::uint32_t slot_;
  std::uint64_t owner_;
  std::uint64_t position_;
  std::uint64_t read_count_ = 0;
  std::uint64_t missed_count_ = 0;
  bool has_missed_ = false;
  std::vector<std::uint64_t> buffer_;
  ConstBytes events_{};
};

}  // namespace rtpm::events
