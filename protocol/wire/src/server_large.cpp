#include <algorithm>

#include "rtpm/base/assert.hpp"
#include "rtpm/wire/server_sessions.hpp"

// The large messages of the sessions: buffers, quotas, fragments (spec/hprotocol.md#hp-5.6).
namespace rtpm::wire {

// Divides the memory into buffers. Without any, no message is larger than a frame.
void ServerSessions::make_large_buffers() {
  const std::size_t buffer_size = lines_for(config_.message_size_max) * sizeof(CacheLine);
  const std::size_t count =
      std::min<std::size_t>(config_.large_memory.size() / buffer_size, kNoLargeBuffer);
  // One buffer is the scratch for replies, so a single one could not take a request.
  if (config_.message_size_max <= payload_size_max_ || count < 2) {
    config_.message_size_max = std::min(config_.message_size_max, payload_size_max_);
    return;
  }
  large_buffers_.resize(count);
  for (std::size_t i = 0; i < count; ++i) {
    large_buffers_[i].memory =
        config_.large_memory.subspan(i * buffer_size, config_.message_size_max);
  }
  scratch_ = 0;
  large_buffers_[scratch_].use = LargeBuffer::Use::kScratch;
}

// When a message may be evicted (hp-5.6-10); not while it is served.
MonotonicTime ServerSessions::idle_time(const LargeBuffer& large) const noexcept {
  if (large.use != LargeBuffer::Use::kRequest && large.use != LargeBuffer::Use::kReply) {
    return kNever;
  }
  const Slot& slot = sessions_[large.session_index].slots[large.slot_index];
  if (slot.state == Slot::State::kRunning) return kNever;
  return std::min(large.deadline, large.heard + kLargeMessageSilenceMax);
}

bool ServerSessions::is_awaited(const LargeBuffer& large, MonotonicTime now) const noexcept {
  const bool is_held =
      large.use != LargeBuffer::Use::kFree && large.use != LargeBuffer::Use::kScratch;
  return is_held && idle_time(large) > now;
}

std::uint32_t ServerSessions::large_message_count(MonotonicTime now) const noexcept {
  return static_cast<std::uint32_t>(std::ranges::count_if(
      large_buffers_, [&](const LargeBuffer& large) { return is_awaited(large, now); }));
}

MonotonicTime ServerSessions::next_buffer_time(MonotonicTime now) const noexcept {
  MonotonicTime next = kNever;
  for (const LargeBuffer& large : large_buffers_) {
    const MonotonicTime idle = idle_time(large);
    if (idle > now) next = std::min(next, idle);
  }
  return next;
}

// A buffer for a message of that host: a free one, or the one silent for longest; only one of its
// own once the host has used its quota (hp-5.6-11).
std::uint16_t ServerSessions::find_large_buffer(const PeerAddress& peer,
                                                MonotonicTime now) const noexcept {
  std::uint16_t free = kNoLargeBuffer;
  std::uint16_t idle = kNoLargeBuffer;
  std::uint16_t own_idle = kNoLargeBuffer;
  std::uint32_t own_count = 0;
  const auto is_better = [&](const LargeBuffer& large, std::uint16_t than) {
    return than == kNoLargeBuffer || large.heard < large_buffers_[than].heard;
  };
  for (std::size_t i = 0; i < large_buffers_.size(); ++i) {
    const LargeBuffer& large = large_buffers_[i];
    const auto index = static_cast<std::uint16_t>(i);
    if (large.use == LargeBuffer::Use::kScratch) continue;
    if (large.use == LargeBuffer::Use::kFree) {
      if (free == kNoLargeBuffer) free = index;
      continue;
    }
    const bool is_own = is_same_host(sessions_[large.session_index].peer, peer);
    own_count += is_own ? 1 : 0;
    if (idle_time(large) > now) continue;
    if (is_better(large, idle)) idle = index;
    if (is_own && is_better(large, own_idle)) own_idle = index;
  }
  if (own_count >= share_of_one_host(large_buffer_count_max())) return own_idle;
  return free != kNoLargeBuffer ? free : idle;
}

std::uint16_t ServerSessions::take_large_buffer(LargeBuffer::Use use, const Request& request,
                                                MonotonicTime now) noexcept {
  const std::uint16_t index = find_large_buffer(sessions_[request.session_index].peer, now);
  if (index == kNoLargeBuffer) return index;
  LargeBuffer& large = large_buffers_[index];
  if (large.use != LargeBuffer::Use::kFree) evict(large, now);
  large.use = use;
  large.session_index = request.session_index;
  large.slot_index = request.slot_index;
  large.deadline = request.deadline;
  large.heard = now;
  ++held_large_count_;
  return index;
}

void ServerSessions::evict(LargeBuffer& large, MonotonicTime now) noexcept {
  Slot& slot = sessions_[large.session_index].slots[large.slot_index];
  // Later fragments of an evicted request are stale, unless its sender still waits.
  slot.is_evicted = slot.state == Slot::State::kReceiving && large.deadline > now;
  slot.state = Slot::State::kDone;
  if (large.deadline > now) ++counters_.large_evicted_count;
  free_large_buffer(slot);
}

void ServerSessions::free_large_buffer(Slot& slot) noexcept {
  if (slot.large == kNoLargeBuffer) return;
  LargeBuffer& large = large_buffers_[slot.large];
  large.use = LargeBuffer::Use::kFree;
  large.incoming.clear();
  large.outgoing.clear();
  slot.large = kNoLargeBuffer;
  --held_large_count_;
  has_freed_buffer_ = true;
}

bool ServerSessions::is_short_of_buffers(const Request& request, MonotonicTime now) const noexcept {
  // While fewer are in use than one host's quota, every host finds a buffer.
  if (held_large_count_ < share_of_one_host(large_buffer_count_max())) return false;
  const Session& session = sessions_[request.session_index];
  const Slot& slot = session.slots[request.slot_index];
  const bool is_open =
      session.id == request.header.session && slot.call_id == request.header.call_id;
  // A call without a waiting caller needs none; a large request leaves its own.
  if (!is_open || slot.is_unawaited || slot.large != kNoLargeBuffer || large_buffers_.empty())
    return false;
  return find_large_buffer(session.peer, now) == kNoLargeBuffer;
}

ServerSessions::Answer ServerSessions::receive_large(Request& request, Slot& slot,
                                                     Session& session) noexcept {
  const std::uint16_t index =
      take_large_buffer(LargeBuffer::Use::kRequest, request, request.received);
  if (index == kNoLargeBuffer) return refuse_call(request, Status::kOverload, request.received);
  slot.state = Slot::State::kReceiving;
  slot.large = index;
  large_buffers_[index].incoming.begin(request.header, large_buffers_[index].memory);
  return on_fragment(request, slot, session);
}

ServerSessions::Answer ServerSessions::on_fragment(Request& request, Slot& slot,
                                                   Session& session) noexcept {
  const Header& header = request.header;
  const MonotonicTime now = request.received;
  LargeBuffer& large = large_buffers_[slot.large];
  const IncomingMessage::Taken taken = large.incoming.take(header, request.payload);
  if (taken == IncomingMessage::Taken::kForeign) return drop(DropReason::kBadFragment);
  // hp-5.6-10: a duplicate counts, too: its sender may have missed every ACK.
  large.heard = now;
  if (taken != IncomingMessage::Taken::kLast) {
    if ((header.flags & kFlagAckWanted) == 0) return {};
    return acknowledge(header, large.incoming.ack(), 0, now);
  }
  slot.state = Slot::State::kRunning;
  request.payload = large.incoming.message();
  request.deadline = deadline_of(session, header, now);
  request.session_index = index_of(session);
  request.slot_index = header.call_id % kCallWindow;
  if (request.deadline > now) return dispatch(request, slot);
  ++counters_.expired_count;
  return refuse_call(request, Status::kExpired, now);
}

ServerSessions::Answer ServerSessions::acknowledge(const Header& about, const FragmentAck& ack,
                                                   std::uint32_t item_count,
                                                   MonotonicTime now) noexcept {
  Header header = header_about(about, FrameKind::kAck, FragmentAck::kSize, now);
  header.item = item_count;
  encode(header, answer_.data());
  encode(ack, MutableBytes(answer_).subspan(kHeaderSize));
  return {Verdict::Action::kSend, ConstBytes(answer_).first(kHeaderSize + FragmentAck::kSize)};
}

// Which fragments of a large reply have arrived.
ServerSessions::Answer ServerSessions::on_ack(const Header& header, ConstBytes payload,
                                              const PeerAddress& peer, MonotonicTime now) noexcept {
  Session* session = find(header.session);
  if (session == nullptr) return drop(DropReason::kUnknownSession);
  if (!(session->peer == peer)) return drop(DropReason::kForeignAddress);
  const auto ack = decode_ack(payload);
  if (!ack) return drop(DropReason::kBadPayload);
  session->last_heard = now;
  Slot& slot = session->slots[header.call_id % kCallWindow];
  if (slot.state != Slot::State::kDone || slot.call_id != header.call_id ||
      slot.large == kNoLargeBuffer) {
    return drop(DropReason::kUnexpected);
  }
  LargeBuffer& large = large_buffers_[slot.large];
  large.heard = now;
  large.outgoing.on_ack(*ack, (header.flags & kFlagAckWanted) != 0);
  if (large.outgoing.is_acknowledged()) {
    // hp-5.6-8
    free_large_buffer(slot);
    return {};
  }
  sending_ = slot.large;
  const ConstBytes frame = next_frame(now);
  if (frame.empty()) return {};
  return {Verdict::Action::kSend, frame};
}

ConstBytes ServerSessions::next_frame(MonotonicTime now) noexcept {
  if (repairing_ != kNoStream) return next_repair();
  if (sending_ == kNoLargeBuffer) return {};
  const MutableBytes to(fragment_frame_.front().bytes, fragment_frame_.size() * sizeof(CacheLine));
  const ConstBytes frame = large_buffers_[sending_].outgoing.next(to, 0, now);
  if (frame.empty()) sending_ = kNoLargeBuffer;
  return frame;
}

// A duplicate of the call asks for the unacknowledged fragments.
ServerSessions::Answer ServerSessions::send_large_again(const Slot& slot,
                                                        MonotonicTime now) noexcept {
  ++counters_.duplicate_answered_count;
  LargeBuffer& large = large_buffers_[slot.large];
  large.heard = now;
  large.outgoing.nudge();
  sending_ = slot.large;
  return {Verdict::Action::kSend, next_frame(now)};
}

MutableBytes ServerSessions::reserve_reply(const Request& request, std::uint32_t size,
                                           MonotonicTime now) noexcept {
  Slot* const slot = slot_of(request);
  if (size <= payload_size_max_ || slot == nullptr || slot->is_unawaited) return {};
  free_large_buffer(*slot);
  const std::uint16_t index = take_large_buffer(LargeBuffer::Use::kReserved, request, now);
  return index == kNoLargeBuffer ? MutableBytes{} : large_buffers_[index].memory;
}

// Makes a reserved buffer the scratch, and frees the former one.
void ServerSessions::put_in_place_of_scratch(MutableBytes reserved) noexcept {
  const auto is_it = [&](const LargeBuffer& large) {
    return large.memory.data() == reserved.data();
  };
  const auto place = std::ranges::find_if(large_buffers_, is_it);
  RTPM_ASSERT(place->use == LargeBuffer::Use::kReserved, "a reserved reply is completed once");
  large_buffers_[scratch_].use = LargeBuffer::Use::kFree;
  place->use = LargeBuffer::Use::kScratch;
  scratch_ = static_cast<std::uint16_t>(place - large_buffers_.begin());
  --held_large_count_;
  has_freed_buffer_ = true;
}

// The scratch, which holds the reply, becomes its buffer; a free one becomes the new scratch.
ConstBytes ServerSessions::complete_large(const Request& request, Slot& slot, const Header& header,
                                          MonotonicTime now) noexcept {
  RTPM_ASSERT(
      scratch_ != kNoLargeBuffer && header.message_size <= large_buffers_[scratch_].memory.size(),
      "a reply fits its buffer");
  const std::uint16_t next_scratch = take_large_buffer(LargeBuffer::Use::kScratch, request, now);
  RTPM_ASSERT(next_scratch != kNoLargeBuffer, "a large reply is completed while a buffer is free");
  slot.large = std::exchange(scratch_, next_scratch);
  slot.frame_size = 0;
  LargeBuffer& large = large_buffers_[slot.large];
  large.use = LargeBuffer::Use::kReply;
  large.session_index = request.session_index;
  large.slot_index = request.slot_index;
  large.deadline = request.deadline;
  large.heard = now;
  large.outgoing.begin(header, large.memory.first(header.message_size), payload_size_max_,
                       window_of(config_.medium));
  sending_ = slot.large;
  return next_frame(now);
}

}  // namespace rtpm::wire
