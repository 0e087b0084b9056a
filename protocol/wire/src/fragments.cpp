#include "rtpm/wire/fragments.hpp"

#include <algorithm>
#include <bit>
#include <cstring>

#include "rtpm/base/assert.hpp"

namespace rtpm::wire {

void FragmentSet::reset(std::uint16_t count) noexcept {
  RTPM_ASSERT(count >= 1 && count <= kFragmentCountMax,
              "a message has a bounded count of fragments");
  words_.fill(0);
  count_ = count;
  first_missing_ = 0;
}

bool FragmentSet::contains(std::uint16_t index) const noexcept {
  return ((words_[index / 64U] >> (index % 64U)) & 1U) != 0;
}

bool FragmentSet::insert(std::uint16_t index) noexcept {
  if (contains(index)) return false;
  words_[index / 64U] |= std::uint64_t{1} << (index % 64U);
  while (first_missing_ < count_ && contains(first_missing_))
    ++first_missing_;
  return true;
}

void encode(const FragmentAck& ack, MutableBytes to) noexcept {
  ByteWriter writer(to);
  writer.put(ack.first_missing);
  writer.put_zeros(6);
  for (const std::uint64_t word : ack.later)
    writer.put(word);
  RTPM_ASSERT(writer.ok() && writer.size() == FragmentAck::kSize, "ACK has its size");
}

std::optional<FragmentAck> decode_ack(ConstBytes payload) noexcept {
  if (payload.size() != FragmentAck::kSize) return std::nullopt;
  ByteReader reader(payload);
  FragmentAck ack;
  ack.first_missing = reader.take<std::uint16_t>();
  if (!reader.take_zeros(6)) return std::nullopt;
  for (std::uint64_t& word : ack.later)
    word = reader.take<std::uint64_t>();
  return ack;
}

void IncomingMessage::begin(const Header& header, MutableBytes buffer) noexcept {
  RTPM_ASSERT(buffer.size() >= header.message_size, "the buffer holds the message");
  header_ = header;
  buffer_ = buffer.first(header.message_size);
  fragment_size_ = fragment_size_of(header);
  arrived_.reset(header.fragment_count);
}

IncomingMessage::Taken IncomingMessage::take(const Header& header, ConstBytes payload) noexcept {
  // hp-5.6-9: a later fragment can't change the values of the first one.
  constexpr std::uint16_t kOfTheMessage = kFlagNoReply | kFlagReplyOnReceipt;
  if (header.message_size != buffer_.size() || header.fragment_count != arrived_.count() ||
      fragment_size_of(header) != fragment_size_ || header.service != header_.service ||
      header.method != header_.method || header.priority != header_.priority ||
      header.item != header_.item || ((header.flags ^ header_.flags) & kOfTheMessage) != 0) {
    return Taken::kForeign;
  }
  if (!arrived_.insert(header.fragment_index)) return Taken::kDuplicate;
  std::memcpy(buffer_.data() + std::size_t{header.fragment_index} * fragment_size_, payload.data(),
              payload.size());
  return arrived_.is_complete() ? Taken::kLast : Taken::kNew;
}

FragmentAck IncomingMessage::ack() const noexcept {
  FragmentAck ack;
  ack.first_missing = arrived_.first_missing();
  for (std::uint16_t i = 0; i < FragmentAck::kLaterCount; ++i) {
    const std::uint32_t index = ack.first_missing + 1U + i;
    if (index >= arrived_.count()) break;
    if (arrived_.contains(static_cast<std::uint16_t>(index))) {
      ack.later[i / 64U] |= std::uint64_t{1} << (i % 64U);
    }
  }
  return ack;
}

void OutgoingMessage::begin(const Header& header, ConstBytes message, std::uint32_t fragment_size,
                            std::uint16_t window) noexcept {
  const std::size_t count = (message.size() + fragment_size - 1) / fragment_size;
  header_ = header;
  message_ = message;
  fragment_size_ = fragment_size;
  window_ = window;
  acknowledged_.reset(static_cast<std::uint16_t>(count));
  next_new_ = repair_next_ = repair_end_ = 0;
  header_.fragment_count = static_cast<std::uint16_t>(count);
  header_.message_size = static_cast<std::uint32_t>(message.size());
}

bool OutgoingMessage::has_more() const noexcept {
  for (std::uint16_t i = repair_next_; i < repair_end_; ++i) {
    if (!acknowledged_.contains(i)) return true;
  }
  // hp-5.6-2
  return next_new_ < acknowledged_.count() && next_new_ < acknowledged_.first_missing() + window_;
}

std::optional<std::uint16_t> OutgoingMessage::choose() noexcept {
  while (repair_next_ < repair_end_) {
    const std::uint16_t index = repair_next_++;
    if (!acknowledged_.contains(index)) return index;
  }
  if (!has_more()) return std::nullopt;
  return next_new_++;
}

ConstBytes OutgoingMessage::next(MutableBytes to, std::uint32_t budget_us,
                                 MonotonicTime now) noexcept {
  if (!is_begun()) return {};
  const std::uint16_t new_before = next_new_;
  const auto index = choose();
  if (!index) return {};
  std::uint16_t flags = *index < new_before ? kFlagRepeated : std::uint16_t{0};
  // hp-5.6-3: requests an ACK often enough to keep the window moving.
  if (!has_more() || *index % (window_ / 2) == window_ / 2 - 1) {
    flags |= kFlagAckWanted;
  }
  return write(to, *index, flags, budget_us, now);
}

ConstBytes OutgoingMessage::first_again(MutableBytes to, std::uint32_t budget_us,
                                        MonotonicTime now) noexcept {
  return write(to, 0, kFlagRepeated | kFlagAckWanted, budget_us, now);
}

ConstBytes OutgoingMessage::write(MutableBytes to, std::uint16_t index, std::uint16_t flags,
                                  std::uint32_t budget_us, MonotonicTime now) const noexcept {
  const std::size_t at = std::size_t{index} * fragment_size_;
  const ConstBytes part =
      message_.subspan(at, std::min<std::size_t>(fragment_size_, message_.size() - at));
  Header header = header_;
  header.flags |= flags;
  header.fragment_index = index;
  header.payload_size = static_cast<std::uint32_t>(part.size());
  header.sender_time_ns = static_cast<std::uint64_t>(to_ns(now));
  // A CALL's budget shrinks with each fragment; a REPLY's is constant.
  if (header.kind == FrameKind::kCall) header.budget_us = budget_us;
  encode(header, to.data());
  std::memcpy(to.data() + kHeaderSize, part.data(), part.size());
  return to.first(kHeaderSize + part.size());
}

void OutgoingMessage::on_ack(const FragmentAck& ack, bool is_asked) noexcept {
  // An ACK for fragments never sent is forged or faulty.
  if (!is_begun() || ack.first_missing > next_new_) return;
  std::uint16_t end = ack.first_missing;
  for (std::uint16_t i = acknowledged_.first_missing(); i < ack.first_missing; ++i) {
    acknowledged_.insert(i);
  }
  for (std::uint16_t i = 0; i < FragmentAck::kLaterCount; ++i) {
    const std::uint32_t index = ack.first_missing + 1U + i;
    if (index >= next_new_) break;
    if (!ack.has_later(i)) continue;
    acknowledged_.insert(static_cast<std::uint16_t>(index));
    end = static_cast<std::uint16_t>(index);
  }
  // A missing fragment before one that arrived counts as lost.
  repair_next_ = acknowledged_.first_missing();
  repair_end_ = std::max(end, repair_next_);
  // hp-5.6-7: the last fragments were lost, and no later one reveals it.
  if (is_asked && !has_more()) nudge();
}

void OutgoingMessage::nudge() noexcept {
  if (!is_begun() || is_acknowledged()) return;
  repair_next_ = acknowledged_.first_missing();
  repair_end_ = std::min(static_cast<std::uint16_t>(repair_next_ + 1), next_new_);
}

}  // namespace rtpm::wire
