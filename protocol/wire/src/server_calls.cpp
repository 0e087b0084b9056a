#include <algorithm>
#include <cstring>
#include <limits>
#include <utility>

#include "rtpm/base/assert.hpp"
#include "rtpm/wire/server_sessions.hpp"

// The calls of sessions: at most once, completion, cancellation.
namespace rtpm::wire {
namespace {

// Call numbers wrap around.
bool is_newer(std::uint32_t call_id, std::uint32_t than) noexcept {
  return static_cast<std::int32_t>(call_id - than) > 0;
}

std::uint32_t to_us(Duration duration) noexcept {
  const auto us = std::chrono::duration_cast<std::chrono::microseconds>(duration).count();
  return static_cast<std::uint32_t>(
      std::clamp<std::int64_t>(us, 0, std::numeric_limits<std::uint32_t>::max()));
}

}  // namespace

ServerSessions::Answer ServerSessions::on_call(Request& request, const PeerAddress& peer) noexcept {
  const Header& header = request.header;
  const MonotonicTime now = request.received;
  Session* session = find(header.session);
  if (session == nullptr) return refuse_session(header, peer, now);
  // hp-5.1-4: only this address was proved for the session.
  if (!(session->peer == peer)) return drop(DropReason::kForeignAddress);
  session->last_heard = now;

  Slot& slot = session->slots[header.call_id % kCallWindow];
  if (slot.state != Slot::State::kEmpty) {
    if (slot.call_id == header.call_id) return on_duplicate(request, slot, *session);
    // hp-5.2-2: an older call is stale. hp-5.2-3: a call whose slot is in use exceeds the client's
    // window. It is refused permanently: a duplicate of it does not run later, either.
    const bool is_new = is_newer(header.call_id, slot.newest_call_id);
    if (!is_new && header.call_id != slot.newest_call_id) return drop(DropReason::kStaleCall);
    slot.newest_call_id = header.call_id;
    // hp-5.2-4: a running call that nobody waits for does not occupy the slot, unless its buffer is
    // still being read. A stream's caller waits as long as it shows life.
    const bool is_awaited =
        !slot.is_unawaited && (now < slot.deadline || slot.stream != ServerStreams::kNone);
    const bool is_taken =
        slot.state == Slot::State::kRunning && (is_awaited || slot.large != LargeMessages::kNone);
    if (!is_new || is_taken) {
      const Answer refusal = refuse(header, Status::kOverload, now);
      // hp-5.8-1
      return (header.flags & kFlagNoReply) != 0 ? Answer{} : refusal;
    }
  }
  // Ends an older call that stayed incomplete, or whose reply was not fetched.
  free_stream(slot);
  free_large_buffer(slot);
  return admit(request, *session);
}

// hp-5.2-1: a duplicate never runs. Its answer depends on the call's state.
ServerSessions::Answer ServerSessions::on_duplicate(Request& request, Slot& slot,
                                                    Session& session) noexcept {
  const Header& header = request.header;
  const MonotonicTime now = request.received;
  if (slot.is_evicted) return refuse(header, Status::kOverload, now);
  // hp-5.8-1
  if ((header.flags & kFlagNoReply) != 0) {
    return drop(slot.state == Slot::State::kDone ? DropReason::kStaleCall
                                                 : DropReason::kDuplicateRunning);
  }
  if (slot.state == Slot::State::kReceiving) {
    return on_fragment(request, slot, session);
  }
  if (slot.state == Slot::State::kRunning && slot.frame_size == 0) {
    std::uint32_t item_count = 0;
    if (slot.stream != ServerStreams::kNone) {
      // A keep-alive of the caller, which also renews its request for items.
      streams_.extend(slot.stream, lease_of(session, header, now));
      item_count = streams_.items(slot.stream).count();
    }
    if ((header.flags & kFlagAckWanted) == 0) return drop(DropReason::kDuplicateRunning);
    // hp-5.6-4: tells a client that requests an ACK that no fragment is missing.
    FragmentAck all;
    all.first_missing = header.fragment_count;
    return acknowledge(header, all, item_count, now);
  }
  if (slot.large != LargeMessages::kNone && large_.is_reply(slot.large)) {
    // It requests the unacknowledged fragments.
    ++counters_.duplicate_answered_count;
    large_.send_again(slot.large, now);
    return {Verdict::Action::kSend, large_.next_frame(now)};
  }
  // Streams cause no duplicates, and a large reply is not kept once it has arrived.
  if (config_.medium == Medium::kStream || slot.frame_size == 0) {
    return drop(DropReason::kStaleCall);
  }
  ++counters_.duplicate_answered_count;
  return {Verdict::Action::kSend, kept_reply(index_of(session), header.call_id % kCallWindow)};
}

ConstBytes ServerSessions::kept_reply(std::uint32_t session_index,
                                      std::uint32_t slot_index) noexcept {
  std::byte* const frame = frame_of(session_index, slot_index);
  mark_repeated(frame);
  return {frame, sessions_[session_index].slots[slot_index].frame_size};
}

// Puts the first frame of a new call into its slot, or refuses it by the first of its faults
// (hp-5.1-9).
ServerSessions::Answer ServerSessions::admit(Request& request, Session& session) noexcept {
  const Header& header = request.header;
  const MonotonicTime now = request.received;
  const std::uint32_t slot_index = header.call_id % kCallWindow;
  Slot& slot = session.slots[slot_index];
  slot = Slot{.state = Slot::State::kRunning,
              .is_unawaited = (header.flags & kFlagNoReply) != 0,
              .call_id = header.call_id,
              .newest_call_id = header.call_id};
  request.deadline = deadline_of(session, header, now);
  slot.deadline = request.deadline;
  request.session_index = index_of(session);
  request.slot_index = slot_index;
  if (header.message_size > config_.message_size_max) {
    return refuse_call(request, Status::kTooLarge, now);
  }
  if (!config_.band.contains(header.priority)) {
    return refuse_call(request, Status::kWrongBand, now);
  }
  // hp-6.2-1
  const bool is_ping = header.service == kSessionService && header.method == kMethodPing;
  if (header.priority > config_.ceiling && !is_ping) {
    return refuse_call(request, Status::kPriorityNotAllowed, now);
  }
  // hp-5.4-3: a call that is late here is late for its caller, too.
  if (request.deadline <= now) {
    ++counters_.expired_count;
    return refuse_call(request, Status::kExpired, now);
  }
  if (header.fragment_count > 1) return receive_large(request, slot, session);
  return dispatch(request, slot);
}

ServerSessions::Answer ServerSessions::dispatch(const Request& request, Slot& slot) noexcept {
  if (request.wants_stream()) return begin_stream(request, slot);
  return {Verdict::Action::kDispatch};
}

// hp-5.4-2: on one host the time in the socket's buffer counts; between hosts the budget starts
// now. A sender's time in the future is ignored.
MonotonicTime ServerSessions::deadline_of(const Session& session, const Header& header,
                                          MonotonicTime now) const noexcept {
  const Duration budget = std::chrono::microseconds{header.budget_us};
  if (session.has_our_clock && header.sender_time_ns <= static_cast<std::uint64_t>(to_ns(now))) {
    return time_from_ns(static_cast<std::int64_t>(header.sender_time_ns)) + budget;
  }
  return now + budget;
}

// hp-5.1-5: refuses with a kept REPLY, so that a duplicate gets the same answer; a call that wants
// no reply is only counted.
ServerSessions::Answer ServerSessions::refuse_call(const Request& request, Status status,
                                                   MonotonicTime now) noexcept {
  if (status != Status::kExpired) ++counters_.refused_count;
  const ConstBytes frame = complete(request, status, 0, now);
  if (frame.empty()) return {};
  return {Verdict::Action::kSend, frame};
}

// Null if the request is completed, its session has ended, or another call uses the slot.
ServerSessions::Slot* ServerSessions::slot_of(const Request& request) noexcept {
  Session& session = sessions_[request.session_index];
  Slot& slot = session.slots[request.slot_index];
  const bool is_open = session.id == request.header.session &&
                       slot.call_id == request.header.call_id &&
                       slot.state == Slot::State::kRunning;
  return is_open ? &slot : nullptr;
}

std::optional<PeerAddress> ServerSessions::peer_of(const Request& request) const noexcept {
  const Session& session = sessions_[request.session_index];
  if (session.id != request.header.session) return std::nullopt;
  return session.peer;
}

void ServerSessions::set_tag(const Request& request, std::uint32_t tag) noexcept {
  Slot* const slot = slot_of(request);
  RTPM_ASSERT(slot != nullptr && tag != 0, "a request that runs gets a tag");
  slot->tag = tag;
}

std::uint32_t ServerSessions::next_cancelled() noexcept {
  if (cancelled_.empty()) return 0;
  const std::uint32_t tag = cancelled_.back();
  cancelled_.pop_back();
  return tag;
}

std::uint32_t ServerSessions::reply_size_max(const Request& request) const noexcept {
  const Session& session = sessions_[request.session_index];
  if (session.id != request.header.session) return config_.message_size_max;
  return std::min(config_.message_size_max, session.message_size_max);
}

MutableBytes ServerSessions::reply_buffer(const Request& request, MonotonicTime now) noexcept {
  std::uint32_t size_max = reply_size_max(request);
  if (large_.has_buffers()) {
    if (is_short_of_buffers(request, now)) size_max = std::min(size_max, payload_size_max_);
    return large_.scratch().first(size_max);
  }
  // A reply that is not sent must not overwrite a kept one.
  const Slot* const slot = slot_of(request);
  const bool is_sent = slot != nullptr && !slot->is_unawaited && slot->frame_size == 0;
  std::byte* const frame =
      is_sent ? frame_of(request.session_index, request.slot_index) : unsent_frame_.front().bytes;
  return {frame + kHeaderSize, std::min(payload_size_max_, size_max)};
}

// hp-5.8-3: the reply is kept like any other; the method runs after it was sent.
ConstBytes ServerSessions::accept(const Request& request, Status status,
                                  MonotonicTime now) noexcept {
  Slot* const slot = slot_of(request);
  RTPM_ASSERT(slot != nullptr && request.wants_receipt() && !slot->is_unawaited,
              "a receipt is given once, before anything else");
  slot->is_unawaited = true;
  return write_reply(request, *slot, status, 0, now);
}

ConstBytes ServerSessions::complete(const Request& request, Status status,
                                    std::uint32_t payload_size, MonotonicTime now,
                                    MutableBytes reserved) noexcept {
  if (!reserved.empty()) large_.put_in_place_of_scratch(reserved);
  Slot* const slot = slot_of(request);
  if (slot == nullptr) {
    ++counters_.orphaned_count;
    return {};
  }
  // Frees the buffer of a large request, which is no longer read.
  free_large_buffer(*slot);
  slot->state = Slot::State::kDone;
  slot->tag = 0;
  if (slot->is_unawaited) return {};
  return write_reply(request, *slot, status, payload_size, now);
}

ConstBytes ServerSessions::write_reply(const Request& request, Slot& slot, Status status,
                                       std::uint32_t payload_size, MonotonicTime now) noexcept {
  // hp-5.1-2
  Header header = header_about(request.header, FrameKind::kReply, payload_size, now);
  header.status = status;
  header.budget_us = to_us(now - request.received);
  if (slot.stream != ServerStreams::kNone) {
    // hp-5.10-6: tells the caller which frames it lacks. The stream is kept until all have arrived.
    const OutgoingStream& items = streams_.items(slot.stream);
    header.item = items.count();
    if (items.is_acknowledged()) free_stream(slot);
  }
  if (payload_size > payload_size_max_) return complete_large(request, slot, header, now);
  std::byte* frame = frame_of(request.session_index, request.slot_index);
  if (large_.has_buffers() && payload_size > 0) {
    std::memcpy(frame + kHeaderSize, large_.scratch().data(), payload_size);
  }
  encode(header, frame);
  slot.frame_size = static_cast<std::uint32_t>(kHeaderSize + payload_size);
  return {frame, slot.frame_size};
}

// hp-5.9-1, hp-5.9-2: a call that has not started never runs; a running servant is notified.
ServerSessions::Answer ServerSessions::on_cancel(const Header& header, ConstBytes payload,
                                                 const PeerAddress& peer,
                                                 MonotonicTime now) noexcept {
  Session* session = find(header.session);
  if (session == nullptr) return drop(DropReason::kUnknownSession);
  if (!(session->peer == peer)) return drop(DropReason::kForeignAddress);
  if (!payload.empty()) return drop(DropReason::kBadPayload);
  session->last_heard = now;
  Slot& slot = session->slots[header.call_id % kCallWindow];
  const bool is_known = slot.state != Slot::State::kEmpty;
  if (is_known && slot.call_id == header.call_id) {
    const bool is_open = slot.state != Slot::State::kDone;
    cancel(slot);
    free_stream(slot);
    if (slot.state != Slot::State::kRunning) free_large_buffer(slot);
    if (slot.state == Slot::State::kReceiving) slot.state = Slot::State::kDone;
    if (is_open) ++counters_.cancelled_count;
    return {};
  }
  // The CANCEL overtook its call, which must not run when it arrives.
  if (is_known && !is_newer(header.call_id, slot.newest_call_id)) {
    return drop(DropReason::kStaleCall);
  }
  if (is_known && slot.state == Slot::State::kRunning) {
    // An older call keeps the slot; the later one counts as refused.
    slot.newest_call_id = header.call_id;
    ++counters_.cancelled_count;
    return {};
  }
  free_stream(slot);
  free_large_buffer(slot);
  slot = Slot{
      .state = Slot::State::kDone, .call_id = header.call_id, .newest_call_id = header.call_id};
  ++counters_.cancelled_count;
  return {};
}

// Records that the caller gave up. The running servant is notified if the request has a tag.
void ServerSessions::cancel(Slot& slot) noexcept {
  if (slot.state != Slot::State::kRunning || std::exchange(slot.is_unawaited, true)) return;
  if (slot.tag != 0) cancelled_.push_back(slot.tag);
}

}  // namespace rtpm::wire
