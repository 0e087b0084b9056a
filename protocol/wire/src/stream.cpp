#include "rtpm/wire/stream.hpp"

#include <algorithm>
#include <bit>
#include <cstring>

#include "rtpm/base/assert.hpp"

namespace rtpm::wire {
namespace {

// Items are numbered around the circle; of two within half of it, how far the first is ahead.
std::int32_t ahead(std::uint32_t number, std::uint32_t of) noexcept {
  return static_cast<std::int32_t>(number - of);
}

}  // namespace

void encode(const StreamCredit& credit, MutableBytes to) noexcept {
  ByteWriter writer(to);
  writer.put(credit.first_missing);
  writer.put_zeros(4);
  writer.put(credit.later);
  RTPM_ASSERT(writer.ok() && writer.size() == StreamCredit::kSize, "CREDIT has its size");
}

std::optional<StreamCredit> decode_credit(ConstBytes payload) noexcept {
  if (payload.size() != StreamCredit::kSize) return std::nullopt;
  ByteReader reader(payload);
  StreamCredit credit;
  credit.first_missing = reader.take<std::uint32_t>();
  if (!reader.take_zeros(4)) return std::nullopt;
  credit.later = reader.take<std::uint64_t>();
  return credit;
}

void OutgoingStream::begin(const Header& header, MutableBytes memory, std::size_t frame_size,
                           bool is_kept, std::uint32_t first) noexcept {
  // A power of two, so that the places go on where the numbers wrap around.
  window_ = static_cast<std::uint32_t>(
      std::bit_floor(std::min<std::size_t>(memory.size() / frame_size, kStreamWindow)));
  RTPM_ASSERT(window_ >= 1, "a stream has memory for a frame");
  header_ = header;
  header_.kind = FrameKind::kItem;
  header_.flags = 0;
  header_.budget_us = 0;
  header_.fragment_index = 0;
  header_.fragment_count = 1;
  memory_ = memory;
  frame_size_ = frame_size;
  is_kept_ = is_kept;
  count_ = first_missing_ = first;
  limit_ = first + header.item;
  repairs_ = 0;
}

std::byte* OutgoingStream::frame_of(std::uint32_t number) const noexcept {
  return memory_.data() + (is_kept_ ? number % window_ : 0) * frame_size_;
}

MutableBytes OutgoingStream::item_buffer() noexcept {
  // hp-5.10-2
  if (!is_begun() || ahead(limit_, count_) <= 0) return {};
  if (is_kept_ && count_ - first_missing_ >= window_) return {};
  return {frame_of(count_) + kHeaderSize, frame_size_ - kHeaderSize};
}

ConstBytes OutgoingStream::push(std::uint32_t size, MonotonicTime now) noexcept {
  RTPM_ASSERT(size <= frame_size_ - kHeaderSize, "an item stays within its buffer");
  std::byte* const frame = frame_of(count_);
  header_.payload_size = header_.message_size = size;
  header_.item = count_;
  header_.sender_time_ns = static_cast<std::uint64_t>(to_ns(now));
  encode(header_, frame);
  sizes_[count_ % kStreamWindow] = size;
  ++count_;
  if (!is_kept_) first_missing_ = count_;
  return {frame, kHeaderSize + size};
}

void OutgoingStream::raise_limit(std::uint32_t limit) noexcept {
  if (ahead(limit, limit_) > 0) limit_ = limit;
}

void OutgoingStream::on_credit(const StreamCredit& credit, std::uint32_t limit,
                               bool is_asked) noexcept {
  // hp-5.10-8: who says that he has what was never sent lies or errs.
  if (!is_begun() || ahead(credit.first_missing, count_) > 0) return;
  raise_limit(limit);
  if (!is_kept_ || ahead(credit.first_missing, first_missing_) < 0) return;
  first_missing_ = credit.first_missing;
  const std::uint32_t sent = count_ - first_missing_;
  if (sent == 0) {
    repairs_ = 0;
    return;
  }
  // hp-5.10-4: what lies before an item that arrived, and has not arrived itself, is lost; and, if
  // nothing came for long, the first that is missing.
  const std::uint32_t known = static_cast<std::uint32_t>(std::bit_width(credit.later));
  const std::uint32_t lost_end = std::min(known, sent);
  const std::uint64_t before_known = lost_end == 0 ? 0 : ~std::uint64_t{0} >> (64 - lost_end);
  repairs_ = before_known & ~(credit.later << 1U);
  if (is_asked) repairs_ |= 1;
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

void IncomingStream::begin(MutableBytes memory, std::uint32_t window, std::size_t item_size,
                           std::uint32_t first) noexcept {
  RTPM_ASSERT(window >= 1 && window <= kStreamWindow, "a stream takes 1 to 32 items at a time");
  RTPM_ASSERT(memory.size() >= window * item_size, "the memory holds the window");
  *this = IncomingStream{};
  memory_ = memory;
  item_size_ = item_size;
  window_ = window;
  taken_ = first_missing_ = first;
}

// Not the number modulo the window: that would jump where the numbers wrap around.
std::uint32_t IncomingStream::place_of(std::uint32_t number) const noexcept {
  return (taken_place_ + (number - taken_)) % window_;
}

std::byte* IncomingStream::room_of(std::uint32_t number) const noexcept {
  return memory_.data() + place_of(number) * item_size_;
}

IncomingStream::Taken IncomingStream::take(std::uint32_t number, ConstBytes item) noexcept {
  const std::int32_t place = ahead(number, first_missing_);
  if (place < 0) return Taken::kCopy;
  if (ahead(number, limit()) >= 0 || item.size() > item_size_) return Taken::kForeign;
  if (is_ended_ && ahead(number, end_) >= 0) return Taken::kForeign;
  if (place > 0) {
    const std::uint64_t bit = std::uint64_t{1} << (place - 1);
    if ((present_ & bit) != 0) return Taken::kCopy;
    present_ |= bit;
  }
  if (!item.empty()) std::memcpy(room_of(number), item.data(), item.size());
  sizes_[place_of(number)] = static_cast<std::uint32_t>(item.size());
  if (place > 0) return Taken::kAhead;
  const auto run = static_cast<std::uint32_t>(std::countr_one(present_));
  first_missing_ += run + 1;
  // The item that is missing now had no bit of its own.
  present_ = run >= 63 ? 0 : present_ >> (run + 1);
  return Taken::kNew;
}

bool IncomingStream::end(std::uint32_t count) noexcept {
  if (is_ended_) return count == end_;
  const std::uint32_t beyond =
      first_missing_ +
      (present_ == 0 ? 0 : static_cast<std::uint32_t>(std::bit_width(present_)) + 1);
  if (ahead(count, beyond) < 0 || ahead(count, limit()) > 0) return false;
  is_ended_ = true;
  end_ = count;
  return true;
}

bool IncomingStream::has_next() const noexcept {
  return ahead(first_missing_, taken_ + (is_viewed_ ? 1 : 0)) > 0;
}

std::optional<ConstBytes> IncomingStream::next() noexcept {
  if (is_viewed_) {
    is_viewed_ = false;
    taken_place_ = (taken_place_ + 1) % window_;
    ++taken_;
  }
  if (!has_next()) return std::nullopt;
  is_viewed_ = true;
  return ConstBytes(room_of(taken_), sizes_[taken_place_]);
}

StreamCredit IncomingStream::credit() const noexcept {
  return {first_missing_, present_};
}

}  // namespace rtpm::wire
