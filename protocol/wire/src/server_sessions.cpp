#include "rtpm/wire/server_sessions.hpp"

#include <algorithm>
#include <cstring>

#include "rtpm/base/assert.hpp"

namespace rtpm::wire {
namespace {

bool is_same_host(const PeerAddress& a, const PeerAddress& b) noexcept {
  return a.high == b.high && a.low == b.low;
}

// Three quarters of the sessions at most are one host's, so that it can't keep all others out.
std::uint32_t session_count_per_host(std::uint32_t count_max) noexcept {
  return count_max - count_max / 4;
}

}  // namespace

ServerSessions::ServerSessions(const ServerSessionsConfig& config)
    : config_(config), cookies_(config.key), sessions_(config.session_count_max) {
  RTPM_ASSERT(config.session_count_max >= 1 && config.session_count_max <= 0xffff,
              "a lane has 1 to 65535 sessions");
  RTPM_ASSERT(config.epoch != 0, "a server has an epoch");
  const bool is_datagram = config.medium == Medium::kDatagram;
  payload_size_max_ = std::min(config.frame_payload_max,
                               static_cast<std::uint32_t>(frame_payload_max(config.medium)));
  make_bulks();
  const std::size_t lines_per_frame = lines_for(kHeaderSize + payload_size_max_);
  frames_.resize(is_datagram ? lines_per_frame * kCallWindow * config.session_count_max
                             : lines_per_frame);
  if (!bulks_.empty()) fragment_frame_.resize(lines_per_frame);
  unsent_frame_.resize(lines_per_frame);
  make_streams();
  cancelled_.reserve(std::size_t{config.session_count_max} * kCallWindow);
}

void ServerSessions::make_streams() {
  const std::size_t room_size = stream_room_size(config_.medium);
  const std::size_t count =
      std::min<std::size_t>(config_.stream_memory.size() / room_size, kNoStream - 1U);
  streams_.resize(count);
}

// Cuts the memory for large messages in rooms. Without any the largest message is a frame's.
void ServerSessions::make_bulks() {
  const std::size_t room_size = lines_for(config_.message_size_max) * sizeof(CacheLine);
  const std::size_t count = std::min<std::size_t>(config_.bulk_memory.size() / room_size, kNoBulk);
  // One room is the scratch for replies, so that a single one could not take a request.
  if (config_.message_size_max <= payload_size_max_ || count < 2) {
    config_.message_size_max = std::min(config_.message_size_max, payload_size_max_);
    return;
  }
  bulks_.resize(count);
  for (std::size_t i = 0; i < count; ++i) {
    bulks_[i].room = config_.bulk_memory.subspan(i * room_size, config_.message_size_max);
  }
  scratch_ = take_bulk(Bulk::Use::kScratch, MonotonicTime{});
}

std::byte* ServerSessions::frame_of(std::uint32_t session_index,
                                    std::uint32_t slot_index) noexcept {
  // On a stream nothing is sent twice, so that no reply is kept and one buffer serves all.
  if (config_.medium == Medium::kStream) return frames_.front().bytes;
  constexpr std::size_t kLinesPerFrame = kDatagramFrameSizeMax / sizeof(CacheLine);
  static_assert(kDatagramFrameSizeMax % sizeof(CacheLine) == 0);
  return frames_[(session_index * std::size_t{kCallWindow} + slot_index) * kLinesPerFrame].bytes;
}

// hp-8-1
ServerSessions::Answer ServerSessions::drop(DropReason reason) noexcept {
  counters_.drop(reason);
  return {};
}

Verdict ServerSessions::on_frame(ConstBytes frame, const PeerAddress& peer,
                                 MonotonicTime now) noexcept {
  ++counters_.received_count;
  sending_ = kNoBulk;
  repairing_ = kNoStream;
  is_reply_due_ = false;
  // The request is made where it stays: to copy what was just written field by field takes longer
  // than to write it.
  Verdict verdict;
  Request& request = verdict.request;
  if (auto read = decode_frame(frame, request.header); !read) {
    static_cast<void>(drop(read.error()));
    // hp-8-2: after a bad header nobody knows where on a stream the next frame begins.
    if (config_.medium == Medium::kStream) verdict.action = Verdict::Action::kHangUp;
    return verdict;
  }
  request.payload = frame.subspan(kHeaderSize);
  request.received = now;
  const Answer answer = on_kind(request, peer);
  verdict.action = answer.action;
  verdict.frame = answer.frame;
  verdict.credit_tag = answer.credit_tag;
  return verdict;
}

ServerSessions::Answer ServerSessions::on_kind(Request& request, const PeerAddress& peer) noexcept {
  const Header& header = request.header;
  switch (header.kind) {
    case FrameKind::kCall:
      return on_call(request, peer);
    case FrameKind::kHello:
      return on_hello(header, request.payload, peer, request.received);
    case FrameKind::kClose:
      on_close(header, request.payload, peer);
      return {};
    case FrameKind::kAck:
      return on_ack(header, request.payload, peer, request.received);
    case FrameKind::kCancel:
      return on_cancel(header, request.payload, peer, request.received);
    case FrameKind::kCredit:
      return on_credit(header, request.payload, peer, request.received);
    case FrameKind::kCookie:
    case FrameKind::kWelcome:
    case FrameKind::kRefuse:
    case FrameKind::kReply:
    case FrameKind::kItem:
      break;
  }
  // hp-3-1: only a client receives these.
  return drop(DropReason::kBadKind);
}

// A refusal is a bare header, so that it is never larger than what it answers (hp-4.4-2).
ServerSessions::Answer ServerSessions::refuse(const Header& about, Status status,
                                              MonotonicTime now) noexcept {
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

ServerSessions::Answer ServerSessions::on_hello(const Header& header, ConstBytes payload,
                                                const PeerAddress& peer,
                                                MonotonicTime now) noexcept {
  const auto hello = decode_hello(payload);
  if (!hello) return drop(DropReason::kBadPayload);
  // hp-4.1-2, hp-4.1-3, hp-4.1-5: what can't be served is refused before it costs more.
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
  const bool has_room = has_room_for(peer);
  for (Session& session : sessions_) {
    if (session.id != 0 && session.peer == peer && session.client_epoch == hello.client_epoch &&
        session.channel == hello.channel && session.handshake_number == handshake_number) {
      session.last_heard = now;
      return &session;
    }
    if (config_.medium == Medium::kStream && session.id != 0 && session.peer == peer) {
      // hp-4-4: a connection carries one session; a further HELLO on it begins that anew.
      end_session(session);
      best = &session;
      break;
    }
    // hp-4-7: a host that has its share replaces only its own.
    if (!has_room && (session.id == 0 || !is_same_host(session.peer, peer))) continue;
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
    end_session(*best);
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

// Whether the host has fewer sessions than one host may have. Only a datagram's address names a
// host; how many connections a host may open is the acceptor's affair.
bool ServerSessions::has_room_for(const PeerAddress& peer) const noexcept {
  if (config_.medium == Medium::kStream) return true;
  const auto count = std::ranges::count_if(sessions_, [&](const Session& session) {
    return session.id != 0 && is_same_host(session.peer, peer);
  });
  return count < session_count_per_host(config_.session_count_max);
}

ServerSessions::Session* ServerSessions::find(std::uint64_t id) noexcept {
  const auto index = static_cast<std::size_t>(id & 0xffff);
  if (id == 0 || index >= sessions_.size() || sessions_[index].id != id) return nullptr;
  return &sessions_[index];
}

// hp-4.5-1: a CLOSE with a forged address must not end what another opened.
void ServerSessions::on_close(const Header& header, ConstBytes payload,
                              const PeerAddress& peer) noexcept {
  // hp-4.5-3
  if (!payload.empty()) return counters_.drop(DropReason::kBadPayload);
  Session* session = find(header.session);
  if (session == nullptr || !(session->peer == peer)) {
    counters_.drop(session == nullptr ? DropReason::kUnknownSession : DropReason::kForeignAddress);
    return;
  }
  end_session(*session);
}

void ServerSessions::end_session(Session& session) noexcept {
  for (Slot& slot : session.slots) {
    cancel(slot);
    free_stream(slot);
    free_bulk(slot);
  }
  session = Session{};
  --session_count_;
}

void ServerSessions::forget(const PeerAddress& peer) noexcept {
  for (Session& session : sessions_) {
    if (session.id == 0 || !(session.peer == peer)) continue;
    end_session(session);
  }
}

// hp-4.5-2
std::optional<Outgoing> ServerSessions::close_next(MonotonicTime now) noexcept {
  const auto found =
      std::ranges::find_if(sessions_, [](const Session& session) { return session.id != 0; });
  if (found == sessions_.end()) return std::nullopt;
  Header header;
  header.kind = FrameKind::kClose;
  header.priority = config_.band.low;
  header.session = found->id;
  header.sender_time_ns = static_cast<std::uint64_t>(to_ns(now));
  encode(header, answer_.data());
  const PeerAddress peer = found->peer;
  end_session(*found);
  return Outgoing{ConstBytes(answer_).first(kHeaderSize), peer};
}

}  // namespace rtpm::wire
