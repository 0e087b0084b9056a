#include <algorithm>

#include "rtpm/base/assert.hpp"
#include "rtpm/wire/server_sessions.hpp"

// The large messages of sessions, in fragments (spec/hprotocol.md#hp-5.6).
namespace rtpm::wire {

// Takes a buffer for a message of the request's host, evicting another message if necessary.
std::uint16_t ServerSessions::take_large_buffer(const Request& request,
                                                MonotonicTime now) noexcept {
  const PeerAddress& peer = sessions_[request.session_index].peer;
  const std::uint16_t index = large_.find(peer, now);
  if (index == LargeMessages::kNone) return index;
  if (!large_.is_free(index)) {
    const CallPlace& evicted = large_.call_of(index);
    Slot& slot = sessions_[evicted.session_index].slots[evicted.slot_index];
    const bool is_awaited = large_.deadline_of(index) > now;
    // Later fragments of an evicted request are stale, unless its sender still waits.
    slot.is_evicted = slot.state == Slot::State::kReceiving && is_awaited;
    slot.state = Slot::State::kDone;
    if (is_awaited) ++counters_.large_evicted_count;
    free_large_buffer(slot);
  }
  large_.take(index, {request.session_index, request.slot_index}, peer, request.deadline, now);
  return index;
}

bool ServerSessions::is_short_of_buffers(const Request& request, MonotonicTime now) const noexcept {
  if (!large_.may_lack()) return false;
  const Session& session = sessions_[request.session_index];
  const Slot& slot = session.slots[request.slot_index];
  const bool is_open =
      session.id == request.header.session && slot.call_id == request.header.call_id;
  // A call without a waiting caller needs none; a large request frees its own buffer for the reply.
  if (!is_open || slot.is_unawaited || slot.large != LargeMessages::kNone ||
      !large_.has_buffers()) {
    return false;
  }
  return large_.find(session.peer, now) == LargeMessages::kNone;
}

ServerSessions::Answer ServerSessions::receive_large(Request& request, Slot& slot,
                                                     Session& session) noexcept {
  const std::uint16_t index = take_large_buffer(request, request.received);
  if (index == LargeMessages::kNone) {
    return refuse_call(request, Status::kOverload, request.received);
  }
  slot.state = Slot::State::kReceiving;
  slot.large = index;
  large_.receive(index, request.header);
  return on_fragment(request, slot, session);
}

ServerSessions::Answer ServerSessions::on_fragment(Request& request, Slot& slot,
                                                   Session& session) noexcept {
  const Header& header = request.header;
  const MonotonicTime now = request.received;
  const IncomingMessage::Taken taken =
      large_.take_fragment(slot.large, header, request.payload, now);
  if (taken == IncomingMessage::Taken::kForeign) return drop(DropReason::kBadFragment);
  if (taken != IncomingMessage::Taken::kLast) {
    if ((header.flags & kFlagAckWanted) == 0) return {};
    return acknowledge(header, large_.request(slot.large).ack(), 0, now);
  }
  slot.state = Slot::State::kRunning;
  request.payload = large_.request(slot.large).message();
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

// Handles the report of which fragments of a large reply have arrived.
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
      slot.large == LargeMessages::kNone) {
    return drop(DropReason::kUnexpected);
  }
  if (large_.on_ack(slot.large, *ack, (header.flags & kFlagAckWanted) != 0, now)) {
    // hp-5.6-8
    free_large_buffer(slot);
    return {};
  }
  const ConstBytes frame = large_.next_frame(now);
  if (frame.empty()) return {};
  return {Verdict::Action::kSend, frame};
}

ConstBytes ServerSessions::next_frame(MonotonicTime now) noexcept {
  return streams_.is_repairing() ? next_repair() : large_.next_frame(now);
}

MutableBytes ServerSessions::reserve_reply(const Request& request, std::uint32_t size,
                                           MonotonicTime now) noexcept {
  Slot* const slot = slot_of(request);
  if (size <= payload_size_max_ || slot == nullptr || slot->is_unawaited) return {};
  free_large_buffer(*slot);
  const std::uint16_t index = take_large_buffer(request, now);
  return index == LargeMessages::kNone ? MutableBytes{} : large_.reserve(index);
}

// The scratch, which holds the reply, becomes the reply's buffer.
ConstBytes ServerSessions::complete_large(const Request& request, Slot& slot, const Header& header,
                                          MonotonicTime now) noexcept {
  const std::uint16_t next_scratch = take_large_buffer(request, now);
  RTPM_ASSERT(next_scratch != LargeMessages::kNone,
              "a large reply is completed while a buffer is free");
  slot.large = large_.send_scratch(next_scratch, header);
  slot.frame_size = 0;
  return large_.next_frame(now);
}

}  // namespace rtpm::wire
