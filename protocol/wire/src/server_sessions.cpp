#include "rtpm/wire/server_sessions.hpp"

#include <algorithm>
#include <cstring>
#include <limits>

#include "rtpm/base/assert.hpp"

namespace rtpm::wire {
namespace {

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
  payload_size_max_ = std::min(config.frame_payload_max,
                               static_cast<std::uint32_t>(frame_payload_max(config.medium)));
  make_bulks();
  const std::size_t lines_per_frame = lines_for(kHeaderSize + payload_size_max_);
  frames_.resize(is_datagram ? lines_per_frame * kCallWindow * config.session_count_max
                             : lines_per_frame);
  if (!bulks_.empty()) fragment_frame_.resize(lines_per_frame);
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
Verdict ServerSessions::drop(DropReason reason) noexcept {
  counters_.drop(reason);
  return {};
}

Verdict ServerSessions::on_frame(ConstBytes frame, const PeerAddress& peer,
                                 MonotonicTime now) noexcept {
  ++counters_.received_count;
  sending_ = kNoBulk;
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
    case FrameKind::kAck:
      return on_ack(*header, payload, peer, now);
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
      end_session(session);
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

  Slot& slot = session->slots[header.call_id % kCallWindow];
  if (slot.state != Slot::State::kEmpty) {
    if (slot.call_id == header.call_id) return on_copy(slot, *session, header, payload, now);
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
  // An older call whose fragments never all came, or whose reply nobody fetched, ends here.
  free_bulk(slot);
  return admit(*session, header, payload, now);
}

// hp-5.2-1: a copy is never run again. How it is answered depends on how far the call is.
Verdict ServerSessions::on_copy(Slot& slot, Session& session, const Header& header,
                                ConstBytes payload, MonotonicTime now) noexcept {
  if (slot.state == Slot::State::kReceiving) {
    return on_fragment(slot, session, header, payload, now);
  }
  if (slot.state == Slot::State::kRunning) {
    if ((header.flags & kFlagAckWanted) == 0) return drop(DropReason::kDuplicateRunning);
    // hp-5.6-4: who asks how far his fragments are learns that nothing is missing, and stops.
    FragmentAck all;
    all.first_missing = header.fragment_count;
    return acknowledge(header, all, now);
  }
  if (slot.bulk != kNoBulk) {
    ++counters_.duplicate_answered_count;
    sending_ = slot.bulk;
    bulks_[slot.bulk].outgoing.nudge();
    return {Verdict::Action::kSend, next_frame(now), {}};
  }
  // No copy is made on a stream, and of a large reply nothing is kept once it has arrived.
  if (config_.medium == Medium::kStream || slot.frame_size == 0) {
    return drop(DropReason::kStaleCall);
  }
  ++counters_.duplicate_answered_count;
  std::byte* frame = frame_of(index_of(session), header.call_id % kCallWindow);
  store_le<std::uint16_t>(frame + 6, kFlagRepeated);
  return {Verdict::Action::kSend, ConstBytes(frame, slot.frame_size), {}};
}

// The first frame of a call that was never seen: from here on its slot remembers it.
Verdict ServerSessions::admit(Session& session, const Header& header, ConstBytes payload,
                              MonotonicTime now) noexcept {
  const std::uint32_t slot_index = header.call_id % kCallWindow;
  Slot& slot = session.slots[slot_index];
  slot = {Slot::State::kRunning, header.call_id, header.call_id, 0, kNoBulk};
  const Request request{header, payload,           deadline_of(session, header, now),
                        now,    index_of(session), slot_index};
  if (header.message_size > config_.message_size_max) {
    return refuse_call(request, Status::kTooLarge, now);
  }
  if (!config_.band.contains(header.priority)) {
    return refuse_call(request, Status::kWrongBand, now);
  }
  if (header.priority > config_.ceiling) {
    return refuse_call(request, Status::kPriorityNotAllowed, now);
  }
  // hp-5.4-3: what is late here is late for its caller, too.
  if (request.deadline <= now) {
    ++counters_.expired_count;
    return refuse_call(request, Status::kExpired, now);
  }
  if (header.fragment_count > 1) return receive_large(request, slot, session);
  return {Verdict::Action::kDispatch, {}, request};
}

// hp-5.4-2: on one host the time that the frame lay in a socket counts; between hosts the budget
// runs from here. A sender's time in the future is not believed.
MonotonicTime ServerSessions::deadline_of(const Session& session, const Header& header,
                                          MonotonicTime now) const noexcept {
  const Duration budget = std::chrono::microseconds{header.budget_us};
  if (session.has_our_clock && header.sender_time_ns <= static_cast<std::uint64_t>(to_ns(now))) {
    return time_from_ns(static_cast<std::int64_t>(header.sender_time_ns)) + budget;
  }
  return now + budget;
}

Verdict ServerSessions::receive_large(const Request& request, Slot& slot,
                                      Session& session) noexcept {
  const std::uint16_t index = take_bulk(Bulk::Use::kRequest, request.received);
  if (index == kNoBulk) return refuse_call(request, Status::kOverload, request.received);
  slot.state = Slot::State::kReceiving;
  slot.bulk = index;
  Bulk& bulk = bulks_[index];
  bulk.session_index = request.session_index;
  bulk.slot_index = request.slot_index;
  bulk.deadline = request.deadline;
  bulk.incoming.begin(request.header, bulk.room);
  return on_fragment(slot, session, request.header, request.payload, request.received);
}

Verdict ServerSessions::on_fragment(Slot& slot, Session& session, const Header& header,
                                    ConstBytes payload, MonotonicTime now) noexcept {
  Bulk& bulk = bulks_[slot.bulk];
  const IncomingMessage::Taken taken = bulk.incoming.take(header, payload);
  if (taken == IncomingMessage::Taken::kForeign) return drop(DropReason::kBadFragment);
  if (taken != IncomingMessage::Taken::kLast) {
    if ((header.flags & kFlagAckWanted) == 0) return {};
    return acknowledge(header, bulk.incoming.ack(), now);
  }
  slot.state = Slot::State::kRunning;
  const Request request{header, bulk.incoming.message(), deadline_of(session, header, now),
                        now,    index_of(session),       header.call_id % kCallWindow};
  if (request.deadline > now) return {Verdict::Action::kDispatch, {}, request};
  ++counters_.expired_count;
  return refuse_call(request, Status::kExpired, now);
}

Verdict ServerSessions::acknowledge(const Header& about, const FragmentAck& ack,
                                    MonotonicTime now) noexcept {
  const Header header = ack_header(about, now);
  encode(header, answer_.data());
  encode(ack, MutableBytes(answer_).subspan(kHeaderSize));
  return {Verdict::Action::kSend, ConstBytes(answer_).first(kHeaderSize + FragmentAck::kSize), {}};
}

// How far a large reply has arrived.
Verdict ServerSessions::on_ack(const Header& header, ConstBytes payload, const PeerAddress& peer,
                               MonotonicTime now) noexcept {
  Session* session = find(header.session);
  if (session == nullptr) return drop(DropReason::kUnknownSession);
  if (!(session->peer == peer)) return drop(DropReason::kForeignAddress);
  const auto ack = decode_ack(payload);
  if (!ack) return drop(DropReason::kBadPayload);
  session->last_heard = now;
  Slot& slot = session->slots[header.call_id % kCallWindow];
  if (slot.state != Slot::State::kDone || slot.call_id != header.call_id || slot.bulk == kNoBulk) {
    return drop(DropReason::kUnexpected);
  }
  OutgoingMessage& reply = bulks_[slot.bulk].outgoing;
  reply.on_ack(*ack);
  if (reply.is_acknowledged()) {
    // hp-5.6-8
    free_bulk(slot);
    return {};
  }
  sending_ = slot.bulk;
  return {Verdict::Action::kSend, next_frame(now), {}};
}

ConstBytes ServerSessions::next_frame(MonotonicTime now) noexcept {
  if (sending_ == kNoBulk) return {};
  const MutableBytes to(fragment_frame_.front().bytes, fragment_frame_.size() * sizeof(CacheLine));
  const ConstBytes frame = bulks_[sending_].outgoing.next(to, 0, now);
  if (frame.empty()) sending_ = kNoBulk;
  return frame;
}

// A room for a large message; where none is free, that of one for which nobody waits any more.
std::uint16_t ServerSessions::take_bulk(Bulk::Use use, MonotonicTime now) noexcept {
  for (std::size_t i = 0; i < bulks_.size(); ++i) {
    Bulk& bulk = bulks_[i];
    if (bulk.use == Bulk::Use::kScratch) continue;
    if (bulk.use != Bulk::Use::kFree) {
      Slot& slot = sessions_[bulk.session_index].slots[bulk.slot_index];
      // A request that is being served is in use, however late it is.
      if (bulk.deadline > now || slot.state == Slot::State::kRunning) continue;
      // Of half a request that is forgotten any more is a late copy.
      slot.state = Slot::State::kDone;
      free_bulk(slot);
    }
    bulk.use = use;
    return static_cast<std::uint16_t>(i);
  }
  return kNoBulk;
}

void ServerSessions::free_bulk(Slot& slot) noexcept {
  if (slot.bulk == kNoBulk) return;
  Bulk& bulk = bulks_[slot.bulk];
  bulk.use = Bulk::Use::kFree;
  bulk.incoming.clear();
  bulk.outgoing.clear();
  slot.bulk = kNoBulk;
}

// hp-5.1-5: by a REPLY that is kept like any other, so that a copy is answered alike.
Verdict ServerSessions::refuse_call(const Request& request, Status status,
                                    MonotonicTime now) noexcept {
  if (status != Status::kExpired) ++counters_.refused_count;
  return {Verdict::Action::kSend, complete(request, status, 0, now), {}};
}

MutableBytes ServerSessions::reply_buffer(const Request& request) noexcept {
  const std::uint32_t size_max =
      std::min(config_.message_size_max, sessions_[request.session_index].message_size_max);
  if (scratch_ == kNoBulk && !bulks_.empty()) {
    scratch_ = take_bulk(Bulk::Use::kScratch, request.received);
  }
  if (scratch_ != kNoBulk) {
    const MutableBytes room = bulks_[scratch_].room;
    return room.first(std::min<std::size_t>(room.size(), size_max));
  }
  return {frame_of(request.session_index, request.slot_index) + kHeaderSize,
          std::min(payload_size_max_, size_max)};
}

ConstBytes ServerSessions::complete(const Request& request, Status status,
                                    std::uint32_t payload_size, MonotonicTime now) noexcept {
  Slot& slot = sessions_[request.session_index].slots[request.slot_index];
  RTPM_ASSERT(slot.state == Slot::State::kRunning && slot.call_id == request.header.call_id,
              "a request is completed once");
  // The request's own room, if it was large: nobody reads it from here on.
  free_bulk(slot);
  slot.state = Slot::State::kDone;
  // hp-5.1-2: what is not set here is repeated from the call.
  Header header = request.header;
  header.kind = FrameKind::kReply;
  header.flags = 0;
  header.status = status;
  header.fragment_index = 0;
  header.fragment_count = 1;
  header.payload_size = header.message_size = payload_size;
  header.budget_us = to_us(now - request.received);
  header.sender_time_ns = static_cast<std::uint64_t>(to_ns(now));
  if (payload_size > payload_size_max_) return complete_large(request, slot, header, now);
  std::byte* frame = frame_of(request.session_index, request.slot_index);
  if (scratch_ != kNoBulk && payload_size > 0) {
    std::memcpy(frame + kHeaderSize, bulks_[scratch_].room.data(), payload_size);
  }
  encode(header, frame);
  slot.frame_size = static_cast<std::uint32_t>(kHeaderSize + payload_size);
  return {frame, slot.frame_size};
}

// The scratch, which holds the reply, goes with it until it has arrived.
ConstBytes ServerSessions::complete_large(const Request& request, Slot& slot, const Header& header,
                                          MonotonicTime now) noexcept {
  RTPM_ASSERT(scratch_ != kNoBulk && header.message_size <= bulks_[scratch_].room.size(),
              "a reply fits its buffer");
  slot.bulk = scratch_;
  slot.frame_size = 0;
  Bulk& bulk = bulks_[scratch_];
  bulk.use = Bulk::Use::kReply;
  bulk.session_index = request.session_index;
  bulk.slot_index = request.slot_index;
  bulk.deadline = request.deadline;
  bulk.outgoing.begin(header, bulk.room.first(header.message_size), payload_size_max_,
                      window_of(config_.medium));
  sending_ = slot.bulk;
  scratch_ = take_bulk(Bulk::Use::kScratch, now);
  return next_frame(now);
}

// hp-4.5-1: a CLOSE with a forged address must not end what another opened.
void ServerSessions::on_close(const Header& header, const PeerAddress& peer) noexcept {
  Session* session = find(header.session);
  if (session == nullptr || !(session->peer == peer)) {
    counters_.drop(session == nullptr ? DropReason::kUnknownSession : DropReason::kForeignAddress);
    return;
  }
  end_session(*session);
}

void ServerSessions::end_session(Session& session) noexcept {
  for (Slot& slot : session.slots)
    free_bulk(slot);
  session = Session{};
  --session_count_;
}

void ServerSessions::forget(const PeerAddress& peer) noexcept {
  for (Session& session : sessions_) {
    if (session.id == 0 || !(session.peer == peer)) continue;
    end_session(session);
  }
}

}  // namespace rtpm::wire
