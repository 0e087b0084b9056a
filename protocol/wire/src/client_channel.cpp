#include "rtpm/wire/client_channel.hpp"

#include <algorithm>
#include <utility>

#include "rtpm/base/assert.hpp"

// The session of a channel: handshake, received frames, timers.
namespace rtpm::wire {
namespace {

constexpr std::size_t kHelloFrameSize = kHeaderSize + Hello::kSize;

}  // namespace

// A client repeats a call at least every second (hp-5.3-3), so a server that received any
// transmission of it has heard from the session since (hp-5.5-1).
bool has_not_run(std::uint64_t lost_epoch, std::uint64_t epoch_now, MonotonicTime begun,
                 MonotonicTime now) noexcept {
  return lost_epoch == epoch_now && now - begun < kSessionIdleMin;
}

ClientChannel::ClientChannel(const ClientChannelConfig& config, MutableBytes buffer)
    : config_(config), buffer_(buffer), handshake_number_(config.handshake_number) {
  RTPM_ASSERT(buffer.size() >= kHelloFrameSize, "a channel's buffer holds a HELLO");
  RTPM_ASSERT(config.client_epoch != 0, "a client has an epoch");
  RTPM_ASSERT(config.open_call_max >= 1 && config.open_call_max <= kCallWindow,
              "a channel has 1 to 8 calls at a time");
  frame_payload_max_ = static_cast<std::uint32_t>(
      std::min(buffer.size() - kHeaderSize, frame_payload_max(config.medium)));
  calls_.assign(config.open_call_max, Call(round_trip_));
}

void ClientChannel::reset() noexcept {
  is_ready_ = is_opening_ = false;
  end_all();
  session_ = 0;
}

void ClientChannel::end_all() noexcept {
  for (Call& call : calls_) {
    // The items of a stream that ended successfully can still be taken.
    if (!call.is_ended) end_call(call);
  }
}

ConstBytes ClientChannel::open(Priority priority, MonotonicTime deadline,
                               MonotonicTime now) noexcept {
  reset();
  is_opening_ = may_answer_cookie_ = true;
  hello_priority_ = priority;
  ++handshake_number_;  // hp-4-2: answers to earlier handshakes do not match it.
  hello_deadline_ = deadline;
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
  if (is_opening_) return std::min(hello_deadline_, hello_timer_.due());
  MonotonicTime next = kNever;
  for (const Call& call : calls_) {
    if (call.is_open) next = std::min(next, due(call));
  }
  return next;
}

ChannelEvent ClientChannel::on_time(MonotonicTime now) noexcept {
  if (is_opening_) {
    if (now >= hello_deadline_) {
      is_opening_ = false;
      return {.kind = ChannelEvent::Kind::kTimeout};
    }
    if (now < hello_timer_.due()) return {};
    hello_timer_.repeat(now);
    may_answer_cookie_ = true;
    // A stream loses no HELLO, so only the deadline matters.
    if (config_.medium == Medium::kStream) return {};
    return {.kind = ChannelEvent::Kind::kSend, .frame = hello_frame(now)};
  }
  for (Call& call : calls_) {
    if (call.is_open && now >= due(call)) return on_call_time(call, now);
  }
  return {};
}

ChannelEvent ClientChannel::drop(DropReason reason) noexcept {
  counters_.drop(reason);
  return {};
}

ChannelEvent ClientChannel::on_frame(ConstBytes frame, MonotonicTime now) noexcept {
  ++counters_.received_count;
  Header header;
  if (auto read = decode_frame(frame, config_.medium, header); !read) {
    ChannelEvent event = drop(read.error());
    if (config_.medium == Medium::kStream) {
      // hp-8-2: the start of the next frame is unknown.
      reset();
      event.kind = ChannelEvent::Kind::kBroken;
    }
    return event;
  }
  const ConstBytes payload = frame.subspan(kHeaderSize);
  switch (header.kind) {
    case FrameKind::kReply:
      return on_reply(header, payload, now);
    case FrameKind::kItem:
      return on_item(header, payload, now);
    case FrameKind::kCookie:
      return on_cookie(header, payload, now);
    case FrameKind::kWelcome:
      return on_welcome(header, payload, now);
    case FrameKind::kRefuse:
      return on_refuse(header, payload);
    case FrameKind::kAck:
      return on_ack(header, payload, now);
    case FrameKind::kClose:
      return on_close(header, payload);
    case FrameKind::kHello:
    case FrameKind::kCall:
    case FrameKind::kCancel:
    case FrameKind::kCredit:
      break;
  }
  // hp-3-1: only a server receives these.
  return drop(DropReason::kBadKind);
}

// hp-4-3: an answer belongs to the handshake whose number it repeats; others are stale.
bool ClientChannel::is_of_this_handshake(const Header& header) const noexcept {
  return is_opening_ && header.call_id == handshake_number_;
}

ChannelEvent ClientChannel::on_cookie(const Header& header, ConstBytes payload,
                                      MonotonicTime now) noexcept {
  if (!is_of_this_handshake(header) || config_.medium == Medium::kStream) {
    return drop(DropReason::kUnexpected);
  }
  if (payload.size() != cookie_.size()) return drop(DropReason::kBadPayload);
  std::ranges::copy(payload, cookie_.begin());
  // hp-4.2-3, hp-4.2-4: sides that answered each other's answers would never stop.
  if (!std::exchange(may_answer_cookie_, false)) return {};
  return {.kind = ChannelEvent::Kind::kSend, .frame = hello_frame(now)};
}

ChannelEvent ClientChannel::on_welcome(const Header& header, ConstBytes payload,
                                       MonotonicTime now) noexcept {
  if (!is_of_this_handshake(header)) return drop(DropReason::kUnexpected);
  const auto welcome = decode_welcome(payload);
  // hp-4.3-1: a session that cannot carry a single call is refused.
  if (!welcome || header.session == 0 || !welcome->band.contains(hello_priority_)) {
    return drop(DropReason::kBadPayload);
  }
  welcome_ = *welcome;
  session_ = header.session;
  is_ready_ = true;
  is_opening_ = false;
  hello_timer_.end(now);
  return {.kind = ChannelEvent::Kind::kReady};
}

ChannelEvent ClientChannel::on_refuse(const Header& header, ConstBytes payload) noexcept {
  // hp-4.4-3: treated as an answer, it would mean that a method ran.
  if (header.status == Status::kOk) return drop(DropReason::kUnexpected);
  // hp-4.4-2
  if (!payload.empty()) return drop(DropReason::kBadPayload);
  if (is_of_this_handshake(header) && header.session == 0) {
    is_opening_ = false;
    return {.kind = ChannelEvent::Kind::kRefused, .status = header.status};
  }
  const auto refused = std::ranges::find_if(calls_, [&](const Call& call) {
    return call.is_open && !call.is_ended && call.header.call_id == header.call_id;
  });
  if (!is_ready_ || header.session != session_) return drop(DropReason::kUnexpected);
  if (header.status == Status::kUnknownSession) {
    if (refused != calls_.end()) {
      // hp-5.5-3: the caller decides whether the calls may be sent again.
      is_ready_ = false;
      const CallIndex index = index_of(*refused);
      end_all();
      return {.kind = ChannelEvent::Kind::kLost, .call = index, .status = header.status};
    }
    // It concerns a oneway or an ended call. Open calls will notice by themselves.
    const bool is_idle = std::ranges::none_of(
        calls_, [](const Call& call) { return call.is_open && !call.is_ended; });
    if (is_idle) is_ready_ = false;
  }
  if (refused == calls_.end()) return drop(DropReason::kUnexpected);
  end_call(*refused);
  return {.kind = ChannelEvent::Kind::kReply, .call = index_of(*refused), .status = header.status};
}

// hp-4.5-2: only a peer that sees the session's traffic knows its number.
ChannelEvent ClientChannel::on_close(const Header& header, ConstBytes payload) noexcept {
  if (!is_ready_ || header.session != session_) return drop(DropReason::kUnexpected);
  if (!payload.empty()) return drop(DropReason::kBadPayload);
  reset();
  return {.kind = ChannelEvent::Kind::kClosed, .status = Status::kStopping};
}

}  // namespace rtpm::wire
