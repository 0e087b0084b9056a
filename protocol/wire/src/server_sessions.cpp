#include "rtpm/wire/server_sessions.hpp"

#include <algorithm>
#include <cstring>

#include "rtpm/base/assert.hpp"

namespace rtpm::wire {
namespace {

constexpr std::uint64_t kIndexBits = 0xffff;
constexpr int kLaneShift = 16;
constexpr std::uint64_t kLaneBits = std::uint64_t{0xffffff} << kLaneShift;

}  // namespace

ServerSessions::ServerSessions(const ServerSessionsConfig& config)
    : config_(config),
      cookies_(config.key),
      stranger_answers_(config.key, std::max(kStrangerAnswerBurst, config.session_count_max),
                        kStrangerAnswerInterval),
      payload_size_max_(std::min(config.frame_payload_max,
                                 static_cast<std::uint32_t>(frame_payload_max(config.medium)))),
      // sec-4-3: sealed fragments are smaller, so the largest messages would have too many of them.
      item_size_max_(static_cast<std::uint32_t>(std::min<std::size_t>(
          config.message_size_max, std::size_t{payload_size_max_} * kFragmentCountMax))),
      large_({config.large_memory, item_size_max_, payload_size_max_, config.medium}),
      streams_(config.stream_memory, config.medium),
      sessions_(config.session_count_max) {
  RTPM_ASSERT(config.session_count_max >= 1 && config.session_count_max <= 0xffff,
              "a lane has 1 to 65535 sessions");
  RTPM_ASSERT(config.epoch != 0, "a server has an epoch");
  RTPM_ASSERT(config.lane < config.lane_count, "a lane is one of its server's");
  config_.message_size_max =
      large_.has_buffers() ? item_size_max_ : std::min(item_size_max_, payload_size_max_);
  const std::size_t lines_per_frame = lines_for(kHeaderSize + payload_size_max_);
  frames_.resize(config.medium == Medium::kDatagram
                     ? lines_per_frame * kCallWindow * config.session_count_max
                     : lines_per_frame);
  unsent_frame_.resize(lines_per_frame);
  cancelled_.reserve(std::size_t{config.session_count_max} * kCallWindow);
}

std::byte* ServerSessions::frame_of(std::uint32_t session_index,
                                    std::uint32_t slot_index) noexcept {
  // A stream repeats nothing, so no reply is kept and one buffer serves all calls.
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
  large_.stop_sending();
  streams_.stop_repair();
  is_reply_due_ = false;
  // The request is constructed in place: copying freshly written fields costs more than writing
  // them.
  Verdict verdict;
  Request& request = verdict.request;
  if (auto read = decode_frame(frame, config_.medium, request.header); !read) {
    static_cast<void>(drop(read.error()));
    // hp-8-2: after an invalid header the start of the stream's next frame is unknown.
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

// A refusal is a bare header, so it is never larger than its request (hp-4.4-2).
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

// hp-4.1-2, hp-4.1-3, hp-4.1-5: refuses early a HELLO that can't be served.
std::optional<Status> ServerSessions::fault_of(const Header& header,
                                               const Hello& hello) const noexcept {
  if (hello.version_min > kVersion || hello.version_max < kVersion) {
    return Status::kVersionUnsupported;
  }
  if (hello.message_size_max < kMessageSizeFloor || hello.message_size_max > kMessageSizeCeiling) {
    return Status::kBadLimits;
  }
  if (!config_.band.contains(header.priority)) return Status::kWrongBand;
  return std::nullopt;
}

ServerSessions::Answer ServerSessions::on_hello(const Header& header, ConstBytes payload,
                                                const PeerAddress& peer,
                                                MonotonicTime now) noexcept {
  const auto hello = decode_hello(payload);
  if (!hello) return drop(DropReason::kBadPayload);
  const bool is_proven = config_.medium == Medium::kStream ||
                         cookies_.is_good(hello->cookie, peer, hello->client_epoch, now);
  // hp-4.4-5
  if (!is_proven && !stranger_answers_.admit(peer, now)) return drop(DropReason::kRateLimited);
  if (const auto fault = fault_of(header, *hello)) return refuse(header, *fault, now);

  Header answer;
  answer.priority = header.priority;
  answer.call_id = header.call_id;
  answer.sender_time_ns = static_cast<std::uint64_t>(to_ns(now));
  // hp-4.2-1: over datagrams a session requires proof of the address; a stream is itself proof.
  if (!is_proven) {
    if (hello->cookie != Cookie{}) counters_.drop(DropReason::kBadCookie);
    const Cookie cookie = cookies_.give(peer, hello->client_epoch, now);
    answer.kind = FrameKind::kCookie;
    answer.payload_size = answer.message_size = static_cast<std::uint32_t>(cookie.size());
    encode(answer, answer_.data());
    std::ranges::copy(cookie, answer_.begin() + kHeaderSize);
    return {Verdict::Action::kSend, ConstBytes(answer_).first(kHeaderSize + cookie.size()), {}};
  }
  if (is_late(*hello, header.call_id, peer)) return drop(DropReason::kUnexpected);
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

bool ServerSessions::is_of(const Session& session, const Hello& hello,
                           const PeerAddress& peer) noexcept {
  return session.id != 0 && session.peer == peer && session.client_epoch == hello.client_epoch &&
         session.channel == hello.channel;
}

// hp-4.1-6: a stale duplicate of an earlier handshake must not end a later one's session.
bool ServerSessions::is_late(const Hello& hello, std::uint32_t handshake_number,
                             const PeerAddress& peer) const noexcept {
  if (config_.medium == Medium::kStream) return false;
  return std::ranges::any_of(sessions_, [&](const Session& session) {
    return is_of(session, hello, peer) &&
           static_cast<std::int32_t>(handshake_number - session.handshake_number) < 0;
  });
}

ServerSessions::Session* ServerSessions::find_or_open(const Hello& hello,
                                                      std::uint32_t handshake_number,
                                                      const PeerAddress& peer,
                                                      MonotonicTime now) noexcept {
  // Linear: handshakes are rare, the table is small. A repeated HELLO whose WELCOME was lost finds
  // the session that it opened (hp-4.1-4).
  Session* best = nullptr;
  const bool has_capacity = has_capacity_for(peer);
  for (Session& session : sessions_) {
    const bool is_of_channel = is_of(session, hello, peer);
    if (is_of_channel && session.handshake_number == handshake_number) {
      session.last_heard = now;
      return &session;
    }
    if (is_of_channel ||
        (config_.medium == Medium::kStream && session.id != 0 && session.peer == peer)) {
      // hp-4-4, hp-4.1-6: another HELLO replaces the session of its connection or channel.
      end_session(session);
      best = &session;
      break;
    }
    // hp-4-7: a host that has used up its quota only replaces its own sessions.
    if (!has_capacity && (session.id == 0 || !is_same_host(session.peer, peer))) continue;
    if (session.id == 0) {
      if (best == nullptr || best->id != 0) best = &session;
    } else if (best == nullptr || (best->id != 0 && session.last_heard < best->last_heard)) {
      best = &session;
    }
  }
  RTPM_ASSERT(best != nullptr, "a server has a slot for at least one session");
  if (best->id != 0) {
    // hp-5.5-1: a client that still repeats a call relies on its session.
    if (now - best->last_heard < kSessionIdleMin) return nullptr;
    ++counters_.session_evicted_count;
    end_session(*best);
  }
  *best = Session{};
  const auto index = static_cast<std::uint64_t>(best - sessions_.data());
  best->id = new_session_id(index);
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

// Bits 0 to 15 are the session's index, bits 16 to 39 the masked lane; the rest is random and can't
// be guessed without the key.
std::uint64_t ServerSessions::new_session_id(std::uint64_t index) noexcept {
  std::array<std::byte, 24> seed{};
  ByteWriter writer(seed);
  writer.put(config_.epoch);
  writer.put(++session_serial_);
  writer.put(std::uint64_t{config_.lane});
  // Bit 40 ensures that the id is not 0.
  const std::uint64_t random = siphash_2_4(config_.key, seed) | std::uint64_t{1} << 40;
  const std::uint64_t id = (random & ~kLaneBits & ~kIndexBits) | index;
  return id | (lane_mask_of(id) ^ std::uint64_t{config_.lane} << kLaneShift);
}

std::uint64_t ServerSessions::lane_mask_of(std::uint64_t id) const noexcept {
  std::array<std::byte, 16> seed{};
  ByteWriter writer(seed);
  writer.put(config_.epoch);
  writer.put(id & ~kLaneBits);
  return siphash_2_4(config_.key, seed) & kLaneBits;
}

// hp-4.4-4: whether another lane issued `id` in this run of the server. Any other number passes
// with a probability of 2^-24 per lane.
bool ServerSessions::is_of_another_lane(std::uint64_t id) const noexcept {
  const std::uint64_t lane = ((id ^ lane_mask_of(id)) & kLaneBits) >> kLaneShift;
  return lane < config_.lane_count && lane != config_.lane;
}

// hp-4.4-1, hp-4.4-4: tells the client at once that the server restarted; a session of another lane
// is not lost.
ServerSessions::Answer ServerSessions::refuse_session(const Header& about, const PeerAddress& peer,
                                                      MonotonicTime now) noexcept {
  // hp-4.4-5: no host may keep a lane busy with answers. Clients ask again.
  if (config_.medium == Medium::kDatagram && !stranger_answers_.admit(peer, now)) {
    return drop(DropReason::kRateLimited);
  }
  if (!is_of_another_lane(about.session)) {
    counters_.drop(DropReason::kUnknownSession);
    return refuse(about, Status::kUnknownSession, now);
  }
  const Answer refusal = refuse(about, Status::kWrongBand, now);
  // hp-5.8-1
  return (about.flags & kFlagNoReply) != 0 ? Answer{} : refusal;
}

// Whether the host is below its quota of sessions. Only a datagram's address identifies a host; the
// acceptor limits connections.
bool ServerSessions::has_capacity_for(const PeerAddress& peer) const noexcept {
  if (config_.medium == Medium::kStream) return true;
  const auto count = std::ranges::count_if(sessions_, [&](const Session& session) {
    return session.id != 0 && is_same_host(session.peer, peer);
  });
  return count < share_of_one_host(config_.session_count_max);
}

ServerSessions::Session* ServerSessions::find(std::uint64_t id) noexcept {
  const auto index = static_cast<std::size_t>(id & kIndexBits);
  if (id == 0 || index >= sessions_.size() || sessions_[index].id != id) return nullptr;
  return &sessions_[index];
}

bool ServerSessions::is_known(std::uint64_t session) const noexcept {
  const auto index = static_cast<std::size_t>(session & kIndexBits);
  return session != 0 && index < sessions_.size() && sessions_[index].id == session;
}

// hp-4.5-1: a CLOSE from another address must not end the session.
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
    free_large_buffer(slot);
  }
  session = Session{};
  --session_count_;
}

void ServerSessions::end_connection(const PeerAddress& peer) noexcept {
  for (Session& session : sessions_) {
    if (session.id == 0 || !(session.peer == peer)) continue;
    end_session(session);
  }
}

bool ServerSessions::has_session(const PeerAddress& peer) const noexcept {
  return std::ranges::any_of(
      sessions_, [&](const Session& session) { return session.id != 0 && session.peer == peer; });
}

ConstBytes ServerSessions::turn_away(ConstBytes frame, MonotonicTime now) noexcept {
  Header header;
  if (!decode_frame(frame, config_.medium, header) || header.kind != FrameKind::kHello) return {};
  const auto hello = decode_hello(frame.subspan(kHeaderSize));
  if (!hello) return {};
  return refuse(header, fault_of(header, *hello).value_or(Status::kOverload), now).frame;
}

// hp-4.5-2
std::optional<Outgoing> ServerSessions::close_next(MonotonicTime now) noexcept {
  const auto found =
      std::ranges::find_if(sessions_, [](const Session& session) { return session.id != 0; });
  if (found == sessions_.end()) return std::nullopt;
  return close_at(index_of(*found), now);
}

std::optional<PeerAddress> ServerSessions::peer_at(std::uint32_t index) const noexcept {
  if (sessions_[index].id == 0) return std::nullopt;
  return sessions_[index].peer;
}

Outgoing ServerSessions::close_at(std::uint32_t index, MonotonicTime now) noexcept {
  Session& session = sessions_[index];
  Header header;
  header.kind = FrameKind::kClose;
  header.priority = config_.band.low;
  header.session = session.id;
  header.sender_time_ns = static_cast<std::uint64_t>(to_ns(now));
  encode(header, answer_.data());
  const PeerAddress peer = session.peer;
  end_session(session);
  return Outgoing{ConstBytes(answer_).first(kHeaderSize), peer};
}

}  // namespace rtpm::wire
