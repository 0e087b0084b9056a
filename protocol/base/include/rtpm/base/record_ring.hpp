#pragma once

#include <algorithm>
#include <atomic>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>

#include "rtpm/base/assert.hpp"
#include "rtpm/base/bytes.hpp"
#include "rtpm/base/compiler.hpp"
#include "rtpm/base/expected.hpp"

namespace rtpm::inline base {

/// The shared words of a record ring, besides the records. Each side's words have their own cache
/// lines, so both cores keep a line while neither writes. Initially zero; in native byte order, as
/// one host runs both ends.
/// @source   spec/hprotocol.md#hp-16.2
struct RecordRingControl {
  /// Set by the writer: bytes ever written to the ring.
  alignas(64) std::atomic<std::uint64_t> tail{0};
  /// Set by the reader: bytes ever read from the ring.
  alignas(64) std::atomic<std::uint64_t> head{0};
  /// Set by the reader: the number of the last record read.
  std::atomic<std::uint32_t> taken{0};
  /// Set by the reader: a RecordSleep. A writer that resets it wakes the reader.
  alignas(64) std::atomic<std::uint32_t> sleeping{0};
};
static_assert(sizeof(RecordRingControl) == 192);
static_assert(std::atomic<std::uint64_t>::is_always_lock_free &&
              std::atomic<std::uint32_t>::is_always_lock_free);

/// The word that the reader of a ring sleeps on.
/// @source   spec/hprotocol.md#hp-16.3
enum class RecordSleep : std::uint32_t {
  kAwake = 0,
  kAtBell = 1,   ///< On several descriptors, one of which is the bell's.
  kAtWord = 2,   ///< On the word RecordRingControl::sleeping.
  kAtEvent = 3,  ///< On several descriptors, one of which is the reader's eventfd.
};

/// A record is a word with its number and size, its bytes, and padding to a multiple of this.
inline constexpr std::size_t kRecordAlignment = 64;
inline constexpr std::size_t kRecordWordSize = 8;

/// A short record is stored in the slot of its number instead, once the slot's previous record was
/// read. Its word announces it, so notice and record cross between the cores together, on one of a
/// few lines that both cores keep.
inline constexpr std::size_t kRecordSlotSize = 256;
inline constexpr std::uint32_t kRecordSlotCount = 16;
inline constexpr std::size_t kRecordSlotsSize = kRecordSlotSize * kRecordSlotCount;
inline constexpr std::size_t kShortRecordMax = kRecordSlotSize - kRecordWordSize;

/// The slot of a record, as an offset.
[[nodiscard]] constexpr std::uint64_t record_slot_position(std::uint32_t number) noexcept {
  return std::uint64_t{number % kRecordSlotCount} * kRecordSlotSize;
}

/// The ring bytes that a record of `size` bytes takes.
[[nodiscard]] constexpr std::size_t record_span(std::size_t size) noexcept {
  return (kRecordWordSize + size + kRecordAlignment - 1) / kRecordAlignment * kRecordAlignment;
}

/// The word before a record. Records are numbered from 1, modulo 2^32.
struct RecordWord {
  std::uint32_t size = 0;
  std::uint32_t number = 0;

  [[nodiscard]] static constexpr RecordWord of(std::uint64_t word) noexcept {
    return {static_cast<std::uint32_t>(word), static_cast<std::uint32_t>(word >> 32)};
  }
  [[nodiscard]] constexpr std::uint64_t value() const noexcept {
    return std::uint64_t{number} << 32 | size;
  }
};

/// The memory of the records, as words. The peer may write there at any time, so each word is read
/// once, by a relaxed atomic: its value may be anything, but the behaviour is defined.
class RecordMemory {
 public:
  /// @param data  its size is a power of two; aligned to a cache line
  explicit RecordMemory(MutableBytes data) noexcept
      : words_(reinterpret_cast<std::uint64_t*>(data.data())), size_(data.size()) {
    RTPM_ASSERT(std::has_single_bit(data.size()) && data.size() >= kRecordAlignment &&
                    reinterpret_cast<std::uintptr_t>(data.data()) % kRecordAlignment == 0,
                "a ring is a power of two of bytes, from a cache line on");
  }
  [[nodiscard]] std::uint64_t size() const noexcept { return size_; }

  /// The word at `position`, a multiple of kRecordAlignment.
  [[nodiscard]] std::atomic_ref<std::uint64_t> word(std::uint64_t position) const noexcept {
    return std::atomic_ref<std::uint64_t>(*word_at(position));
  }
  /// Writes the bytes of a record after the word at `position`.
  void write(std::uint64_t position, ConstBytes record) noexcept {
    std::uint64_t* const begin = word_at(position);
    // A record that reaches the end of the memory wraps to its beginning.
    const std::size_t first = std::min(record.size(), left_behind(begin));
    copy_in(record.first(first), begin + 1);
    copy_in(record.subspan(first), words_);
  }
  /// Like write(), for a record that does not wrap. Writes the first cache line last, as the word,
  /// which is written next, is on the same line.
  void write_backwards(std::uint64_t position, ConstBytes record) noexcept {
    std::uint64_t* const begin = word_at(position);
    const std::size_t first = std::min(record.size(), kRecordAlignment - kRecordWordSize);
    copy_in(record.subspan(first), begin + kRecordAlignment / kRecordWordSize);
    copy_in(record.first(first), begin + 1);
  }
  /// Copies the bytes of the record at `position`; the caller has checked its size, to.size().
  void read(std::uint64_t position, MutableBytes to) const noexcept {
    const std::uint64_t* const begin = word_at(position);
    const std::size_t first = std::min(to.size(), left_behind(begin));
    copy_out(begin + 1, to.first(first));
    copy_out(words_, to.subspan(first));
  }
  /// Prefetches the cache line at `position` for writing.
  void expect_write(std::uint64_t position) const noexcept {
    prefetch_for_write(word_at(position));
  }

 private:
  [[nodiscard]] std::uint64_t* word_at(std::uint64_t position) const noexcept {
    return words_ + (position & (size_ - 1)) / kRecordWordSize;
  }
  /// The bytes from after the word at `begin` to the end of the memory.
  [[nodiscard]] std::size_t left_behind(const std::uint64_t* begin) const noexcept {
    return size_ - static_cast<std::size_t>(begin + 1 - words_) * kRecordWordSize;
  }
  // NOLINTNEXTLINE(readability-non-const-parameter): `*to` is written.
  static void store(std::uint64_t* to, std::uint64_t value) noexcept {
    std::atomic_ref<std::uint64_t>(*to).store(value, std::memory_order_relaxed);
  }
  static std::uint64_t load(const std::uint64_t* from) noexcept {
    return std::atomic_ref<std::uint64_t>(*const_cast<std::uint64_t*>(from))
        .load(std::memory_order_relaxed);
  }
  static void copy_in(ConstBytes from, std::uint64_t* to) noexcept {
    const std::byte* at = from.data();
    for (std::size_t count = from.size() / kRecordWordSize; count > 0; --count) {
      std::uint64_t value = 0;
      std::memcpy(&value, at, sizeof value);
      store(to++, value);
      at += sizeof value;
    }
    if (const std::size_t rest = from.size() % kRecordWordSize; rest > 0) {
      std::uint64_t value = 0;
      std::memcpy(&value, at, rest);
      store(to, value);
    }
  }
  static void copy_out(const std::uint64_t* from, MutableBytes to) noexcept {
    std::byte* at = to.data();
    for (std::size_t count = to.size() / kRecordWordSize; count > 0; --count) {
      const std::uint64_t value = load(from++);
      std::memcpy(at, &value, sizeof value);
      at += sizeof value;
    }
    if (const std::size_t rest = to.size() % kRecordWordSize; rest > 0) {
      const std::uint64_t value = load(from);
      std::memcpy(at, &value, rest);
    }
  }

  std::uint64_t* words_;
  std::uint64_t size_;
};

/// The memory of one direction.
struct RecordRingMemory {
  RecordRingControl& control;
  MutableBytes slots;    ///< kRecordSlotsSize bytes.
  MutableBytes records;  ///< The ring; its size is a power of two.
};

/// The writing end of a record ring. Never trusts the shared words written by the reader.
/// @ownership refers to the memory, which must outlive it
/// @threads  one
/// @realtime wait-free, alloc-free
/// @source   spec/hprotocol.md#hp-16.2
class RecordWriter {
 public:
  enum class Outcome : std::uint8_t {
    kWritten,
    kWrittenForBell,   ///< The reader sleeps: ring its bell.
    kWrittenForWord,   ///< The reader sleeps on sleeping(): wake it there.
    kWrittenForEvent,  ///< The reader sleeps: signal its event.
    kFull,             ///< Nothing was written. Try again when the reader has read.
    kBroken,           ///< Nothing was written: the shared words are invalid. Stop using the ring.
  };

  explicit RecordWriter(const RecordRingMemory& memory) noexcept
      : control_(&memory.control), slots_(memory.slots), ring_(memory.records) {}

  /// @param record  not empty, and fits the ring
  [[nodiscard]] Outcome write(ConstBytes record) noexcept {
    RTPM_ASSERT(!record.empty() && record_span(record.size()) <= ring_.size(),
                "a record fits its ring");
    if (record.size() <= kShortRecordMax) {
      if (!has_slot() && !learn_taken()) return Outcome::kBroken;
      if (has_slot()) return write_to_slot(record);
    }
    return write_to_ring(record);
  }
  /// Whether the ring is empty, or at least half of it stays free after a record of `size` bytes.
  /// Also true if the shared words are invalid: write() then reports kBroken.
  [[nodiscard]] bool has_spare_capacity(std::size_t size) noexcept {
    const auto is_there = [&] {
      return tail_ == head_ || tail_ + record_span(size) - head_ <= ring_.size() / 2;
    };
    if (is_there()) return true;
    // SYNC POINT record-free
    const std::uint64_t head = control_->head.load(std::memory_order_acquire);
    if (head - head_ > tail_ - head_ || head % kRecordAlignment != 0) return true;
    head_ = head;
    return is_there();
  }
  [[nodiscard]] std::atomic<std::uint32_t>& sleeping() const noexcept { return control_->sleeping; }
  /// The number of written but unread records, as the reader reports it.
  [[nodiscard]] std::uint32_t unread_count() const noexcept {
    // hp-16.2-2: a count above the records written is ignored.
    const std::uint32_t taken = control_->taken.load(std::memory_order_acquire);
    const bool is_possible = taken - taken_ <= number_ - 1 - taken_;
    return number_ - 1 - (is_possible ? taken : taken_);
  }

 private:
  /// Whether the next record's slot is known to be free.
  [[nodiscard]] bool has_slot() const noexcept { return number_ - taken_ <= kRecordSlotCount; }
  /// hp-16.2-2: false if the reader's count exceeds the records written, or decreased.
  [[nodiscard]] bool learn_taken() noexcept {
    // SYNC POINT slot-free: the reader has finished with this record and earlier ones.
    const std::uint32_t taken = control_->taken.load(std::memory_order_acquire);
    if (taken - taken_ > number_ - 1 - taken_) return false;
    taken_ = taken;
    return true;
  }

  [[nodiscard]] Outcome write_to_slot(ConstBytes record) noexcept {
    const std::uint64_t position = record_slot_position(number_);
    slots_.write_backwards(position, record);
    // SYNC POINT slot-written: the record is complete.
    slots_.word(position).store(next_word(record), std::memory_order_seq_cst);
    const Outcome outcome = wake();
    // Reads the count early, so that a later write does not wait for this line.
    if (number_ - taken_ > kRecordSlotCount / 2) static_cast<void>(learn_taken());
    return outcome;
  }

  [[nodiscard]] Outcome write_to_ring(ConstBytes record) noexcept {
    const std::size_t span = record_span(record.size());
    // hp-16.2-1
    if (tail_ + span - head_ > ring_.size()) {
      // SYNC POINT record-free: the reader has finished with the bytes before head.
      const std::uint64_t head = control_->head.load(std::memory_order_acquire);
      // hp-16.2-2: head never decreases, nor exceeds the bytes written.
      if (head - head_ > tail_ - head_ || head % kRecordAlignment != 0) return Outcome::kBroken;
      head_ = head;
      if (tail_ + span - head_ > ring_.size()) return Outcome::kFull;
    }
    ring_.write(tail_, record);
    ring_.word(tail_).store(next_word(record), std::memory_order_relaxed);
    tail_ += span;
    // SYNC POINT record-written: the record is complete.
    control_->tail.store(tail_, std::memory_order_seq_cst);
    const Outcome outcome = wake();
    // The reader's core still holds these lines from the last round. Prefetching them now avoids
    // delaying the next record, which is assumed to have the same size.
    constexpr std::size_t kExpectedMax = 256;
    for (std::size_t ahead = 0; ahead < std::min(span, kExpectedMax); ahead += kRecordAlignment) {
      ring_.expect_write(tail_ + ahead);
    }
    return outcome;
  }

  [[nodiscard]] std::uint64_t next_word(ConstBytes record) noexcept {
    return RecordWord{static_cast<std::uint32_t>(record.size()), number_++}.value();
  }

  /// How to wake the reader, if it sleeps.
  [[nodiscard]] Outcome wake() noexcept {
    // SYNC POINT record-sleep: the writer stores the record, then loads `sleeping`; the reader does
    // the reverse. Sequentially consistent, so at least one sees the other. hp-16.3-1: of several
    // records for one sleeper, only the first wakes it.
    std::uint32_t sleep = control_->sleeping.load(std::memory_order_seq_cst);
    if (sleep != 0) sleep = control_->sleeping.exchange(0, std::memory_order_relaxed);
    if (sleep == 0) return Outcome::kWritten;
    if (sleep == static_cast<std::uint32_t>(RecordSleep::kAtWord)) return Outcome::kWrittenForWord;
    if (sleep == static_cast<std::uint32_t>(RecordSleep::kAtEvent))
      return Outcome::kWrittenForEvent;
    return Outcome::kWrittenForBell;
  }

  RecordRingControl* control_;
  RecordMemory slots_;
  RecordMemory ring_;
  std::uint32_t number_ = 1;  ///< The next record's number.
  std::uint32_t taken_ = 0;   ///< The last record read, as last seen.
  std::uint64_t tail_ = 0;    ///< The shared word is a copy of this and never read back.
  std::uint64_t head_ = 0;    ///< The reader's head, as last seen.
};

/// Why a record ring returned no record.
enum class RecordError : std::uint8_t {
  kEmpty,   ///< There is no record now.
  kBroken,  ///< The shared words are invalid. Stop using the ring.
};

/// The reading end of a record ring. Never trusts the shared words written by the writer.
/// @ownership refers to the memory, which must outlive it
/// @threads  one
/// @realtime wait-free, alloc-free
/// @source   spec/hprotocol.md#hp-16.2
class RecordReader {
 public:
  explicit RecordReader(const RecordRingMemory& memory) noexcept
      : control_(&memory.control), slots_(memory.slots), ring_(memory.records) {}

  /// Whether there may be a record.
  [[nodiscard]] bool has_record() const noexcept {
    return has_slot(std::memory_order_relaxed) || tail_ != head_ ||
           control_->tail.load(std::memory_order_relaxed) != head_;
  }

  /// Copies the next record to the beginning of `to`.
  /// @param to  must hold the largest record allowed
  /// @return the record's size
  [[nodiscard]] expected<std::size_t, RecordError> read(MutableBytes to) noexcept {
    // SYNC POINT slot-written
    if (has_slot(std::memory_order_acquire)) return read_slot(to);
    if (tail_ == head_) {
      // SYNC POINT record-written
      const std::uint64_t tail = control_->tail.load(std::memory_order_acquire);
      if (tail == head_) return unexpected{RecordError::kEmpty};
      // hp-16.2-2: the ring can't hold more.
      if (tail - head_ > ring_.size() || tail % kRecordAlignment != 0) {
        return unexpected{RecordError::kBroken};
      }
      tail_ = tail;
      // The record before it may have reached its slot since the check above.
      if (has_slot(std::memory_order_acquire)) return read_slot(to);
    }
    return read_ring(to);
  }

  /// Announces that the reader is about to sleep.
  /// @return false if a record has arrived: do not sleep
  [[nodiscard]] bool announce_sleep(RecordSleep sleep) noexcept {
    // SYNC POINT record-sleep
    control_->sleeping.store(static_cast<std::uint32_t>(sleep), std::memory_order_seq_cst);
    return !has_slot(std::memory_order_seq_cst) && tail_ == head_ &&
           control_->tail.load(std::memory_order_seq_cst) == head_;
  }
  void end_sleep() noexcept { control_->sleeping.store(0, std::memory_order_relaxed); }
  [[nodiscard]] std::atomic<std::uint32_t>& sleeping() const noexcept { return control_->sleeping; }

 private:
  /// Whether the next record is in its slot.
  [[nodiscard]] bool has_slot(std::memory_order order) const noexcept {
    return RecordWord::of(slots_.word(record_slot_position(number_)).load(order)).number == number_;
  }

  [[nodiscard]] expected<std::size_t, RecordError> read_slot(MutableBytes to) noexcept {
    const std::uint64_t position = record_slot_position(number_);
    const auto word = RecordWord::of(slots_.word(position).load(std::memory_order_relaxed));
    // hp-16.2-3: from here on only this copy of the size counts.
    if (word.size == 0 || word.size > std::min(kShortRecordMax, to.size())) {
      return unexpected{RecordError::kBroken};
    }
    slots_.read(position, to.first(word.size));
    return taken(word.size);
  }

  [[nodiscard]] expected<std::size_t, RecordError> read_ring(MutableBytes to) noexcept {
    const auto word = RecordWord::of(ring_.word(head_).load(std::memory_order_relaxed));
    // hp-16.2-3, hp-16.2-4
    if (word.number != number_ || word.size == 0 || word.size > to.size() ||
        record_span(word.size) > tail_ - head_) {
      return unexpected{RecordError::kBroken};
    }
    ring_.read(head_, to.first(word.size));
    head_ += record_span(word.size);
    // SYNC POINT record-free
    control_->head.store(head_, std::memory_order_release);
    return taken(word.size);
  }

  [[nodiscard]] std::size_t taken(std::size_t size) noexcept {
    // SYNC POINT slot-free
    control_->taken.store(number_++, std::memory_order_release);
    return size;
  }

  RecordRingControl* control_;
  RecordMemory slots_;
  RecordMemory ring_;
  std::uint32_t number_ = 1;  ///< The next record's number.
  std::uint64_t head_ = 0;    ///< The shared word is a copy of this and never read back.
  std::uint64_t tail_ = 0;    ///< The writer's tail, as last seen.
};

}  // namespace rtpm::inline base
