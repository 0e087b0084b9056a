#include "rtpm/wire/large_messages.hpp"

#include <algorithm>

#include "rtpm/base/assert.hpp"

namespace rtpm::wire {

LargeMessages::LargeMessages(const Config& config) : config_(config) {
  const std::size_t size = large_buffer_size(config.message_size_max);
  const std::size_t count = std::min<std::size_t>(config.memory.size() / size, kNone);
  // One buffer is the scratch for replies, so a single one could not hold a request.
  if (config.message_size_max <= config.fragment_size || count < 2) return;
  buffers_.resize(count);
  for (std::size_t i = 0; i < count; ++i)
    buffers_[i].memory = config.memory.subspan(i * size, config.message_size_max);
  scratch_ = 0;
  buffers_[scratch_].use = Use::kScratch;
  frame_.resize(kHeaderSize + config.fragment_size);
}

MonotonicTime LargeMessages::idle_time(const Buffer& buffer) noexcept {
  if (buffer.use != Use::kIncoming && buffer.use != Use::kReply) return kNever;
  return std::min(buffer.deadline, buffer.heard + kLargeMessageSilenceMax);
}

std::uint32_t LargeMessages::awaited_count(MonotonicTime now) const noexcept {
  return static_cast<std::uint32_t>(std::ranges::count_if(buffers_, [&](const Buffer& buffer) {
    return buffer.use != Use::kFree && buffer.use != Use::kScratch && idle_time(buffer) > now;
  }));
}

MonotonicTime LargeMessages::next_idle_time(MonotonicTime now) const noexcept {
  MonotonicTime next = kNever;
  for (const Buffer& buffer : buffers_) {
    const MonotonicTime idle = idle_time(buffer);
    if (idle > now) next = std::min(next, idle);
  }
  return next;
}

std::uint16_t LargeMessages::find(const PeerAddress& peer, MonotonicTime now) const noexcept {
  std::uint16_t free = kNone;
  std::uint16_t idle = kNone;
  std::uint16_t own_idle = kNone;
  std::uint32_t own_count = 0;
  const auto is_better = [&](const Buffer& buffer, std::uint16_t than) {
    return than == kNone || buffer.heard < buffers_[than].heard;
  };
  for (std::size_t i = 0; i < buffers_.size(); ++i) {
    const Buffer& buffer = buffers_[i];
    const auto index = static_cast<std::uint16_t>(i);
    if (buffer.use == Use::kScratch) continue;
    if (buffer.use == Use::kFree) {
      if (free == kNone) free = index;
      continue;
    }
    const bool is_own = is_same_host(buffer.peer, peer);
    own_count += is_own ? 1 : 0;
    if (idle_time(buffer) > now) continue;
    if (is_better(buffer, idle)) idle = index;
    if (is_own && is_better(buffer, own_idle)) own_idle = index;
  }
  if (own_count >= share_of_one_host(capacity())) return own_idle;
  return free != kNone ? free : idle;
}

void LargeMessages::take(std::uint16_t index, const CallPlace& call, const PeerAddress& peer,
                         MonotonicTime deadline, MonotonicTime now) noexcept {
  Buffer& buffer = buffers_[index];
  buffer.use = Use::kReserved;
  buffer.call = call;
  buffer.peer = peer;
  buffer.deadline = deadline;
  buffer.heard = now;
  ++held_count_;
}

void LargeMessages::free(std::uint16_t index) noexcept {
  Buffer& buffer = buffers_[index];
  buffer.use = Use::kFree;
  buffer.incoming.clear();
  buffer.outgoing.clear();
  --held_count_;
  has_freed_ = true;
}

void LargeMessages::receive(std::uint16_t index, const Header& header) noexcept {
  buffers_[index].use = Use::kIncoming;
  buffers_[index].incoming.begin(header, buffers_[index].memory);
}

IncomingMessage::Taken LargeMessages::take_fragment(std::uint16_t index, const Header& header,
                                                    ConstBytes payload,
                                                    MonotonicTime now) noexcept {
  Buffer& buffer = buffers_[index];
  const IncomingMessage::Taken taken = buffer.incoming.take(header, payload);
  // hp-5.6-10: a duplicate counts, too, as its sender may have missed every ACK.
  if (taken != IncomingMessage::Taken::kForeign) buffer.heard = now;
  if (taken == IncomingMessage::Taken::kLast) buffer.use = Use::kServed;
  return taken;
}

void LargeMessages::put_in_place_of_scratch(MutableBytes reserved) noexcept {
  const auto place = std::ranges::find_if(
      buffers_, [&](const Buffer& buffer) { return buffer.memory.data() == reserved.data(); });
  RTPM_ASSERT(place->use == Use::kReserved, "a reserved reply is completed once");
  free(static_cast<std::uint16_t>(place - buffers_.begin()));
  buffers_[scratch_].use = Use::kFree;
  place->use = Use::kScratch;
  scratch_ = static_cast<std::uint16_t>(place - buffers_.begin());
}

std::uint16_t LargeMessages::send_scratch(std::uint16_t next, const Header& header) noexcept {
  RTPM_ASSERT(has_buffers() && header.message_size <= scratch().size(), "a reply fits its buffer");
  const std::uint16_t index = std::exchange(scratch_, next);
  Buffer& taken = buffers_[next];
  Buffer& reply = buffers_[index];
  reply.use = Use::kReply;
  reply.call = taken.call;
  reply.peer = taken.peer;
  reply.deadline = taken.deadline;
  reply.heard = taken.heard;
  taken.use = Use::kScratch;
  reply.outgoing.begin(header, reply.memory.first(header.message_size), config_.fragment_size,
                       window_of(config_.medium));
  sending_ = index;
  return index;
}

bool LargeMessages::on_ack(std::uint16_t index, const FragmentAck& ack, bool is_asked,
                           MonotonicTime now) noexcept {
  Buffer& buffer = buffers_[index];
  buffer.heard = now;
  buffer.outgoing.on_ack(ack, is_asked);
  if (buffer.outgoing.is_acknowledged()) return true;
  sending_ = index;
  return false;
}

void LargeMessages::send_again(std::uint16_t index, MonotonicTime now) noexcept {
  buffers_[index].heard = now;
  buffers_[index].outgoing.nudge();
  sending_ = index;
}

ConstBytes LargeMessages::next_fragment(MonotonicTime now) noexcept {
  const ConstBytes frame = buffers_[sending_].outgoing.next(frame_, 0, now);
  if (frame.empty()) sending_ = kNone;
  return frame;
}

}  // namespace rtpm::wire
