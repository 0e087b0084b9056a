#include "rtpm/wire/server_sessions.hpp"

#include <algorithm>
#include <limits>

#include "rtpm/base/assert.hpp"

namespace rtpm::wire {
namespace {

// How much of a reply fits on a datagram; on a stream the lane's configuration says it.
constexpr std::size_t kDatagramSlotSize = kDatagramFrameSizeMax;

// Calls count up and wrap around; of two within half the circle the later one is newer.
bool is_newer(std::uint32_t call_id, std::uint32_t than) noexcept {
  return static_cast<std::int32_t>(call_id - than) > 0;
}

std::uint32_t to_us(Duration duration) noexcept {
  const auto us = std::chrono::duration_cast<std::chrono::microseconds>(duration).count();
  return static_cast<std::uint32_t>(
      std::clamp<std::int64_t>(us, 0, std::numeric_limits<std::uint32_t>::max()));
}

}  // namespace

ServerSessions::ServerSessions(const ServerSessionsConfig& config)
    : config_(config), cookies_(config.key), sessions_(config.session_count_max) {
  RTPM_ASSERT(config.session_count_max >= 1 && config.session_count_max <= 0xffff,
              "a lane has 1 to 65535 sessions");
  RTPM_ASSERT(config.epoch != 0, "a server has an epoch");
  const bool is_datagram = config.medium == Medium::kDatagram;
  if (is_datagram) {
    config_.message_size_max =
        std::min(config_.message_size_max, static_cast<std::uint32_t>(kDatagramPayloadSizeMax));
  }
  const std::size_t frame_size =
      is_datagram ? kDatagramSlotSize : kHeaderSize + config_.message_size_max;
  reply_frame_size_max_ = static_cast<std::uint32_t>(frame_size);
  const std::size_t lines_per_frame = (frame_size + sizeof(CacheLine) - 1) / sizeof(CacheLine);
  frames_.resize(is_datagram ? lines_per_frame * kCallWindow * config.session_count_max
                             : lines_per_frame);
}

std::byte* ServerSessions::frame_of(std::uint32_t session_index,
                                    std::uint32_t slot_index) noexcept {
  // On a stream nothing is sent twice, so that no reply is kept and one buffer serves all.
  if (config_.medium == Medium::kStream) return frames_.front().bytes;
  const std::size_t lines_per_frame = kDatagramSlotSize / sizeof(CacheLine);
  static_assert(kDatagramSlotSize % sizeof(CacheLine) == 0);
  return frames_[(session_index * std::size_t{kCallWindow} + slot_index) * lines_per_frame].bytes;
}

// hp-8-1
Verdict ServerSessions::drop(DropReason reason) noexcept {
  counters_.drop(reason);
  return {};
}

Verdict ServerSessions::on_frame(ConstBytes frame, const PeerAddress& peer,
                                 MonotonicTime now) noexcept {
  ++counters_.received_count;
  const auto header = decode_frame(frame);
  if (!header) {
    Verdict verdict = drop(header.error());
    // hp-8-2: after a bad header nobody knows where on a stream the next frame begins.
    if (config_.medium == Medium::kStream) verdict.action = Verdict::Action::kHangUp;
    return verdict;
  }
  const ConstBytes payload = frame.subspan(kHeaderSize);
  switch (header->kind) {
    case FrameKind::kCall:
      return on_call(*header, payload, peer, now);
    case FrameKind::kHello:
      return on_hello(*header, payload, peer, now);
    case FrameKind::kClose:
      on_close(*header, peer);
      return {};
    case FrameKind::kCookie:
    case FrameKind::kWelcome:
    case FrameKind::kRefuse:
    case FrameKind::kReply:
      break;
  }
  // hp-3-1: only a client receives these.
  return drop(DropReason::kBadKind);
}

// A refusal is a bare header, so that it is never larger than what it answers (hp-4.4-2).
Verdict ServerSessions::refuse(const Header& about, Status status, MonotonicTime now) noexcept {
  ++counters_.refused_count;
  Header header;
  header.kind = FrameKind::kRefuse;
  header.priority = about.priority;
  header.session = about.session;
  header.call_id = about.call_id;
  header.status = status;
  header.sender_time_ns = static_cast<std::uint64_t>(to_ns(now));
  encode(header, answer_.data());
  return {Verdict::Action::kSend, ConstBytes(answer_).first(kHeaderSize), {}};
}

Verdict ServerSessions::on_hello(const Header& header, ConstBytes payload, const PeerAddress& peer,
                                 MonotonicTime now) noexcept {
  const auto hello = decode_hello(payload);
  if (!hello) return drop(DropReason::kBadPayload);
  // hp-4.1-2, hp-4.1-3: what can't be served is refused before it costs more.
  if (hello->version_min > kVersion || hello->version_max < kVersion) {
    return refuse(header, Status::kVersionUnsupported, now);
  }
  if (hello->message_size_max < kMessageSizeFloor ||
      hello->message_size_max > kMessageSizeCeiling) {
    return refuse(header, Status::kBadLimits, now);
  }
  if (!config_.band.contains(header.priority)) return refuse(header, Status::kWrongBand, now);

  Header answer;
  answer.priority = header.priority;
  answer.call_id = header.call_id;
  answer.sender_time_ns = static_cast<std::uint64_t>(to_ns(now));
  // hp-4.2-1: on datagrams a session needs proof of the address; on a stream it is proven.
  if (config_.medium == Medium::kDatagram &&
      !cookies_.is_good(hello->cookie, peer, hello->client_epoch, now)) {
    if (hello->cookie != Cookie{}) counters_.drop(DropReason::kBadCookie);
    const Cookie cookie = cookies_.give(peer, hello->client_epoch, now);
    answer.kind = FrameKind::kCookie;
    answer.payload_size = answer.message_size = static_cast<std::uint32_t>(cookie.size());
    encode(answer, answer_.data());
    std::ranges::copy(cookie, answer_.begin() + kHeaderSize);
    return {Verdict::Action::kSend, ConstBytes(answer_).first(kHeaderSize + cookie.size()), {}};
  }
  Session* session = find_or_open(*hello, header.call_id, peer, now);
  if (session == nullptr) return refuse(header, Status::kOverload, now);
  Welcome welcome;
  welcome.band = config_.band;
  welcome.ceiling = config_.ceiling;
  welcome.server_epoch = config_.epoch;
  welcome.clock_domain = config_.clock_domain;
  welcome.message_size_max = config_.message_size_max;
  answer.kind = FrameKind::kWelcome;
  answer.session = session->id;
  answer.payload_size = answer.message_size = Welcome::kSize;
  encode(answer, answer_.data());
  encode(welcome, MutableBytes(answer_).subspan(kHeaderSize));
  return {Verdict::Action::kSend, ConstBytes(answer_).first(kHeaderSize + Welcome::kSize), {}};
}

ServerSessions::Session* ServerSessions::find_or_open(const Hello& hello,
                                                      std::uint32_t handshake_number,
                                                      const PeerAddress& peer,
                                                      MonotonicTime now) noexcept {
  // Linear, because handshakes are rare and a table of 256 is small. The copy of a HELLO whose
  // WELCOME was lost finds the session that it opened (hp-4.1-4).
  Session* best = nullptr;
  for (Session& session : sessions_) {
    if (session.id != 0 && session.peer == peer && session.client_epoch == hello.client_epoch &&
        session.channel == hello.channel && session.handshake_number == handshake_number) {
      session.last_heard = now;
      return &session;
    }
    if (config_.medium == Medium::kStream && session.id != 0 && session.peer == peer) {
      // hp-4-4: a connection carries one session; a further HELLO on it begins that anew.
      session.id = 0;
      --session_count_;
      best = &session;
      break;
    }
    if (session.id == 0) {
      if (best == nullptr || best->id != 0) best = &session;
    } else if (best == nullptr || (best->id != 0 && session.last_heard < best->last_heard)) {
      best = &session;
    }
  }
  RTPM_ASSERT(best != nullptr, "a server has room for at least one session");
  if (best->id != 0) {
    // hp-5.5-1: a client that still repeats a call relies on its session.
    if (now - best->last_heard < kSessionIdleMin) return nullptr;
    ++counters_.session_evicted_count;
    --session_count_;
  }
  *best = Session{};
  const auto index = static_cast<std::uint64_t>(best - sessions_.data());
  std::array<std::byte, 16> seed{};
  ByteWriter writer(seed);
  writer.put(config_.epoch);
  writer.put(++session_serial_);
  // The upper 48 bits can't be guessed, the lower 16 find the session without a search. Never 0.
  best->id =
      ((siphash_2_4(config_.key, seed) | (std::uint64_t{1} << 16)) & ~std::uint64_t{0xffff}) |
      index;
  best->peer = peer;
  best->client_epoch = hello.client_epoch;
  best->channel = hello.channel;
  best->handshake_number = handshake_number;
  best->last_heard = now;
  best->has_our_clock = hello.clock_domain != 0 && hello.clock_domain == config_.clock_domain;
  best->message_size_max = hello.message_size_max;
  ++session_count_;
  ++counters_.session_opened_count;
  return best;
}

ServerSessions::Session* ServerSessions::find(std::uint64_t id) noexcept {
  const auto index = static_cast<std::size_t>(id & 0xffff);
  if (id == 0 || index >= sessions_.size() || sessions_[index].id != id) return nullptr;
  return &sessions_[index];
}

Verdict ServerSessions::on_call(const Header& header, ConstBytes payload, const PeerAddress& peer,
                                MonotonicTime now) noexcept {
  Session* session = find(header.session);
  if (session == nullptr) {
    // hp-4.4-1: the client shall see at once that this is another life of the server.
    counters_.drop(DropReason::kUnknownSession);
    return refuse(header, Status::kUnknownSession, now);
  }
  // hp-5.1-4: the address was proven for this session, and no other was.
  if (!(session->peer == peer)) return drop(DropReason::kForeignAddress);
  session->last_heard = now;

  const auto session_index = static_cast<std::uint32_t>(session - sessions_.data());
  const std::uint32_t slot_index = header.call_id % kCallWindow;
  Slot& slot = session->slots[slot_index];
  if (slot.state != Slot::State::kEmpty) {
    if (slot.call_id == header.call_id) {
      // hp-5.2-1: a copy is never run again.
      if (slot.state == Slot::State::kRunning) return drop(DropReason::kDuplicateRunning);
      if (config_.medium == Medium::kStream) return drop(DropReason::kStaleCall);
      ++counters_.duplicate_answered_count;
      std::byte* frame = frame_of(session_index, slot_index);
      store_le<std::uint16_t>(frame + 6, kFlagRepeated);
      return {Verdict::Action::kSend, ConstBytes(frame, slot.frame_size), {}};
    }
    // The window is the client's promise; a call whose place is still taken breaks it. Whoever was
    // told so may rely on it: a copy is not run either when there is room again (hp-5.2-3).
    // Of what the session left behind nobody waits any more (hp-5.2-2).
    const bool is_new = is_newer(header.call_id, slot.newest_call_id);
    if (!is_new && header.call_id != slot.newest_call_id) return drop(DropReason::kStaleCall);
    slot.newest_call_id = header.call_id;
    if (!is_new || slot.state == Slot::State::kRunning) {
      return refuse(header, Status::kOverload, now);
    }
  }
  slot = {Slot::State::kRunning, header.call_id, header.call_id, 0};

  Request request{header, payload, {}, now, session_index, slot_index};
  if (payload.size() > config_.message_size_max) {
    return refuse_call(request, Status::kTooLarge, now);
  }
  if (!config_.band.contains(header.priority)) {
    return refuse_call(request, Status::kWrongBand, now);
  }
  if (header.priority > config_.ceiling) {
    return refuse_call(request, Status::kPriorityNotAllowed, now);
  }
  // hp-5.4: on one host the time that the frame lay in a socket counts; between hosts the budget
  // runs from here. A sender's time in the future is not believed.
  const Duration budget = std::chrono::microseconds{header.budget_us};
  request.deadline = now + budget;
  if (session->has_our_clock && header.sender_time_ns <= static_cast<std::uint64_t>(to_ns(now))) {
    request.deadline = time_from_ns(static_cast<std::int64_t>(header.sender_time_ns)) + budget;
  }
  // hp-5.4-3: what is late here is late for its caller, too.
  if (request.deadline <= now) {
    ++counters_.expired_count;
    return refuse_call(request, Status::kExpired, now);
  }
  return {Verdict::Action::kDispatch, {}, request};
}

// hp-5.1-5: by a REPLY that is kept like any other, so that a copy is answered alike.
Verdict ServerSessions::refuse_call(const Request& request, Status status,
                                    MonotonicTime now) noexcept {
  if (status != Status::kExpired) ++counters_.refused_count;
  return {Verdict::Action::kSend, complete(request, status, 0, now), {}};
}

MutableBytes ServerSessions::reply_buffer(const Request& request) noexcept {
  const Session& session = sessions_[request.session_index];
  const std::size_t size =
      std::min<std::size_t>(reply_frame_size_max_ - kHeaderSize, session.message_size_max);
  return {frame_of(request.session_index, request.slot_index) + kHeaderSize, size};
}

ConstBytes ServerSessions::complete(const Request& request, Status status,
                                    std::uint32_t payload_size, MonotonicTime now) noexcept {
  Slot& slot = sessions_[request.session_index].slots[request.slot_index];
  RTPM_ASSERT(slot.state == Slot::State::kRunning && slot.call_id == request.header.call_id,
              "a request is completed once");
  RTPM_ASSERT(payload_size + kHeaderSize <= reply_frame_size_max_, "a reply fits its buffer");
  std::byte* frame = frame_of(request.session_index, request.slot_index);
  // hp-5.1-2: what is not set here is repeated from the call.
  Header header = request.header;
  header.kind = FrameKind::kReply;
  header.flags = 0;
  header.status = status;
  header.payload_size = header.message_size = payload_size;
  header.budget_us = to_us(now - request.received);
  header.sender_time_ns = static_cast<std::uint64_t>(to_ns(now));
  encode(header, frame);
  slot.state = Slot::State::kDone;
  slot.frame_size = static_cast<std::uint32_t>(kHeaderSize + payload_size);
  return {frame, slot.frame_size};
}

// hp-4.5-1: a CLOSE with a forged address must not end what another opened.
void ServerSessions::on_close(const Header& header, const PeerAddress& peer) noexcept {
  Session* session = find(header.session);
  if (session == nullptr || !(session->peer == peer)) {
    counters_.drop(session == nullptr ? DropReason::kUnknownSession : DropReason::kForeignAddress);
    return;
  }
  *session = Session{};
  --session_count_;
}

void ServerSessions::forget(const PeerAddress& peer) noexcept {
  for (Session& session : sessions_) {
    if (session.id == 0 || !(session.peer == peer)) continue;
    session = Session{};
    --session_count_;
  }
}

}  // namespace rtpm::wire
