#include "rtpm/wire/stream.hpp"

#include <algorithm>
#include <bit>
#include <cstring>

#include "rtpm/base/assert.hpp"

namespace rtpm::wire {
namespace {

// How far `number` is ahead of `of`, modulo 2^32: counts of frames, items and bytes wrap around.
std::int32_t ahead(std::uint32_t number, std::uint32_t of) noexcept {
  return static_cast<std::int32_t>(number - of);
}

}  // namespace

void encode(const StreamCredit& credit, MutableBytes to) noexcept {
  ByteWriter writer(to);
  writer.put(credit.first_missing);
  writer.put(credit.byte_limit);
  writer.put(credit.later);
  RTPM_ASSERT(writer.ok() && writer.size() == StreamCredit::kSize, "CREDIT has its size");
}

std::optional<StreamCredit> decode_credit(ConstBytes payload) noexcept {
  if (payload.size() != StreamCredit::kSize) return std::nullopt;
  ByteReader reader(payload);
  StreamCredit credit;
  credit.first_missing = reader.take<std::uint32_t>();
  credit.byte_limit = reader.take<std::uint32_t>();
  credit.later = reader.take<std::uint64_t>();
  return credit;
}

void OutgoingStream::begin(const Header& header, const Buffers& buffers, Medium medium,
                           std::uint32_t first) noexcept {
  RTPM_ASSERT(
      buffers.fragment_size >= 1 && kHeaderSize + buffers.fragment_size <= buffers.frame_size,
      "a frame holds a fragment");
  // A power of two, so that the slots stay in order when the numbers wrap around.
  window_ = static_cast<std::uint32_t>(std::bit_floor(
      std::min<std::size_t>(buffers.memory.size() / buffers.frame_size, kStreamWindow)));
  RTPM_ASSERT(window_ >= 1, "a stream has memory for a frame");
  header_ = header;
  header_.kind = FrameKind::kItem;
  header_.flags = 0;
  header_.budget_us = 0;
  header_.fragment_index = 0;
  header_.fragment_count = 1;
  buffers_ = buffers;
  medium_ = medium;
  count_ = first_missing_ = first;
  item_count_ = 0;
  item_limit_ = header.item;
  byte_count_ = 0;
  byte_limit_ = stream_bytes_first(medium);
  repairs_ = 0;
}

std::byte* OutgoingStream::frame_of(std::uint32_t number) const noexcept {
  return buffers_.memory.data() + (is_kept() ? number % window_ : 0) * buffers_.frame_size;
}

ConstBytes OutgoingStream::push(ConstBytes item, MonotonicTime now) noexcept {
  // hp-5.10-2
  if (!is_begun() || (!is_midway() && ahead(item_limit_, item_count_) <= 0)) return {};
  if (is_kept() && count_ - first_missing_ >= window_) return {};
  const std::size_t at = std::size_t{header_.fragment_index} * buffers_.fragment_size;
  RTPM_ASSERT(!is_midway() || item.size() == header_.message_size, "an item stays the same");
  const auto size =
      static_cast<std::uint32_t>(std::min<std::size_t>(buffers_.fragment_size, item.size() - at));
  if (ahead(byte_limit_, byte_count_) < static_cast<std::int32_t>(size)) return {};
  if (!is_midway()) {
    const std::size_t count = (item.size() + buffers_.fragment_size - 1) / buffers_.fragment_size;
    RTPM_ASSERT(count <= kFragmentCountMax, "an item has a bounded count of fragments");
    header_.message_size = static_cast<std::uint32_t>(item.size());
    header_.fragment_count = static_cast<std::uint16_t>(std::max<std::size_t>(count, 1));
    header_.sender_time_ns = static_cast<std::uint64_t>(to_ns(now));
    ++item_count_;
  }
  header_.payload_size = size;
  header_.item = count_;
  std::byte* const frame = frame_of(count_);
  encode(header_, frame);
  if (size > 0) std::memcpy(frame + kHeaderSize, item.data() + at, size);
  sizes_[count_ % kStreamWindow] = size;
  byte_count_ += size;
  ++count_;
  if (++header_.fragment_index == header_.fragment_count) header_.fragment_index = 0;
  if (!is_kept()) first_missing_ = count_;
  return {frame, kHeaderSize + size};
}

void OutgoingStream::on_credit(const StreamCredit& credit, std::uint32_t item_limit,
                               bool is_asked) noexcept {
  // hp-5.10-8: an acknowledgement of frames never sent is ignored.
  if (!is_begun() || ahead(credit.first_missing, count_) > 0) return;
  if (ahead(item_limit, item_limit_) > 0) item_limit_ = item_limit;
  if (ahead(credit.byte_limit, byte_limit_) > 0) byte_limit_ = credit.byte_limit;
  if (!is_kept() || ahead(credit.first_missing, first_missing_) < 0) return;
  first_missing_ = credit.first_missing;
  const std::uint32_t sent = count_ - first_missing_;
  // hp-5.10-4: a missing frame before one that arrived is lost; so is the first missing one if the
  // client heard nothing for long.
  const std::uint32_t known = static_cast<std::uint32_t>(std::bit_width(credit.later));
  const std::uint32_t lost_end = std::min(known, sent);
  const std::uint64_t before_known = lost_end == 0 ? 0 : ~std::uint64_t{0} >> (64 - lost_end);
  repairs_ = before_known & ~(credit.later << 1U);
  if (is_asked && sent > 0) repairs_ |= 1;
}

ConstBytes OutgoingStream::next() noexcept {
  if (!is_begun() || repairs_ == 0) return {};
  const auto bit = static_cast<std::uint32_t>(std::countr_zero(repairs_));
  repairs_ &= repairs_ - 1;
  const std::uint32_t number = first_missing_ + bit;
  std::byte* const frame = frame_of(number);
  mark_repeated(frame);
  return {frame, kHeaderSize + sizes_[number % kStreamWindow]};
}

void IncomingStream::begin(const Buffers& buffers, std::uint32_t window,
                           std::uint32_t first) noexcept {
  RTPM_ASSERT(window >= 1 && window <= kStreamWindow, "a stream takes 1 to 32 items at a time");
  RTPM_ASSERT(buffers.frame_size > 0 && buffers.frames.size() >= buffers.frame_size,
              "a stream has memory for a frame");
  *this = IncomingStream{};
  buffers_ = buffers;
  slot_count_ = static_cast<std::uint32_t>(
      std::min<std::size_t>(buffers.frames.size() / buffers.frame_size, kStreamFrameCountMax));
  window_ = window;
  freed_ = first_missing_ = first;
}

// Not the number modulo the slots, which would jump when the numbers wrap around.
std::uint32_t IncomingStream::slot_of(std::uint32_t number) const noexcept {
  return (freed_slot_ + (number - freed_)) % slot_count_;
}

std::byte* IncomingStream::frame_at(std::uint32_t slot) const noexcept {
  return buffers_.frames.data() + slot * std::size_t{buffers_.frame_size};
}

// Whether `part`, the next in order, continues the current item, or starts one.
bool IncomingStream::fits(const Part& part) const noexcept {
  if (!is_midway()) {
    return part.index == 0 && (part.count == 1 || part.message_size <= buffers_.item.size());
  }
  return part.index == at_hand_.index && part.count == at_hand_.count &&
         part.message_size == at_hand_.message_size && part.fragment_size == at_hand_.fragment_size;
}

void IncomingStream::accept(const Part& part) noexcept {
  ++first_missing_;
  at_hand_ = part;
  if (++at_hand_.index < part.count) return;
  at_hand_ = {};
  ++ready_count_;
}

IncomingStream::Taken IncomingStream::take(const Header& header, ConstBytes payload) noexcept {
  const std::uint32_t number = header.item;
  const std::int32_t distance = ahead(number, first_missing_);
  if (distance < 0) return Taken::kDuplicate;
  if (distance > 64 || number - freed_ >= slot_count_ || payload.size() > buffers_.frame_size) {
    return Taken::kForeign;
  }
  if (is_ended_ && ahead(number, end_) >= 0) return Taken::kForeign;
  const std::uint64_t bit = distance == 0 ? 0 : std::uint64_t{1} << (distance - 1);
  if ((present_ & bit) != 0) return Taken::kDuplicate;
  const Part part{.size = static_cast<std::uint32_t>(payload.size()),
                  .message_size = header.message_size,
                  .fragment_size = header.fragment_count > 1 ? fragment_size_of(header) : 0,
                  .index = header.fragment_index,
                  .count = header.fragment_count};
  // hp-5.10-9: frames beyond the granted bytes are not kept.
  if (kept_bytes_ + part.size > buffers_.byte_window || (distance == 0 && !fits(part))) {
    return Taken::kForeign;
  }
  const std::uint32_t slot = slot_of(number);
  if (part.size > 0) std::memcpy(frame_at(slot), payload.data(), part.size);
  parts_[slot] = part;
  kept_bytes_ += part.size;
  present_ |= bit;
  if (distance > 0) return Taken::kAhead;
  accept(part);
  // Frames that were ahead may now be next in order.
  for (bool is_there = true; is_there;) {
    is_there = (present_ & 1) != 0;
    present_ >>= 1U;
    if (!is_there) break;
    const Part& later = parts_[slot_of(first_missing_)];
    is_there = fits(later);
    if (is_there) {
      accept(later);
    } else {
      kept_bytes_ -= later.size;
      ++dropped_count_;
    }
  }
  put_together();
  return Taken::kNew;
}

bool IncomingStream::end(std::uint32_t count) noexcept {
  if (is_ended_) return count == end_;
  if (ahead(count, known_end()) < 0 || count - freed_ > slot_count_) return false;
  is_ended_ = true;
  end_ = count;
  return true;
}

// The number after the last frame that arrived.
std::uint32_t IncomingStream::known_end() const noexcept {
  if (present_ == 0) return first_missing_;
  return first_missing_ + static_cast<std::uint32_t>(std::bit_width(present_)) + 1;
}

bool IncomingStream::reveals_gap(std::uint32_t number) const noexcept {
  return ahead(number, known_end()) > 0;
}

void IncomingStream::free_first() noexcept {
  const std::uint32_t size = parts_[freed_slot_].size;
  kept_bytes_ -= size;
  freed_bytes_ += size;
  freed_slot_ = (freed_slot_ + 1) % slot_count_;
  ++freed_;
}

// Copies the fragments, in sequence, into their item's buffer, which frees their slots for further
// fragments. Does nothing while the reader still views an item.
void IncomingStream::put_together() noexcept {
  while (!is_whole_ && view_ == View::kNone && freed_ != first_missing_) {
    const Part& part = parts_[freed_slot_];
    if (part.count == 1) return;
    std::memcpy(buffers_.item.data() + filled_, frame_at(freed_slot_), part.size);
    filled_ += part.size;
    is_whole_ = part.index + 1 == part.count;
    free_first();
  }
}

std::optional<ConstBytes> IncomingStream::next() noexcept {
  if (view_ != View::kNone) {
    if (view_ == View::kFrame) {
      free_first();
    } else {
      filled_ = 0;
      is_whole_ = false;
    }
    view_ = View::kNone;
    ++item_count_;
    put_together();
  }
  if (!has_next()) return std::nullopt;
  --ready_count_;
  if (is_whole_) {
    view_ = View::kItem;
    return ConstBytes(buffers_.item.data(), filled_);
  }
  view_ = View::kFrame;
  return ConstBytes(frame_at(freed_slot_), parts_[freed_slot_].size);
}

StreamCredit IncomingStream::credit() const noexcept {
  return {first_missing_, freed_bytes_ + buffers_.byte_window, present_};
}

}  // namespace rtpm::wire
