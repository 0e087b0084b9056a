#pragma once

#include <algorithm>
#include <atomic>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>

#include "rtpm/base/assert.hpp"
#include "rtpm/base/bytes.hpp"
#include "rtpm/base/expected.hpp"

namespace rtpm::inline base {

/// What the two ends of a record ring share besides the records: each word on a cache line of its
/// own, so that the line of one that is not written stays with both. Zero at first. In the order of
/// bytes of the host, which both ends are on.   Source: spec/hprotocol.md#hp-16.2.
struct RecordRingControl {
  /// Bytes ever written. The writer's.
  alignas(64) std::atomic<std::uint64_t> tail{0};
  /// Bytes ever read. The reader's.
  alignas(64) std::atomic<std::uint64_t> head{0};
  /// How the reader sleeps, if it does: a RecordSleep. It sets it; who takes it back wakes.
  alignas(64) std::atomic<std::uint32_t> sleeping{0};
};
static_assert(sizeof(RecordRingControl) == 192);
static_assert(std::atomic<std::uint64_t>::is_always_lock_free &&
              std::atomic<std::uint32_t>::is_always_lock_free);

/// Where the reader of a ring sleeps.   Source: spec/hprotocol.md#hp-16.3.
enum class RecordSleep : std::uint32_t {
  kAwake = 0,
  kAtBell = 1,   ///< Where a bell reaches it, with other things.
  kAtWord = 2,   ///< On the word that says so.
  kAtEvent = 3,  ///< Where an event of its own reaches it, with other things.
};

/// Records begin at multiples of this: a word with the size, the bytes, and what is left of the
/// last line.
inline constexpr std::size_t kRecordAlignment = 64;
inline constexpr std::size_t kRecordWordSize = 8;

/// How many bytes of a ring a record takes.   RT: alloc-free.
[[nodiscard]] constexpr std::size_t record_span(std::size_t size) noexcept {
  return (kRecordWordSize + size + kRecordAlignment - 1) / kRecordAlignment * kRecordAlignment;
}

/// The memory of the records, as words. Whoever shares it may write there at any time; so each word
/// is read once, by an atomic that orders nothing: what is read is some value, and nothing worse.
class RecordMemory {
 public:
  /// `data`: a power of two of bytes, aligned to a cache line.
  explicit RecordMemory(MutableBytes data) noexcept
      : words_(reinterpret_cast<std::uint64_t*>(data.data())), size_(data.size()) {
    RTPM_ASSERT(std::has_single_bit(data.size()) && data.size() >= kRecordAlignment &&
                    reinterpret_cast<std::uintptr_t>(data.data()) % kRecordAlignment == 0,
                "a ring is a power of two of bytes, from a cache line on");
  }
  [[nodiscard]] std::uint64_t size() const noexcept { return size_; }

  [[nodiscard]] std::uint64_t read_word(std::uint64_t position) const noexcept {
    return load(word_at(position));
  }
  /// Writes a record at `position`, size first.
  void write(std::uint64_t position, ConstBytes record) noexcept {
    std::uint64_t* const begin = word_at(position);
    store(begin, record.size());
    // The record is in one piece or, at the end of the memory, in two.
    const std::size_t first = std::min(record.size(), left_behind(begin));
    copy_in(record.first(first), begin + 1);
    copy_in(record.subspan(first), words_);
  }
  /// Copies the bytes of the record at `position`, which the caller found to be to.size().
  void read(std::uint64_t position, MutableBytes to) const noexcept {
    const std::uint64_t* const begin = word_at(position);
    const std::size_t first = std::min(to.size(), left_behind(begin));
    copy_out(begin + 1, to.first(first));
    copy_out(words_, to.subspan(first));
  }
  /// Takes the cache line at `position` for a write that will follow.
  void expect_write(std::uint64_t position) const noexcept {
#if defined(__x86_64__)
    // Compilers know this instruction only where they build for that processor alone; to others it
    // is none.
    __asm__ volatile("prefetchw %0" : : "m"(*word_at(position)));
#else
    __builtin_prefetch(word_at(position), 1);
#endif
  }

 private:
  [[nodiscard]] std::uint64_t* word_at(std::uint64_t position) const noexcept {
    return words_ + (position & (size_ - 1)) / kRecordWordSize;
  }
  /// Bytes from behind the size of a record to the end of the memory.
  [[nodiscard]] std::size_t left_behind(const std::uint64_t* begin) const noexcept {
    return size_ - static_cast<std::size_t>(begin + 1 - words_) * kRecordWordSize;
  }
  // NOLINTNEXTLINE(readability-non-const-parameter): what it points to is written.
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

/// The end of a record ring that writes. What the other end has written to the shared words is
/// never trusted.
/// Ownership: control and data must outlive it.   Threads: one.   RT: wait-free, alloc-free.
/// Source: spec/hprotocol.md#hp-16.2.
class RecordWriter {
 public:
  enum class Outcome : std::uint8_t {
    kWritten,
    kWrittenForBell,   ///< The reader sleeps: ring its bell.
    kWrittenForWord,   ///< The reader sleeps on sleeping(): wake it there.
    kWrittenForEvent,  ///< The reader sleeps: signal its event.
    kFull,             ///< Nothing was written. Try again when the reader has read.
    kBroken,           ///< The shared words hold nonsense: nothing was written; give it up.
  };

  RecordWriter(RecordRingControl& control, MutableBytes data) noexcept
      : control_(&control), memory_(data) {}

  /// Writes one record, which fits the ring and is not empty.
  [[nodiscard]] Outcome write(ConstBytes record) noexcept {
    const std::size_t span = record_span(record.size());
    RTPM_ASSERT(!record.empty() && span <= memory_.size(), "a record fits its ring");
    // hp-16.2-1
    if (tail_ + span - head_ > memory_.size()) {
      // SYNC POINT record-free: the reader is done with what is before head.
      const std::uint64_t head = control_->head.load(std::memory_order_acquire);
      // hp-16.2-2: it moves on between where it was and what was written.
      if (head - head_ > tail_ - head_ || head % kRecordAlignment != 0) return Outcome::kBroken;
      head_ = head;
      if (tail_ + span - head_ > memory_.size()) return Outcome::kFull;
    }
    memory_.write(tail_, record);
    tail_ += span;
    // SYNC POINT record-written: the record is whole.
    // SYNC POINT record-sleep: tail first, then a look at sleeping; the reader does it the other
    // way round. Sequentially consistent, so that one of both sees the other.
    control_->tail.store(tail_, std::memory_order_seq_cst);
    // hp-16.3-1: of several records for one sleeper only the first wakes it.
    std::uint32_t sleep = control_->sleeping.load(std::memory_order_seq_cst);
    if (sleep != 0) sleep = control_->sleeping.exchange(0, std::memory_order_relaxed);
    // The reader has these lines from the last time round. To take them now, and not when the next
    // record is written, spares that record the way to the other core. It will be as large.
    constexpr std::size_t kExpectedMax = 256;
    for (std::size_t ahead = 0; ahead < std::min(span, kExpectedMax); ahead += kRecordAlignment) {
      memory_.expect_write(tail_ + ahead);
    }
    if (sleep == 0) return Outcome::kWritten;
    if (sleep == static_cast<std::uint32_t>(RecordSleep::kAtWord)) return Outcome::kWrittenForWord;
    if (sleep == static_cast<std::uint32_t>(RecordSleep::kAtEvent))
      return Outcome::kWrittenForEvent;
    return Outcome::kWrittenForBell;
  }
  [[nodiscard]] std::atomic<std::uint32_t>& sleeping() const noexcept { return control_->sleeping; }

 private:
  RecordRingControl* control_;
  RecordMemory memory_;
  std::uint64_t tail_ = 0;  ///< Ours; the shared word is only told.
  std::uint64_t head_ = 0;  ///< The reader's, as last seen.
};

/// Why a record ring gave no record.
enum class RecordError : std::uint8_t {
  kEmpty,   ///< There is none now.
  kBroken,  ///< The shared words hold nonsense. Read no more.
};

/// The end of a record ring that reads. What the other end has written to the shared words is never
/// trusted.
/// Ownership: control and data must outlive it.   Threads: one.   RT: wait-free, alloc-free.
/// Source: spec/hprotocol.md#hp-16.2.
class RecordReader {
 public:
  RecordReader(RecordRingControl& control, MutableBytes data) noexcept
      : control_(&control), memory_(data) {}

  /// Whether there may be a record.
  [[nodiscard]] bool has_record() const noexcept {
    return tail_ != head_ || control_->tail.load(std::memory_order_relaxed) != head_;
  }

  /// Copies the next record to the begin of `to`, which holds the largest allowed; gives its size.
  [[nodiscard]] expected<std::size_t, RecordError> read(MutableBytes to) noexcept {
    if (tail_ == head_) {
      // SYNC POINT record-written
      const std::uint64_t tail = control_->tail.load(std::memory_order_acquire);
      if (tail == head_) return unexpected{RecordError::kEmpty};
      // hp-16.2-2: no more can be there than the ring holds.
      if (tail - head_ > memory_.size() || tail % kRecordAlignment != 0) {
        return unexpected{RecordError::kBroken};
      }
      tail_ = tail;
    }
    const std::uint64_t size = memory_.read_word(head_);
    // hp-16.2-3: from here on only our copy of the size counts.
    if (size == 0 || size > to.size() || record_span(size) > tail_ - head_) {
      return unexpected{RecordError::kBroken};
    }
    memory_.read(head_, to.first(size));
    head_ += record_span(size);
    // SYNC POINT record-free
    control_->head.store(head_, std::memory_order_release);
    return size;
  }

  /// Says that the reader is about to sleep; false if there is a record by now, so that it must
  /// not.
  [[nodiscard]] bool announce_sleep(RecordSleep sleep) noexcept {
    // SYNC POINT record-sleep
    control_->sleeping.store(static_cast<std::uint32_t>(sleep), std::memory_order_seq_cst);
    return tail_ == head_ && control_->tail.load(std::memory_order_seq_cst) == head_;
  }
  /// The reader is awake.
  void end_sleep() noexcept { control_->sleeping.store(0, std::memory_order_relaxed); }
  [[nodiscard]] std::atomic<std::uint32_t>& sleeping() const noexcept { return control_->sleeping; }

 private:
  RecordRingControl* control_;
  RecordMemory memory_;
  std::uint64_t head_ = 0;  ///< Ours; the shared word is only told.
  std::uint64_t tail_ = 0;  ///< The writer's, as last seen.
};

}  // namespace rtpm::inline base
