#include "rtpm/wire/client_channel.hpp"

#include <algorithm>
#include <cstring>
#include <limits>

#include "rtpm/base/assert.hpp"

namespace rtpm::wire {
namespace {

constexpr std::size_t kHelloFrameSize = kHeaderSize + Hello::kSize;

// What is left until `deadline`, rounded up so that a call with time left never states none
// (hp-5.4-1).
std::uint32_t budget_us(MonotonicTime deadline, MonotonicTime now) noexcept {
  if (deadline <= now) return 0;
  const std::int64_t us = std::chrono::ceil<std::chrono::microseconds>(deadline - now).count();
  return static_cast<std::uint32_t>(
      std::min<std::int64_t>(us, std::numeric_limits<std::uint32_t>::max()));
}

}  // namespace

ClientChannel::ClientChannel(const ClientChannelConfig& config, MutableBytes buffer) noexcept
    : config_(config), buffer_(buffer) {
  RTPM_ASSERT(buffer.size() >= kHelloFrameSize, "a channel's buffer holds a HELLO");
  RTPM_ASSERT(config.client_epoch != 0, "a client has an epoch");
  frame_payload_max_ = static_cast<std::uint32_t>(
      std::min(buffer.size() - kHeaderSize, frame_payload_max(config.medium)));
}

void ClientChannel::reset() noexcept {
  is_ready_ = false;
  end_call();
  session_ = 0;
}

ConstBytes ClientChannel::open(Priority priority, MonotonicTime deadline,
                               MonotonicTime now) noexcept {
  reset();
  activity_ = Activity::kHandshake;
  hello_priority_ = priority;
  ++handshake_number_;  // hp-4-2: an answer to an earlier handshake is told apart by it.
  deadline_ = deadline;
  cookie_ = {};
  hello_timer_.begin(now);
  return hello_frame(now);
}

ConstBytes ClientChannel::hello_frame(MonotonicTime now) noexcept {
  Header header;
  header.kind = FrameKind::kHello;
  header.priority = hello_priority_;
  header.flags = hello_timer_.repeat_count() > 0 ? kFlagRepeated : std::uint16_t{0};
  header.call_id = handshake_number_;
  header.payload_size = header.message_size = Hello::kSize;
  header.sender_time_ns = static_cast<std::uint64_t>(to_ns(now));
  encode(header, buffer_.data());
  Hello hello;
  hello.client_epoch = config_.client_epoch;
  hello.channel = config_.channel;
  hello.clock_domain = config_.clock_domain;
  hello.message_size_max = config_.message_size_max;
  hello.cookie = cookie_;
  encode(hello, buffer_.subspan(kHeaderSize));
  return buffer_.first(kHelloFrameSize);
}

expected<ConstBytes, Status> ClientChannel::call(const CallParameters& parameters,
                                                 ConstBytes payload, MonotonicTime now) noexcept {
  // hp-4-1, hp-4.3-2: one open call is within every window.
  RTPM_ASSERT(is_ready_ && activity_ == Activity::kNone, "a channel carries one call at a time");
  if (payload.size() > std::min(config_.message_size_max, welcome_.message_size_max) ||
      payload.size() > std::size_t{frame_payload_max_} * kFragmentCountMax) {
    return unexpected{Status::kTooLarge};
  }
  activity_ = Activity::kCall;
  call_begun_ = now;
  deadline_ = parameters.deadline;
  call_.kind = FrameKind::kCall;
  call_.priority = parameters.priority;
  call_.flags = 0;
  call_.session = session_;
  // hp-5.1-1: the count goes on from session to session, so that no two calls share a number.
  ++call_.call_id;
  call_.service = parameters.service;
  call_.method = parameters.method;
  call_.trace_id = parameters.trace_id;
  call_.payload_size = call_.message_size = static_cast<std::uint32_t>(payload.size());
  request_.clear();
  reply_.clear();
  call_timer_.begin(now);
  if (payload.size() > frame_payload_max_) {
    request_.begin(call_, payload, frame_payload_max_, window_of(config_.medium));
    return next_frame(now);
  }
  if (!payload.empty()) {
    std::memcpy(buffer_.data() + kHeaderSize, payload.data(), payload.size());
  }
  return stamp_call(now);
}

ConstBytes ClientChannel::next_frame(MonotonicTime now) noexcept {
  if (activity_ != Activity::kCall) return {};
  return request_.next(buffer_, budget_us(deadline_, now), now);
}

// hp-5.3-2: each copy states the time that is left when it is sent.
ConstBytes ClientChannel::stamp_call(MonotonicTime now) noexcept {
  call_.budget_us = budget_us(deadline_, now);
  call_.sender_time_ns = static_cast<std::uint64_t>(to_ns(now));
  encode(call_, buffer_.data());
  return buffer_.first(kHeaderSize + call_.payload_size);
}

ConstBytes ClientChannel::close(MonotonicTime now) noexcept {
  Header header;
  header.kind = FrameKind::kClose;
  header.priority = hello_priority_;
  header.session = session_;
  header.sender_time_ns = static_cast<std::uint64_t>(to_ns(now));
  encode(header, buffer_.data());
  reset();
  return buffer_.first(kHeaderSize);
}

MonotonicTime ClientChannel::next_time() const noexcept {
  switch (activity_) {
    case Activity::kNone:
      return kNever;
    case Activity::kHandshake:
      return std::min(deadline_, hello_timer_.due());
    case Activity::kCall:
      // hp-5.3-4: a stream repeats by itself.
      return config_.medium == Medium::kStream ? deadline_ : std::min(deadline_, call_timer_.due());
  }
  return kNever;
}

ChannelEvent ClientChannel::on_time(MonotonicTime now) noexcept {
  if (now < next_time()) return {};
  const Activity activity = activity_;
  if (now >= deadline_) {
    end_call();
    return {.kind = ChannelEvent::Kind::kTimeout};
  }
  if (activity == Activity::kHandshake) {
    hello_timer_.repeat(now);
    // On a stream the HELLO is on its way; only the deadline counts.
    if (config_.medium == Medium::kStream) return {};
    return {.kind = ChannelEvent::Kind::kSend, .frame = hello_frame(now)};
  }
  return repeat(now);
}

ChannelEvent ClientChannel::repeat(MonotonicTime now) noexcept {
  if (activity_ != Activity::kCall || config_.medium == Medium::kStream) return {};
  call_timer_.repeat(now);
  ++repeat_count_;
  ConstBytes frame;
  if (request_.is_begun() && !request_.is_acknowledged()) {
    request_.nudge();
    frame = next_frame(now);
  } else if (reply_.is_begun()) {
    frame = reply_ack(now);
  } else if (request_.is_begun()) {
    frame = request_.first_again(buffer_, budget_us(deadline_, now), now);
  } else {
    call_.flags = kFlagRepeated;
    frame = stamp_call(now);
  }
  return {.kind = ChannelEvent::Kind::kSend, .frame = frame};
}

ChannelEvent ClientChannel::drop(DropReason reason) noexcept {
  counters_.drop(reason);
  return {};
}

ChannelEvent ClientChannel::on_frame(ConstBytes frame, MonotonicTime now) noexcept {
  ++counters_.received_count;
  const auto header = decode_frame(frame);
  if (!header) {
    ChannelEvent event = drop(header.error());
    if (config_.medium == Medium::kStream) {
      // hp-8-2: nobody knows where the next frame begins.
      reset();
      event.kind = ChannelEvent::Kind::kBroken;
    }
    return event;
  }
  const ConstBytes payload = frame.subspan(kHeaderSize);
  switch (header->kind) {
    case FrameKind::kReply:
      return on_reply(*header, payload, now);
    case FrameKind::kCookie:
      return on_cookie(*header, payload, now);
    case FrameKind::kWelcome:
      return on_welcome(*header, payload, now);
    case FrameKind::kRefuse:
      return on_refuse(*header);
    case FrameKind::kAck:
      return on_ack(*header, payload, now);
    case FrameKind::kHello:
    case FrameKind::kCall:
    case FrameKind::kClose:
      break;
  }
  // hp-3-1: only a server receives these.
  return drop(DropReason::kBadKind);
}

// hp-5.1-3: an answer counts only if session, call, service and method are the current call's. A
// late answer to an earlier call ends here.
bool ClientChannel::is_of_this_call(const Header& header) const noexcept {
  return activity_ == Activity::kCall && header.session == session_ &&
         header.call_id == call_.call_id && header.service == call_.service &&
         header.method == call_.method;
}

void ClientChannel::end_call() noexcept {
  activity_ = Activity::kNone;
  request_.clear();
}

ChannelEvent ClientChannel::on_reply(const Header& header, ConstBytes payload,
                                     MonotonicTime now) noexcept {
  if (!is_of_this_call(header)) return drop(DropReason::kUnexpected);
  if (header.fragment_count > 1) return on_large_reply(header, payload, now);
  learn_clock(header, now);
  end_call();
  call_timer_.end(now);
  return {.kind = ChannelEvent::Kind::kReply, .status = header.status, .payload = payload};
}

// hp-5.7-1: of a call that was sent once, and so was its reply, all four times are known.
void ClientChannel::learn_clock(const Header& reply, MonotonicTime now) noexcept {
  const bool is_one_clock =
      config_.clock_domain != 0 && config_.clock_domain == welcome_.clock_domain;
  // 73 years: beyond, no clock has got since its host started, and differences could overflow.
  constexpr std::uint64_t kTimeMax = std::uint64_t{1} << 61;
  if (is_one_clock || call_timer_.repeat_count() > 0 || request_.is_begun() ||
      (reply.flags & kFlagRepeated) != 0 || reply.sender_time_ns > kTimeMax) {
    return;
  }
  const MonotonicTime reply_sent = time_from_ns(static_cast<std::int64_t>(reply.sender_time_ns));
  clock_.add(
      {call_begun_, reply_sent - std::chrono::microseconds{reply.budget_us}, reply_sent, now});
}

std::optional<PeerClock> ClientChannel::peer_clock(MonotonicTime now) const noexcept {
  if (config_.clock_domain != 0 && config_.clock_domain == welcome_.clock_domain) {
    return PeerClock{};
  }
  return clock_.estimate(now);
}

ChannelEvent ClientChannel::on_large_reply(const Header& header, ConstBytes payload,
                                           MonotonicTime now) noexcept {
  // hp-5.6-5: the limit was stated in HELLO.
  if (header.message_size > config_.message_size_max) return drop(DropReason::kBadLength);
  if (!reply_.is_begun()) {
    // Only now: another room would take the old one away from under a reply that has begun.
    if (room_.size() < header.message_size) {
      return {.kind = ChannelEvent::Kind::kNeedRoom, .room_size = header.message_size};
    }
    reply_.begin(header, room_);
  }
  const IncomingMessage::Taken taken = reply_.take(header, payload);
  if (taken == IncomingMessage::Taken::kForeign) return drop(DropReason::kBadFragment);
  call_timer_.progress(now);
  if (taken == IncomingMessage::Taken::kLast) {
    end_call();
    call_timer_.end(now);
    // The ACK lets the server forget the reply.
    return {.kind = ChannelEvent::Kind::kReply,
            .status = header.status,
            .frame = reply_ack(now),
            .payload = reply_.message()};
  }
  if ((header.flags & kFlagAckWanted) == 0) return {};
  return {.kind = ChannelEvent::Kind::kSend, .frame = reply_ack(now)};
}

ConstBytes ClientChannel::reply_ack(MonotonicTime now) noexcept {
  encode(ack_header(call_, now), ack_frame_.data());
  encode(reply_.ack(), MutableBytes(ack_frame_).subspan(kHeaderSize));
  return ack_frame_;
}

// How far the request's fragments have arrived.
ChannelEvent ClientChannel::on_ack(const Header& header, ConstBytes payload,
                                   MonotonicTime now) noexcept {
  if (!is_of_this_call(header) || !request_.is_begun()) return drop(DropReason::kUnexpected);
  const auto ack = decode_ack(payload);
  if (!ack) return drop(DropReason::kBadPayload);
  request_.on_ack(*ack);
  call_timer_.progress(now);
  const ConstBytes frame = next_frame(now);
  if (frame.empty()) return {};
  return {.kind = ChannelEvent::Kind::kSend, .frame = frame};
}

// hp-4-3: an answer belongs to the handshake whose number it repeats; older ones are late.
bool ClientChannel::is_of_this_handshake(const Header& header) const noexcept {
  return activity_ == Activity::kHandshake && header.call_id == handshake_number_;
}

ChannelEvent ClientChannel::on_cookie(const Header& header, ConstBytes payload,
                                      MonotonicTime now) noexcept {
  if (!is_of_this_handshake(header) || config_.medium == Medium::kStream) {
    return drop(DropReason::kUnexpected);
  }
  if (payload.size() != cookie_.size()) return drop(DropReason::kBadPayload);
  std::ranges::copy(payload, cookie_.begin());
  // hp-4.2-3
  return {.kind = ChannelEvent::Kind::kSend, .frame = hello_frame(now)};
}

ChannelEvent ClientChannel::on_welcome(const Header& header, ConstBytes payload,
                                       MonotonicTime now) noexcept {
  if (!is_of_this_handshake(header)) return drop(DropReason::kUnexpected);
  const auto welcome = decode_welcome(payload);
  // hp-4.3-1: a session that could not carry a single call is none.
  if (!welcome || header.session == 0 || !welcome->band.contains(hello_priority_)) {
    return drop(DropReason::kBadPayload);
  }
  welcome_ = *welcome;
  session_ = header.session;
  is_ready_ = true;
  activity_ = Activity::kNone;
  hello_timer_.end(now);
  return {.kind = ChannelEvent::Kind::kReady};
}

ChannelEvent ClientChannel::on_refuse(const Header& header) noexcept {
  // hp-4.4-3: taken for an answer it would say that a method ran.
  if (header.status == Status::kOk) return drop(DropReason::kUnexpected);
  if (is_of_this_handshake(header) && header.session == 0) {
    activity_ = Activity::kNone;
    return {.kind = ChannelEvent::Kind::kRefused, .status = header.status};
  }
  if (activity_ != Activity::kCall || header.session != session_ ||
      header.call_id != call_.call_id) {
    return drop(DropReason::kUnexpected);
  }
  end_call();
  if (header.status == Status::kUnknownSession) {
    // Whether the call may be sent again is for the caller to judge (hp-5.5-2).
    is_ready_ = false;
    return {.kind = ChannelEvent::Kind::kLost, .status = header.status};
  }
  return {.kind = ChannelEvent::Kind::kReply, .status = header.status};
}

}  // namespace rtpm::wire
