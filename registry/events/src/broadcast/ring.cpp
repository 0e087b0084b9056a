#include "broadcast/ring.hpp"

#include <algorithm>
#include <bit>
#include <cstring>
#include <new>

#include "rtpm/base/assert.hpp"

namespace rtpm::events {
namespace {

constexpr std::uint64_t kMagic = 0x3147'4e49'5250'5452;  // "RTPRING1"
constexpr std::size_t kWord = sizeof(std::uint64_t);

// A record consists of position, shape, the slots it is for, and events, each part padded to 16
// bytes. A record without slots fills the ring's end.
constexpr std::size_t kRecordHeaderSize = 16;
constexpr std::size_t kRecordAlignment = 16;

constexpr std::size_t rounded(std::size_t size) noexcept {
  return (size + kRecordAlignment - 1) / kRecordAlignment * kRecordAlignment;
}

// A record's size, words of slots and bytes of events; see pack().
struct Shape {
  std::uint64_t span = 0;
  std::uint64_t slot_words = 0;
  std::uint64_t event_bytes = 0;
};

std::uint64_t pack(const Shape& shape) noexcept {
  return shape.span / kRecordAlignment << 40 | shape.slot_words << 32 | shape.event_bytes;
}

Shape unpack(std::uint64_t word) noexcept {
  return {(word >> 40) * kRecordAlignment, word >> 32 & 0xff, word & 0xffff'ffff};
}

bool is_possible(const Shape& shape) noexcept {
  return shape.span >= kRecordHeaderSize && shape.slot_words <= kRingSlotCountMax / 64 &&
         kRecordHeaderSize + rounded(shape.slot_words * kWord) + rounded(shape.event_bytes) <=
             shape.span;
}

}  // namespace

RingWriter::RingWriter(MutableBytes memory, std::uint64_t id) noexcept
    : control_(new (memory.data()) RingControl),
      data_(reinterpret_cast<std::uint64_t*>(memory.data() + kRingDataOffset)),
      size_(memory.size() - kRingDataOffset) {
  RTPM_ASSERT(std::has_single_bit(size_) && size_ >= kRingSizeMin, "a ring has 2^n bytes");
  control_->id.store(id, std::memory_order_relaxed);
  control_->size.store(size_, std::memory_order_relaxed);
  control_->magic.store(kMagic, std::memory_order_release);
}

// Released word by word, so that a reader of a word also sees `reserved`.
void RingWriter::put_word(std::uint64_t position, std::uint64_t value) noexcept {
  std::atomic_ref<std::uint64_t>(data_[(position & (size_ - 1)) / kWord])
      .store(value, std::memory_order_release);
}

void RingWriter::put_bytes(std::uint64_t position, ConstBytes bytes) noexcept {
  for (std::size_t at = 0; at < bytes.size(); at += kWord) {
    std::uint64_t value = 0;
    std::memcpy(&value, bytes.data() + at, std::min(kWord, bytes.size() - at));
    put_word(position + at, value);
  }
}

bool RingWriter::write(const SlotSet& slots, ConstBytes events,
                       std::uint32_t event_count) noexcept {
  const std::span<const std::uint64_t> words = slots.words();
  const std::size_t slot_bytes = rounded(words.size() * kWord);
  const std::size_t span = kRecordHeaderSize + slot_bytes + rounded(events.size());
  if (span > size_ / 4) return false;
  const std::uint64_t to_end = size_ - (head_ & (size_ - 1));
  const std::uint64_t filler = span > to_end ? to_end : 0;
  // SYNC POINT ring-overwrite: published before any word changes.
  control_->reserved.store(head_ + filler + span, std::memory_order_seq_cst);
  if (filler > 0) {
    put_word(head_, head_);
    put_word(head_ + kWord, pack({filler, 0, 0}));
    head_ += filler;
  }
  put_word(head_, head_);
  put_word(head_ + kWord, pack({span, words.size(), events.size()}));
  for (std::size_t i = 0; i < words.size(); ++i)
    put_word(head_ + kRecordHeaderSize + i * kWord, words[i]);
  put_bytes(head_ + kRecordHeaderSize + slot_bytes, events);
  head_ += span;
  // SYNC POINT ring-written
  control_->head.store(head_, std::memory_order_release);
  count_for(words, event_count);
  return true;
}

// After the record, so that no count exceeds the readable events.
void RingWriter::count_for(std::span<const std::uint64_t> words,
                           std::uint32_t event_count) noexcept {
  for (std::size_t i = 0; i < words.size(); ++i) {
    for (std::uint64_t left = words[i]; left != 0; left &= left - 1) {
      auto& count = control_->counts[i * 64 + static_cast<std::size_t>(std::countr_zero(left))];
      count.store(count.load(std::memory_order_relaxed) + event_count, std::memory_order_release);
    }
  }
}

void RingWriter::begin_slot(std::uint32_t slot, std::uint64_t owner) noexcept {
  // SYNC POINT ring-owner: published before the new owner's first record.
  control_->owners[slot].store(owner, std::memory_order_release);
  control_->counts[slot].store(0, std::memory_order_release);
}

void RingWriter::end_slot(std::uint32_t slot) noexcept {
  control_->owners[slot].store(0, std::memory_order_release);
}

bool RingReader::is_ring(ConstBytes memory, std::uint64_t id) noexcept {
  if (memory.size() < ring_memory_size(kRingSizeMin)) return false;
  const auto* const control = reinterpret_cast<const RingControl*>(memory.data());
  return control->magic.load(std::memory_order_acquire) == kMagic &&
         control->id.load(std::memory_order_relaxed) == id &&
         control->size.load(std::memory_order_relaxed) == memory.size() - kRingDataOffset &&
         std::has_single_bit(memory.size() - kRingDataOffset);
}

RingReader::RingReader(ConstBytes memory, std::uint32_t slot, std::uint64_t owner,
                       std::uint64_t begin)
    : control_(reinterpret_cast<const RingControl*>(memory.data())),
      data_(reinterpret_cast<const std::uint64_t*>(memory.data() + kRingDataOffset)),
      size_(memory.size() - kRingDataOffset),
      slot_(slot % kRingSlotCountMax),
      owner_(owner),
      position_(begin),
      // One word more, so that events can be aligned to 16 bytes.
      buffer_(size_ / 4 / kWord + 2) {}

std::uint64_t RingReader::word_at(std::uint64_t position) const noexcept {
  // atomic_ref does not accept const; only loads are made.
  auto& word = const_cast<std::uint64_t&>(data_[(position & (size_ - 1)) / kWord]);
  return std::atomic_ref<std::uint64_t>(word).load(std::memory_order_acquire);
}

RingRead RingReader::overrun() noexcept {
  position_ = control_->head.load(std::memory_order_acquire);
  has_missed_ = true;
  return RingRead::kOverrun;
}

void RingReader::catch_up() noexcept {
  const std::uint64_t head = control_->head.load(std::memory_order_acquire);
  if (head - position_ <= size_ / 2) return;
  while (head - position_ > size_ / 4) {
    const std::uint64_t stated = word_at(position_);
    const Shape shape = unpack(word_at(position_ + kWord));
    // read() finds out and reports.
    if (stated != position_ || !is_possible(shape) || shape.span > size_ / 4) return;
    const bool has_slots = slot_ / 64 < shape.slot_words;
    const std::uint64_t slots =
        has_slots ? word_at(position_ + kRecordHeaderSize + slot_ / 64 * kWord) : 0;
    if (is_overwritten(position_)) return;
    position_ += shape.span;
    if ((slots >> (slot_ % 64) & 1) == 0) continue;
    // At least one; read() corrects it.
    ++missed_count_;
    has_missed_ = true;
  }
}

RingRead RingReader::read() noexcept {
  while (true) {
    // SYNC POINT ring-written
    if (control_->head.load(std::memory_order_acquire) == position_) {
      // All events counted so far have been read or are lost.
      const std::uint64_t known = read_count_ + missed_count_;
      const std::uint64_t written = has_missed_ ? written_count() : 0;
      if (has_missed_ && !has_more() && written > known) missed_count_ += written - known;
      return RingRead::kNothing;
    }
    const std::uint64_t stated = word_at(position_);
    const Shape shape = unpack(word_at(position_ + kWord));
    // SYNC POINT ring-overwrite: what was read is valid only if this is false.
    if (is_overwritten(position_)) return overrun();
    if (stated != position_ || !is_possible(shape) || shape.span > size_) return RingRead::kBroken;
    const std::uint64_t begin = position_;
    position_ += shape.span;
    if (slot_ / 64 >= shape.slot_words) continue;
    const std::uint64_t slots = word_at(begin + kRecordHeaderSize + slot_ / 64 * kWord);
    if ((slots >> (slot_ % 64) & 1) == 0) {
      if (is_overwritten(begin)) return overrun();
      continue;
    }
    if (shape.event_bytes > (buffer_.size() - 2) * kWord) return RingRead::kBroken;
    const std::uint64_t from = begin + kRecordHeaderSize + rounded(shape.slot_words * kWord);
    const bool is_shifted = reinterpret_cast<std::uintptr_t>(buffer_.data()) % 16 != 0;
    std::uint64_t* const to = buffer_.data() + (is_shifted ? 1 : 0);
    for (std::size_t at = 0; at < shape.event_bytes; at += kWord)
      to[at / kWord] = word_at(from + at);
    if (is_overwritten(begin)) return overrun();
    // SYNC POINT ring-owner: a record of the next owner becomes visible only after its id.
    if (control_->owners[slot_].load(std::memory_order_acquire) != owner_) return RingRead::kGone;
    events_ = std::as_bytes(std::span(to, buffer_.size() - 1)).first(shape.event_bytes);
    return RingRead::kEvents;
  }
}

}  // namespace rtpm::events
