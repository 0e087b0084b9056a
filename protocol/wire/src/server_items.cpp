#include <algorithm>
#include <utility>

#include "rtpm/base/assert.hpp"
#include "rtpm/wire/server_sessions.hpp"

// The streams of sessions: items that answer a call (spec/hprotocol.md#hp-5.10).
namespace rtpm::wire {

ServerSessions::Answer ServerSessions::begin_stream(const Request& request, Slot& slot) noexcept {
  const Session& session = sessions_[request.session_index];
  slot.stream = streams_.begin(request.header, {request.session_index, request.slot_index},
                               std::min(payload_size_max_, session.message_size_max),
                               lease_of(session, request.header, request.received));
  if (slot.stream == ServerStreams::kNone) {
    return refuse_call(request, Status::kOverload, request.received);
  }
  return {Verdict::Action::kDispatch};
}

// hp-5.10-7: how long a stream is kept while its caller is silent. The end of a connection is
// noticed without this.
MonotonicTime ServerSessions::lease_of(const Session& session, const Header& header,
                                       MonotonicTime now) const noexcept {
  if (config_.medium == Medium::kStream && header.budget_us == kBudgetUnlimited) return kNever;
  const MonotonicTime stated = deadline_of(session, header, now);
  return config_.medium == Medium::kStream ? stated : std::min(stated, now + kStreamLeaseMax);
}

OutgoingStream* ServerSessions::stream_of(const Request& request) noexcept {
  const Slot* const slot = slot_of(request);
  return slot == nullptr || slot->stream == ServerStreams::kNone ? nullptr
                                                                 : &streams_.items(slot->stream);
}

std::uint32_t ServerSessions::item_size_max(const Request& request) noexcept {
  if (stream_of(request) == nullptr) return 0;
  return std::min(item_size_max_, sessions_[request.session_index].message_size_max);
}

std::uint32_t ServerSessions::item_frame_size_max(const Request& request) noexcept {
  return std::min(item_size_max(request), payload_size_max_);
}

ConstBytes ServerSessions::push_item(const Request& request, ConstBytes item,
                                     MonotonicTime now) noexcept {
  OutgoingStream* const stream = stream_of(request);
  if (stream == nullptr) return {};
  // hp-5.10-10
  RTPM_ASSERT(item.size() <= item_size_max(request), "an item is not larger than it may be");
  const ConstBytes frame = stream->push(item, now);
  if (!frame.empty() && !stream->is_midway()) ++counters_.item_count;
  return frame;
}

bool ServerSessions::is_item_midway(const Request& request) noexcept {
  const OutgoingStream* const stream = stream_of(request);
  return stream != nullptr && stream->is_midway();
}

ServerSessions::Answer ServerSessions::on_credit(const Header& header, ConstBytes payload,
                                                 const PeerAddress& peer,
                                                 MonotonicTime now) noexcept {
  Session* session = find(header.session);
  if (session == nullptr) return refuse_session(header, peer, now);
  if (!(session->peer == peer)) return drop(DropReason::kForeignAddress);
  // hp-5.10-8
  const auto credit = decode_credit(payload);
  if (!credit) return drop(DropReason::kBadPayload);
  session->last_heard = now;
  const std::uint32_t slot_index = header.call_id % kCallWindow;
  Slot& slot = session->slots[slot_index];
  const bool is_asked = (header.flags & kFlagAckWanted) != 0;
  const bool is_known = slot.call_id == header.call_id && slot.state != Slot::State::kEmpty;
  const bool is_replied = is_known && slot.frame_size > 0;
  if (!is_known || (slot.stream == ServerStreams::kNone && !is_replied)) {
    // hp-5.10-7: the stream ended because its caller was silent; report that.
    return is_asked ? refuse(header, Status::kLost, now) : drop(DropReason::kUnexpected);
  }
  Answer answer;
  if (slot.stream != ServerStreams::kNone) {
    OutgoingStream& items = streams_.items(slot.stream);
    streams_.extend(slot.stream, lease_of(*session, header, now));
    items.on_credit(*credit, header.item, is_asked);
    if (slot.state == Slot::State::kRunning) answer.credit_tag = slot.tag;
    streams_.repair(slot.stream);
    answer.frame = next_repair();
    if (is_replied && items.is_acknowledged()) free_stream(slot);
  }
  if (is_asked && is_replied && config_.medium == Medium::kDatagram) {
    // hp-5.10-5: the reply is repeated after the missing frames.
    if (answer.frame.empty()) {
      answer.frame = kept_reply(index_of(*session), slot_index);
    } else {
      is_reply_due_ = true;
    }
    ++counters_.duplicate_answered_count;
  } else if (is_asked && answer.frame.empty() && slot.stream != ServerStreams::kNone) {
    // hp-5.10-5: the ACK reports that no frame is missing.
    FragmentAck ack;
    ack.first_missing = 1;
    answer.frame = acknowledge(header, ack, streams_.items(slot.stream).count(), now).frame;
  }
  if (!answer.frame.empty()) answer.action = Verdict::Action::kSend;
  return answer;
}

// Returns the lost frames, then the reply if it is due.
ConstBytes ServerSessions::next_repair() noexcept {
  const CallPlace& call = streams_.repaired_call();
  if (const ConstBytes frame = streams_.next_repair(); !frame.empty()) {
    ++counters_.item_repeated_count;
    return frame;
  }
  if (!std::exchange(is_reply_due_, false)) return {};
  return kept_reply(call.session_index, call.slot_index);
}

void ServerSessions::on_time(MonotonicTime now) noexcept {
  // hp-5.10-7: the callers of these streams were silent for too long.
  streams_.visit_expired(now, [&](const CallPlace& call) {
    Slot& slot = sessions_[call.session_index].slots[call.slot_index];
    if (slot.state == Slot::State::kRunning) ++counters_.expired_count;
    cancel(slot);
    free_stream(slot);
  });
}

}  // namespace rtpm::wire
