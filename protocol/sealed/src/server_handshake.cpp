#include <algorithm>
#include <utility>

#include "rtpm/sealed/server.hpp"

// The server's side of handshakes for sealed sessions.
namespace rtpm::sealed {
namespace {

using namespace std::chrono_literals;
using wire::DropReason;
using wire::FrameKind;

/// sec-6-1: how long a session lives without a frame from its client.
constexpr Duration kHalfOpenMax = 2s;

constexpr std::size_t kAtChannel = 16;  // The channel's offset in HELLO's payload.

}  // namespace

wire::SealedCookie SealedServer::cookie_of(const wire::Cookie& cookie) const noexcept {
  return {cookie, config_.identity->key.public_key, config_.identity->suites};
}

// Whether `peer` is a connection with a sealed session.
bool SealedServer::has_confirmed_stream(const wire::PeerAddress& peer) const noexcept {
  return config_.medium == wire::Medium::kStream &&
         std::ranges::any_of(entries(), [&](const Entry& entry) {
           return entry.id != 0 && entry.is_confirmed && entry.peer == peer &&
                  sessions_.is_known(entry.id);
         });
}

SealedServer::Outcome SealedServer::on_hello(const wire::Header& header, ConstBytes frame,
                                             const wire::PeerAddress& peer,
                                             MonotonicTime now) noexcept {
  const ConstBytes payload = frame.subspan(wire::kHeaderSize);
  if (payload.size() == wire::SealedHello::kSize) return on_sealed_hello(header, frame, peer, now);
  const auto hello = wire::decode_hello(payload);
  if (!hello) return drop(DropReason::kBadPayload);
  if ((hello->features & wire::kFeatureSealed) != 0) return give_cookie(header, payload, peer, now);
  // sec-6.2-2
  if (!config_.takes_unsealed || has_confirmed_stream(peer)) return drop(DropReason::kUnsealed);
  return on_unsealed_hello(header, frame, peer, now);
}

// Opens a session without identity, if such sessions are allowed.
SealedServer::Outcome SealedServer::on_unsealed_hello(const wire::Header& header, ConstBytes frame,
                                                      const wire::PeerAddress& peer,
                                                      MonotonicTime now) noexcept {
  // sec-6.2-1
  if (!config_.admission->admits_unsealed(peer)) {
    // hp-4.4-5
    if (!refusal_limit_.admit(peer, now)) return drop(DropReason::kRateLimited);
    ++counters_.received_count;
    Outcome outcome;
    outcome.verdict.action = wire::Verdict::Action::kSend;
    outcome.verdict.frame = write_refusal(header, wire::Status::kNotAllowed, now);
    return outcome;
  }
  Outcome outcome{.verdict = sessions_.on_frame(frame, peer, now)};
  wire::Verdict& verdict = outcome.verdict;
  const auto answer = wire::decode(verdict.frame);
  if (!answer || answer->kind != FrameKind::kWelcome) return outcome;
  auto welcome = wire::decode_welcome(verdict.frame.subspan(wire::kHeaderSize));
  if (!welcome) return outcome;
  welcome->ceiling = std::min(welcome->ceiling, config_.admission->ceiling(nullptr, peer));
  std::ranges::copy(verdict.frame, answer_.begin());
  wire::encode(*welcome, MutableBytes(answer_).subspan(wire::kHeaderSize));
  verdict.frame = ConstBytes(answer_).first(verdict.frame.size());
  return outcome;
}

// Passes a HELLO to the sessions as if it had no message 1.
wire::Verdict SealedServer::pass_hello(const wire::Header& header, ConstBytes hello,
                                       const wire::PeerAddress& peer, MonotonicTime now) noexcept {
  std::array<std::byte, wire::kHeaderSize + wire::Hello::kSize> frame;
  wire::Header plain = header;
  plain.payload_size = plain.message_size = wire::Hello::kSize;
  wire::encode(plain, frame.data());
  std::ranges::copy(hello.first(wire::Hello::kSize), frame.begin() + wire::kHeaderSize);
  return sessions_.on_frame(frame, peer, now);
}

// sec-3.1-1: never opens a session. The sessions count unknown peers, and refuse invalid requests.
SealedServer::Outcome SealedServer::give_cookie(const wire::Header& header, ConstBytes hello,
                                                const wire::PeerAddress& peer,
                                                MonotonicTime now) noexcept {
  wire::Header cookie_header;
  wire::SealedCookie cookie = cookie_of({});
  if (config_.medium == wire::Medium::kDatagram) {
    std::array<std::byte, wire::Hello::kSize> blank;
    std::ranges::copy(hello.first(blank.size()), blank.begin());
    std::ranges::fill(MutableBytes(blank).subspan(40, sizeof(wire::Cookie)), std::byte{0});
    const wire::Verdict verdict = pass_hello(header, blank, peer, now);
    if (verdict.action != wire::Verdict::Action::kSend) return {.verdict = verdict};
    const auto answer = wire::decode(verdict.frame);
    if (!answer || answer->kind != FrameKind::kCookie) return {.verdict = verdict};
    cookie_header = *answer;
    std::ranges::copy(verdict.frame.subspan(wire::kHeaderSize), cookie.cookie.begin());
  } else {
    // Not zero, so that the next HELLO shows that there was a cookie.
    cookie.cookie = cookies_.give(peer, load_le<std::uint64_t>(hello.data() + 8), now);
    cookie_header = wire::header_about(header, FrameKind::kCookie, 0, now);
  }
  cookie_header.payload_size = cookie_header.message_size = wire::SealedCookie::kSize;
  wire::encode(cookie_header, answer_.data());
  wire::encode(cookie, MutableBytes(answer_).subspan(wire::kHeaderSize));
  Outcome outcome;
  outcome.verdict.action = wire::Verdict::Action::kSend;
  outcome.verdict.frame = ConstBytes(answer_).first(wire::kHeaderSize + wire::SealedCookie::kSize);
  return outcome;
}

SealedServer::Outcome SealedServer::on_sealed_hello(const wire::Header& header, ConstBytes frame,
                                                    const wire::PeerAddress& peer,
                                                    MonotonicTime now) noexcept {
  const ConstBytes payload = frame.subspan(wire::kHeaderSize);
  const auto read = wire::decode_sealed_hello(payload);
  if (!read) return drop(DropReason::kBadPayload);
  const wire::Hello& hello = read->hello;
  // sec-3.2-2: before any key operation.
  const bool is_stream = config_.medium == wire::Medium::kStream;
  const bool wants_aes = (hello.features & wire::kFeatureAesGcm) != 0;
  const bool has_suite = !wants_aes || (config_.identity->suites &
                                        static_cast<std::uint8_t>(crypto::Suite::kAesGcm)) != 0;
  if (!has_suite ||
      (!is_stream && !cookies_.is_good(hello.cookie, peer, hello.client_epoch, now))) {
    if (has_suite) counters_.drop(DropReason::kBadCookie);
    return give_cookie(header, payload, peer, now);
  }
  const crypto::Digest hash = crypto::sha256(frame, {});
  for (Entry& entry : entries()) {
    if (entry.id == 0 || !(entry.peer == peer) || entry.client_epoch != hello.client_epoch ||
        entry.channel != hello.channel || !sessions_.is_known(entry.id)) {
      continue;
    }
    // sec-3-3: only an exact copy gets the same WELCOME.
    if (entry.hello_hash == hash) {
      if (!entry.has_welcome) return drop(DropReason::kUnexpected);
      Outcome outcome;
      outcome.verdict.action = wire::Verdict::Action::kSend;
      outcome.verdict.frame = entry.welcome;
      return outcome;
    }
    // hp-4.1-6: a stale duplicate of an earlier handshake.
    if (static_cast<std::int32_t>(header.call_id - entry.handshake_number) < 0) {
      return drop(DropReason::kUnexpected);
    }
  }
  return begin_job(header, frame, *read, hash, peer, now);
}

SealedServer::Outcome SealedServer::begin_job(const wire::Header& header, ConstBytes frame,
                                              const wire::SealedHello& hello,
                                              const crypto::Digest& hash,
                                              const wire::PeerAddress& peer,
                                              MonotonicTime now) noexcept {
  const bool is_stream = config_.medium == wire::Medium::kStream;
  for (const HandshakeJob& job : jobs_) {
    if (!job.is_taken_ || !(job.peer_ == peer)) continue;
    if (job.frame_hash_ == hash) return drop(DropReason::kUnexpected);  // A copy.
    // sec-3.2-3
    if (is_stream) return broken(DropReason::kUnexpected);
  }
  const auto found = std::ranges::find(jobs_, false, &HandshakeJob::is_taken_);
  // Over datagrams the client repeats its HELLO; over a stream it reconnects.
  if (found == jobs_.end() || !job_limit_.admit(peer, now) ||
      !config_.admission->admits_handshake(now)) {
    return broken(DropReason::kRateLimited);
  }
  HandshakeJob& job = *found;
  job.is_taken_ = true;
  job.state_ = HandshakeJob::State::kReading;
  job.identity_ = config_.identity;
  job.peer_ = peer;
  job.header_ = header;
  job.hello_ = hello.hello;
  job.suite_ = (hello.hello.features & wire::kFeatureAesGcm) != 0 ? crypto::Suite::kAesGcm
                                                                  : crypto::Suite::kChaChaPoly;
  std::ranges::copy(frame, job.frame_.begin());
  job.frame_hash_ = hash;
  std::array<std::byte, wire::SealedCookie::kSize> cookie;
  wire::encode(cookie_of(hello.hello.cookie), cookie);
  // sec-3.4-1: over a stream there may have been no COOKIE.
  const bool has_cookie =
      config_.medium == wire::Medium::kDatagram || hello.hello.cookie != wire::Cookie{};
  job.prologue_ = wire::prologue_of(header,
                                    std::span<const std::byte, wire::Hello::kSize>(
                                        frame.subspan(wire::kHeaderSize, wire::Hello::kSize)),
                                    has_cookie ? ConstBytes(cookie) : ConstBytes{});
  return {.job = &job};
}

SealedServer::Outcome SealedServer::on_job(HandshakeJob& job, MonotonicTime now) noexcept {
  if (is_wiped()) return {};
  if (job.state_ == HandshakeJob::State::kRead) return open_session(job, now);
  if (job.state_ == HandshakeJob::State::kWritten) return finish(job, now);
  return {};
}

SealedServer::Outcome SealedServer::refuse(HandshakeJob& job, wire::Status status,
                                           MonotonicTime now) noexcept {
  Outcome outcome{.peer = job.peer_};
  outcome.verdict.action = wire::Verdict::Action::kSend;
  outcome.verdict.frame = write_refusal(job.header_, status, now);
  give_up(job);
  return outcome;
}

ConstBytes SealedServer::write_refusal(const wire::Header& about, wire::Status status,
                                       MonotonicTime now) noexcept {
  ++counters_.refused_count;
  wire::Header header = wire::header_about(about, FrameKind::kRefuse, 0, now);
  header.status = status;
  wire::encode(header, answer_.data());
  return ConstBytes(answer_).first(wire::kHeaderSize);
}

void SealedServer::give_up(HandshakeJob& job) noexcept {
  job.responder_.reset();
  job.keys_.reset();
  job.is_taken_ = false;
}

SealedServer::Outcome SealedServer::open_session(HandshakeJob& job, MonotonicTime now) noexcept {
  if (!job.client_) {
    // sec-3.2-2: a client that did not prove its key gets no answer.
    give_up(job);
    return drop(DropReason::kBadSeal);
  }
  // Read first: if grants change meanwhile, the next review checks the session again.
  const std::uint32_t generation = config_.admission->generation();
  if (!config_.admission->admits(*job.client_, job.peer_)) {
    return refuse(job, wire::Status::kNotAllowed, now);
  }
  const Entry* const former = find(job.former_);
  job.granted_.former = job.former_ == 0     ? wire::FormerSession::kNone
                        : now < ended_until_ ? wire::FormerSession::kEnded
                                             : wire::FormerSession::kGone;
  // sec-6-3, sec-6-4: no session is opened if the client's earlier one continues.
  if (former != nullptr && former->session && former->client == *job.client_ &&
      former->peer == job.peer_ && former->granted.band.contains(job.header_.priority)) {
    job.granted_.former = wire::FormerSession::kAlive;
    job.granted_.session = former->id;
    job.granted_.welcome = former->granted;
    job.granted_.welcome.features = job.hello_.features;
  } else {
    // By hp-4-4 this HELLO would end the connection's session.
    if (has_confirmed_stream(job.peer_)) {
      give_up(job);
      return drop(DropReason::kUnexpected);
    }
    if (!make_place(*job.client_, now)) return refuse(job, wire::Status::kOverload, now);
    // sec-6-1: the sessions see each handshake as a separate channel, so it replaces none.
    std::array<std::byte, wire::Hello::kSize> hello;
    std::ranges::copy(ConstBytes(job.frame_).subspan(wire::kHeaderSize, hello.size()),
                      hello.begin());
    std::ranges::copy(ConstBytes(job.frame_hash_).first(8), hello.begin() + kAtChannel);
    const wire::Verdict verdict = pass_hello(job.header_, hello, job.peer_, now);
    const auto answer = wire::decode(verdict.frame);
    if (verdict.action != wire::Verdict::Action::kSend || !answer ||
        answer->kind != FrameKind::kWelcome) {
      give_up(job);
      return {.verdict = verdict, .peer = job.peer_};
    }
    job.granted_.session = answer->session;
    job.granted_.welcome = *wire::decode_welcome(verdict.frame.subspan(wire::kHeaderSize));
    job.granted_.welcome.features = job.hello_.features;
    job.granted_.welcome.ceiling = std::min(job.granted_.welcome.ceiling,
                                            config_.admission->ceiling(&*job.client_, job.peer_));
    Entry& entry = entries()[static_cast<std::size_t>(answer->session & 0xffff)];
    free(entry);
    entry.id = answer->session;
    entry.peer = job.peer_;
    entry.client_epoch = job.hello_.client_epoch;
    entry.channel = job.hello_.channel;
    entry.handshake_number = job.header_.call_id;
    entry.client = *job.client_;
    entry.hello_hash = job.frame_hash_;
    entry.granted = job.granted_.welcome;
    entry.opened = entry.last_heard = now;
    entry.generation = generation;
    entry.freshness = {};
    half_open_due_ = std::min(half_open_due_, now + kHalfOpenMax);
    entry.has_our_clock = job.hello_.clock_domain != 0 &&
                          job.hello_.clock_domain == job.granted_.welcome.clock_domain;
  }
  job.state_ = HandshakeJob::State::kWriting;
  return {.job = &job};
}

SealedServer::Outcome SealedServer::finish(HandshakeJob& job, MonotonicTime now) noexcept {
  job.is_taken_ = false;
  const bool is_new = job.granted_.former != wire::FormerSession::kAlive;
  Entry* const entry = find(job.granted_.session);
  const auto keys = std::move(job.keys_);
  job.keys_.reset();
  // The session may have ended meanwhile; its client repeats the HELLO.
  if (!job.is_written_ || !keys || entry == nullptr ||
      (is_new && entry->hello_hash != job.frame_hash_)) {
    return drop(DropReason::kUnexpected);
  }
  wire::Header header;
  header.kind = FrameKind::kWelcome;
  header.priority = job.header_.priority;
  header.call_id = job.header_.call_id;
  header.session = job.granted_.session;
  header.payload_size = header.message_size = wire::SealedWelcome::kSize;
  header.sender_time_ns = static_cast<std::uint64_t>(to_ns(now));
  wire::encode(header, answer_.data());
  std::ranges::copy(job.message_2_, answer_.begin() + wire::kHeaderSize);
  if (is_new) {
    const bool is_stream = config_.medium == wire::Medium::kStream;
    entry->session.emplace(*keys, is_stream ? crypto::Order::kExact : crypto::Order::kAny,
                           config_.limits);
    entry->welcome = answer_;
    entry->has_welcome = true;
  }
  Outcome outcome{.peer = job.peer_};
  outcome.verdict.action = wire::Verdict::Action::kSend;
  outcome.verdict.frame = answer_;
  return outcome;
}

// sec-6-7: a key may take at most its share of the table, and may only replace its own sessions
// that hp-5.5-1 allows to be replaced.
bool SealedServer::make_place(const crypto::PublicKey& client, MonotonicTime now) noexcept {
  on_time(now);
  make_half_open_place(client, now);
  std::uint32_t count = 0;
  Entry* oldest = nullptr;
  for (Entry& entry : entries()) {
    if (entry.id == 0 || entry.client != client) continue;
    ++count;
    if (oldest == nullptr || entry.last_heard < oldest->last_heard) oldest = &entry;
  }
  if (count < wire::share_of_one_host(config_.session_count_max)) return true;
  if (now - oldest->last_heard < wire::kSessionIdleMin) return false;
  close(*oldest, now);
  return true;
}

// sec-6-1, sec-6-7: half-open sessions may take a quarter of the table, those of one key its share
// of that. A new one replaces the oldest.
void SealedServer::make_half_open_place(const crypto::PublicKey& client,
                                        MonotonicTime now) noexcept {
  const std::uint32_t count_max = std::max(1U, config_.session_count_max / 4);
  const auto replace_oldest = [&](std::uint32_t limit, auto is_meant) {
    std::uint32_t count = 0;
    Entry* oldest = nullptr;
    for (Entry& entry : entries()) {
      if (entry.id == 0 || entry.is_confirmed || !is_meant(entry)) continue;
      ++count;
      if (oldest == nullptr || entry.opened < oldest->opened) oldest = &entry;
    }
    if (count >= limit) close(*oldest, now);
  };
  replace_oldest(wire::share_of_one_host(count_max),
                 [&](const Entry& entry) { return entry.client == client; });
  replace_oldest(count_max, [](const Entry&) { return true; });
}

void SealedServer::on_time(MonotonicTime now) noexcept {
  half_open_due_ = kNever;
  for (Entry& entry : entries()) {
    if (entry.id == 0) continue;
    if (!sessions_.is_known(entry.id)) {
      free(entry);
    } else if (!entry.is_confirmed && now - entry.opened > kHalfOpenMax) {
      close(entry, now);
    } else if (!entry.is_confirmed) {
      // One nanosecond later, so that the comparison above then holds.
      half_open_due_ = std::min(half_open_due_, entry.opened + kHalfOpenMax + Duration{1});
    }
  }
}

}  // namespace rtpm::sealed
