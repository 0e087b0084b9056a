#include <algorithm>
#include <cstring>
#include <limits>

#include "rtpm/base/assert.hpp"
#include "rtpm/wire/client_channel.hpp"

// The calls of a channel: starting, retransmission, replies, streams, cancellation.
namespace rtpm::wire {
namespace {

// The time left until `deadline`, rounded up, so that it is 0 only if none is left (hp-5.4-1).
std::uint32_t budget_us(MonotonicTime deadline, MonotonicTime now) noexcept {
  if (deadline <= now) return 0;
  const std::int64_t us = std::chrono::ceil<std::chrono::microseconds>(deadline - now).count();
  return static_cast<std::uint32_t>(
      std::min<std::int64_t>(us, std::numeric_limits<std::uint32_t>::max()));
}

}  // namespace

std::uint32_t ClientChannel::budget_of(const Call& call, MonotonicTime now) const noexcept {
  // hp-5.10-7: for a stream, how long the client may be silent.
  if (call.items.is_begun() && call.deadline - now > call.lease) {
    return budget_us(now + call.lease, now);
  }
  return budget_us(call.deadline, now);
}

// hp-4.3-2: a number is free if the call that the server keeps in the same slot has ended. Numbers
// may be skipped.
std::uint32_t ClientChannel::next_call_id() const noexcept {
  std::uint32_t id = call_id_;
  bool is_taken = true;
  while (is_taken) {
    ++id;
    is_taken = std::ranges::any_of(calls_, [&](const Call& call) {
      return call.is_open && (id - call.header.call_id) % welcome_.window == 0;
    });
  }
  return id;
}

std::optional<CallIndex> ClientChannel::free_call() const noexcept {
  const auto open_count = static_cast<std::uint16_t>(
      std::ranges::count_if(calls_, [](const Call& call) { return call.is_open; }));
  if (open_count >= std::min<std::size_t>(calls_.size(), welcome_.window)) return std::nullopt;
  const auto found = std::ranges::find_if(calls_, [](const Call& call) { return !call.is_open; });
  return index_of(*found);
}

bool ClientChannel::has_free_call() const noexcept {
  return is_ready_ && free_call().has_value();
}

expected<ConstBytes, Status> ClientChannel::call(const CallParameters& parameters,
                                                 ConstBytes payload, MonotonicTime now) noexcept {
  const auto index = free_call();
  // hp-4-1, hp-4.3-2
  RTPM_ASSERT(is_ready_ && index, "a channel is ready and has a free call");
  // hp-5.1-8
  if (!welcome_.band.contains(parameters.priority)) return unexpected{Status::kWrongBand};
  const bool is_one_frame = payload.size() <= frame_payload_max_;
  if (payload.size() > std::min(config_.message_size_max, welcome_.message_size_max) ||
      payload.size() > std::size_t{frame_payload_max_} * kFragmentCountMax ||
      (parameters.delivery == Delivery::kSent && !is_one_frame)) {
    return unexpected{Status::kTooLarge};
  }
  Call& call = calls_[*index];
  last_call_ = *index;
  // hp-5.1-1: the count continues across sessions, so no two calls share a number.
  call_id_ = next_call_id();
  call.header = Header{};
  call.header.kind = FrameKind::kCall;
  call.header.priority = parameters.priority;
  call.header.session = session_;
  call.header.call_id = call_id_;
  call.header.service = parameters.service;
  call.header.method = parameters.method;
  call.header.trace_id = parameters.trace_id;
  call.header.payload_size = call.header.message_size = static_cast<std::uint32_t>(payload.size());
  call.deadline = parameters.deadline;
  call.payload = payload;
  call.begun = now;
  if (parameters.delivery == Delivery::kSent) {
    call.header.flags = kFlagNoReply;
    return stamp_call(call, now);
  }
  if (parameters.delivery == Delivery::kReceipt) call.header.flags = kFlagReplyOnReceipt;
  if (parameters.stream_window > 0) {
    call.items.begin(parameters.stream_buffers, parameters.stream_window);
    call.header.item = call.credit_sent = parameters.stream_window;
    call.bytes_sent = stream_bytes_first(config_.medium);
    call.freed_sent = 0;
    call.silence = std::min(parameters.stream_silence, kStreamSilence);
    call.lease = parameters.stream_lease;
    if (config_.medium == Medium::kDatagram) call.lease = std::min(call.lease, kStreamLeaseMax);
  }
  return begin_call(call, now);
}

ConstBytes ClientChannel::begin_call(Call& call, MonotonicTime now) noexcept {
  call.is_open = true;
  call.is_ended = call.has_answered = call.is_credit_due = call.is_asking = false;
  call.request.clear();
  call.reply.clear();
  call.timer.begin(now);
  call.asked = call.item_heard = now;
  call.ask_count = 1;
  call.item_gap = Duration{0};
  if (call.payload.size() <= frame_payload_max_) return stamp_call(call, now);
  call.request.begin(call.header, call.payload, frame_payload_max_, window_of(config_.medium));
  return call.request.next(buffer_, budget_of(call, now), now);
}

void ClientChannel::set_reply_buffer(MutableBytes buffer, CallIndex call) noexcept {
  calls_[call].reply_buffer = buffer;
}

ConstBytes ClientChannel::next_frame(MonotonicTime now) noexcept {
  for (Call& call : calls_) {
    if (!call.is_open) continue;
    if (call.is_credit_due) return credit_frame(call, now);
    if (!call.request.is_begun()) continue;
    const ConstBytes frame = call.request.next(buffer_, budget_of(call, now), now);
    if (!frame.empty()) return frame;
  }
  return {};
}

// hp-5.3-2: each repetition states the time left when it is sent.
ConstBytes ClientChannel::stamp_call(Call& call, MonotonicTime now) noexcept {
  call.header.budget_us = budget_of(call, now);
  call.header.sender_time_ns = static_cast<std::uint64_t>(to_ns(now));
  encode(call.header, buffer_.data());
  if (!call.payload.empty()) {
    std::memcpy(buffer_.data() + kHeaderSize, call.payload.data(), call.payload.size());
  }
  return buffer_.first(kHeaderSize + call.payload.size());
}

// hp-5.1-3: an answer counts only if session, call, service and method match an open call. A stale
// answer matches none.
ClientChannel::Call* ClientChannel::find(const Header& header) noexcept {
  if (header.session != session_) return nullptr;
  for (Call& call : calls_) {
    if (call.is_open && call.header.call_id == header.call_id &&
        call.header.service == header.service && call.header.method == header.method) {
      return &call;
    }
  }
  return nullptr;
}

void ClientChannel::end_call(Call& call) noexcept {
  call.is_open = call.is_ended = false;
  call.request.clear();
  call.items.clear();
}

// Whether to query items instead of repeating the call.
bool ClientChannel::is_stream_known(const Call& call) const noexcept {
  if (!call.items.is_begun()) return false;
  return call.has_answered || (config_.medium == Medium::kStream && !call.request.is_begun());
}

MonotonicTime ClientChannel::due(const Call& call) const noexcept {
  if (call.is_ended) return kNever;
  // hp-5.3-4: frames over a connection are not repeated. hp-5.10-5: but a stream's client sends
  // queries, so that the server knows it is alive.
  if (config_.medium == Medium::kStream && !is_stream_known(call)) return call.deadline;
  return std::min(call.deadline, call.timer.due());
}

ChannelEvent ClientChannel::on_call_time(Call& call, MonotonicTime now) noexcept {
  // A reader that was busy elsewhere sent no queries, so the server owes no answer.
  constexpr std::uint32_t kAskCountMin = 3;
  const bool is_silent =
      call.items.is_begun() && call.ask_count >= kAskCountMin && now - call.asked >= call.silence;
  if (now < call.deadline && !is_silent) return repeat(now, index_of(call));
  ChannelEvent event{.kind = ChannelEvent::Kind::kTimeout, .call = index_of(call)};
  // The server knows a call's deadline itself, but not a stream's.
  if (call.items.is_begun()) event.frame = cancel_frame(call.header, now);
  end_call(call);
  return event;
}

ChannelEvent ClientChannel::repeat(MonotonicTime now, CallIndex index) noexcept {
  Call& call = calls_[index];
  const bool is_asking = call.is_open && is_stream_known(call);
  if (!call.is_open || (config_.medium == Medium::kStream && !is_asking)) return {};
  ++repeat_count_;
  call.timer.repeat(now);
  count_question(call, now);
  ConstBytes frame;
  if (is_asking) {
    ask_after(call, call.timer.current(), now);
    call.is_asking = true;
    frame = credit_frame(call, now);
  } else if (call.request.is_begun() && !call.request.is_acknowledged()) {
    call.request.nudge();
    frame = call.request.next(buffer_, budget_of(call, now), now);
  } else if (call.reply.is_begun()) {
    frame = reply_ack(call, true, now);
  } else if (call.request.is_begun()) {
    frame = call.request.first_again(buffer_, budget_of(call, now), now);
  } else {
    call.header.flags |= kFlagRepeated;
    // hp-5.10-3: the caller learns whether the stream runs before it queries items.
    if (call.items.is_begun()) call.header.flags |= kFlagAckWanted;
    frame = stamp_call(call, now);
  }
  return {.kind = ChannelEvent::Kind::kSend, .call = index, .frame = frame};
}

ChannelEvent ClientChannel::repeat_first(MonotonicTime now) noexcept {
  const auto open = std::ranges::find_if(calls_, [](const Call& call) { return call.is_open; });
  return open == calls_.end() ? ChannelEvent{} : repeat(now, index_of(*open));
}

ChannelEvent ClientChannel::on_reply(const Header& header, ConstBytes payload,
                                     MonotonicTime now) noexcept {
  Call* const call = find(header);
  if (call == nullptr || call->is_ended) return drop(DropReason::kUnexpected);
  if (call->items.is_begun()) return on_stream_end(*call, header, payload, now);
  if (header.fragment_count > 1) return on_large_reply(*call, header, payload, now);
  learn_clock(*call, header, now);
  end_call(*call);
  call->timer.end(now);
  return {.kind = ChannelEvent::Kind::kReply,
          .call = index_of(*call),
          .status = header.status,
          .payload = payload};
}

// hp-5.7-1: all four times are known only if the call and its reply were each sent once.
void ClientChannel::learn_clock(const Call& call, const Header& reply, MonotonicTime now) noexcept {
  const bool is_one_clock =
      config_.clock_domain != 0 && config_.clock_domain == welcome_.clock_domain;
  // 73 years since the host started: larger times are invalid, and their differences could
  // overflow.
  constexpr std::uint64_t kTimeMax = std::uint64_t{1} << 61;
  if (is_one_clock || call.timer.repeat_count() > 0 || call.request.is_begun() ||
      (reply.flags & kFlagRepeated) != 0 || reply.sender_time_ns > kTimeMax) {
    return;
  }
  const MonotonicTime reply_sent = time_from_ns(static_cast<std::int64_t>(reply.sender_time_ns));
  clock_.add(
      {call.begun, reply_sent - std::chrono::microseconds{reply.budget_us}, reply_sent, now});
}

std::optional<PeerClock> ClientChannel::peer_clock(MonotonicTime now) const noexcept {
  if (config_.clock_domain != 0 && config_.clock_domain == welcome_.clock_domain) {
    return PeerClock{};
  }
  return clock_.estimate(now);
}

ChannelEvent ClientChannel::on_large_reply(Call& call, const Header& header, ConstBytes payload,
                                           MonotonicTime now) noexcept {
  // hp-5.6-5: the limit was stated in HELLO.
  if (header.message_size > config_.message_size_max) return drop(DropReason::kBadLength);
  if (!call.reply.is_begun()) {
    // Requests a buffer only at the first fragment: later the current buffer is in use.
    if (call.reply_buffer.size() < header.message_size) {
      return {.kind = ChannelEvent::Kind::kNeedBuffer,
              .call = index_of(call),
              .reply_size = header.message_size};
    }
    call.reply.begin(header, call.reply_buffer);
  }
  const IncomingMessage::Taken taken = call.reply.take(header, payload);
  if (taken == IncomingMessage::Taken::kForeign) return drop(DropReason::kBadFragment);
  call.timer.progress(now);
  if (taken == IncomingMessage::Taken::kLast) {
    end_call(call);
    call.timer.end(now);
    // The ACK lets the server release the reply.
    return {.kind = ChannelEvent::Kind::kReply,
            .call = index_of(call),
            .status = header.status,
            .frame = reply_ack(call, false, now),
            .payload = call.reply.message()};
  }
  if ((header.flags & kFlagAckWanted) == 0) return {};
  return {.kind = ChannelEvent::Kind::kSend,
          .call = index_of(call),
          .frame = reply_ack(call, false, now)};
}

// `is_asking`: nothing arrived for a while, so asks the server to send (hp-5.6-7).
ConstBytes ClientChannel::reply_ack(Call& call, bool is_asking, MonotonicTime now) noexcept {
  Header header = header_about(call.header, FrameKind::kAck, FragmentAck::kSize, now);
  if (is_asking) header.flags = kFlagAckWanted;
  encode(header, small_frame_.data());
  encode(call.reply.ack(), MutableBytes(small_frame_).subspan(kHeaderSize));
  return small_frame_;
}

// The state of the request's fragments, or a keep-alive from a stream's server.
ChannelEvent ClientChannel::on_ack(const Header& header, ConstBytes payload,
                                   MonotonicTime now) noexcept {
  Call* const call = find(header);
  const bool is_stream = call != nullptr && call->items.is_begun() && !call->is_ended;
  if (call == nullptr || (!call->request.is_begun() && !is_stream)) {
    return drop(DropReason::kUnexpected);
  }
  const auto ack = decode_ack(payload);
  if (!ack) return drop(DropReason::kBadPayload);
  if (call->request.is_begun()) call->request.on_ack(*ack);
  if (is_stream && (!call->request.is_begun() || call->request.is_acknowledged())) {
    hear(*call);
    // hp-5.10-5: nothing is missing, so the next question is not urgent.
    ask_after(*call, call->timer.current(), now);
  } else {
    call->timer.progress(now);
  }
  const ConstBytes frame = next_frame(now);
  if (frame.empty()) return {};
  return {.kind = ChannelEvent::Kind::kSend, .call = index_of(*call), .frame = frame};
}

// Records that the server has the call.
void ClientChannel::hear(Call& call) noexcept {
  call.has_answered = true;
  call.request.clear();
  call.ask_count = 0;
}

void ClientChannel::count_question(Call& call, MonotonicTime now) noexcept {
  if (call.ask_count++ == 0) call.asked = now;
}

// The pace of items, and how soon one counts as lost, determine the time of the next query.
void ClientChannel::hear_of_items(Call& call, MonotonicTime now) const noexcept {
  hear(call);
  const Duration least = config_.medium == Medium::kStream ? Duration{kStreamAskIntervalConnected}
                                                           : round_trip_.interval();
  // The rest of an item arrives soon, even if items are rare.
  ask_after(call, call.items.is_midway() ? least : std::max(4 * call.item_gap, least), now);
}

// Often enough that a few losses do not make a side appear silent (hp-5.10-7).
void ClientChannel::ask_after(Call& call, Duration wait, MonotonicTime now) noexcept {
  call.timer.wait(now, std::min({wait, Duration{kStreamAskIntervalMax}, call.silence / 4}));
}

ChannelEvent ClientChannel::on_item(const Header& header, ConstBytes payload,
                                    MonotonicTime now) noexcept {
  Call* const call = find(header);
  if (call == nullptr || !call->items.is_begun()) {
    // hp-5.9-3: the server continues a stream without a reader, because an earlier CANCEL was lost.
    ChannelEvent event = drop(DropReason::kUnexpected);
    if (!is_ready_ || header.session != session_ || call != nullptr) return event;
    event.kind = ChannelEvent::Kind::kSend;
    event.frame = cancel_frame(header, now);
    return event;
  }
  if (call->is_ended) return drop(DropReason::kUnexpected);
  // hp-5.10-10: the limit was stated in HELLO.
  if (header.message_size > config_.message_size_max) return drop(DropReason::kBadLength);
  const bool reveals_gap = call->items.reveals_gap(header.item);
  const std::uint32_t dropped_before = call->items.dropped_count();
  const IncomingStream::Taken taken = call->items.take(header, payload);
  if (taken == IncomingStream::Taken::kForeign) return drop(DropReason::kUnexpected);
  // hp-8-1
  if (call->items.dropped_count() != dropped_before) counters_.drop(DropReason::kUnexpected);
  const bool is_duplicate = taken == IncomingStream::Taken::kDuplicate;
  if (is_duplicate) counters_.drop(DropReason::kUnexpected);
  if (!is_duplicate && (header.flags & kFlagRepeated) == 0 && header.fragment_index == 0) {
    // A long pause must not dominate the mean.
    const Duration gap = std::min<Duration>(now - call->item_heard, kStreamAskIntervalMax / 4);
    call->item_gap += (gap - call->item_gap) / 8;
    call->item_heard = now;
  }
  hear_of_items(*call, now);
  // hp-5.10-4: each gap is reported once; if its repetition is lost, too, the timer triggers a
  // query. A CREDIT for each duplicate would cause endless duplicates.
  if (reveals_gap && !is_duplicate) call->is_credit_due = true;
  look_at_credit(*call);
  if (call->items.is_complete()) return end_of_stream(*call, now);
  ChannelEvent event;
  event.call = index_of(*call);
  if (call->items.has_next()) {
    event.kind = ChannelEvent::Kind::kItems;
  } else if (call->is_credit_due) {
    event.kind = ChannelEvent::Kind::kSend;
    event.frame = credit_frame(*call, now);
  }
  return event;
}

ChannelEvent ClientChannel::on_stream_end(Call& call, const Header& header, ConstBytes payload,
                                          MonotonicTime now) noexcept {
  // hp-5.10-6: lost frames will still arrive, unless the server dropped them.
  const bool is_given_up = header.status == Status::kExpired ||
                           header.status == Status::kCancelled ||
                           header.status == Status::kStopping || header.status == Status::kLost;
  const bool is_duplicate = call.items.is_ended();
  if (!is_given_up && !call.items.end(header.item)) return drop(DropReason::kUnexpected);
  call.end_status = header.status;
  // From now on only items count as progress: a server that can't send the items it counted is
  // effectively silent. Queries them immediately only once, or both sides would do nothing else.
  if (is_duplicate && !is_given_up) return {};
  hear_of_items(call, now);
  if (is_given_up || call.items.is_complete()) {
    ChannelEvent end = end_of_stream(call, now);
    // hp-7-1: the refusal of a stream without items carries the reason.
    if (header.item == 0) end.payload = payload;
    return end;
  }
  call.is_asking = true;
  return {
      .kind = ChannelEvent::Kind::kSend, .call = index_of(call), .frame = credit_frame(call, now)};
}

ChannelEvent ClientChannel::end_of_stream(Call& call, MonotonicTime now) noexcept {
  call.is_ended = true;
  // Another CREDIT lets the server release the items.
  return {.kind = ChannelEvent::Kind::kReply,
          .call = index_of(call),
          .status = call.end_status,
          .frame = credit_frame(call, now)};
}

std::optional<ConstBytes> ClientChannel::next_item(CallIndex index) noexcept {
  Call& call = calls_[index];
  if (!call.is_open || !call.items.is_begun()) return std::nullopt;
  const auto item = call.items.next();
  if (!item && call.is_ended) {
    end_call(call);
    return std::nullopt;
  }
  look_at_credit(call);
  return item;
}

// hp-5.10-4: after half a window, so that the server never stalls.
void ClientChannel::look_at_credit(Call& call) noexcept {
  // Useless before the server has the whole call.
  if (call.is_ended || !call.has_answered) return;
  const IncomingStream& items = call.items;
  const std::uint32_t item_count = items.limit() - call.credit_sent;
  const std::uint32_t frame_count = items.freed_count() - call.freed_sent;
  // The difference may wrap below 0: initially the server may send more than this client's window.
  const auto bytes = static_cast<std::int32_t>(items.credit().byte_limit - call.bytes_sent);
  if (2 * item_count >= call.header.item || frame_count >= kStreamWindow / 2 ||
      2 * std::int64_t{bytes} >= items.byte_window()) {
    call.is_credit_due = true;
  }
}

ConstBytes ClientChannel::credit_frame(Call& call, MonotonicTime now) noexcept {
  Header header = header_about(call.header, FrameKind::kCredit, StreamCredit::kSize, now);
  header.flags = call.is_asking ? kFlagAckWanted : std::uint16_t{0};
  header.budget_us = budget_of(call, now);
  header.item = call.credit_sent = call.items.limit();
  encode(header, small_frame_.data());
  const StreamCredit credit = call.items.credit();
  call.bytes_sent = credit.byte_limit;
  call.freed_sent = call.items.freed_count();
  encode(credit, MutableBytes(small_frame_).subspan(kHeaderSize));
  call.is_credit_due = call.is_asking = false;
  return ConstBytes(small_frame_).first(kHeaderSize + StreamCredit::kSize);
}

ConstBytes ClientChannel::cancel(CallIndex index, MonotonicTime now) noexcept {
  Call& call = calls_[index];
  if (!call.is_open) return {};
  end_call(call);
  return cancel_frame(call.header, now);
}

ConstBytes ClientChannel::cancel_frame(const Header& about, MonotonicTime now) noexcept {
  encode(header_about(about, FrameKind::kCancel, 0, now), small_frame_.data());
  return ConstBytes(small_frame_).first(kHeaderSize);
}

}  // namespace rtpm::wire
