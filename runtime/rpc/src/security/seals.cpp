#include "security/seals.hpp"

#include <algorithm>

#include "model/lane_setup.hpp"

namespace rtpm::rpc {
namespace {

// Each requires a look-up in the grants, below a microsecond.
constexpr std::uint32_t kReviewsPerTurn = 32;

// A program may open this many connections at once. A further handshake ends its connection.
constexpr std::uint32_t kStreamBurst = 128;

}  // namespace

Seals::Seals(const LaneSetup& setup, wire::ServerSessions& datagrams, wire::ServerSessions& streams,
             transport::WaitSet& wait_set)
    : control_(*setup.access),
      admission_(*setup.access, *setup.audit, *setup.handshake_rate),
      link_(wait_set, *setup.gatekeeper_bell),
      session_count_max_(setup.server->session_count_max),
      reviewed_(control_.generation()),
      reviewing_(reviewed_) {
  open(datagrams_, setup, wire::Medium::kDatagram, datagrams);
  open(streams_, setup, wire::Medium::kStream, streams);
}

void Seals::open(Medium& medium, const LaneSetup& setup, wire::Medium kind,
                 wire::ServerSessions& sessions) {
  sealed::SealedServerConfig config;
  config.medium = kind;
  config.identity = setup.identity;
  config.admission = &admission_;
  config.key = setup.key;
  config.session_count_max = session_count_max_;
  config.job_count_max = GatekeeperLink::kDatagramJobCountMax;
  if (kind == wire::Medium::kStream) {
    config.key.low = ~config.key.low;
    config.job_count_max = GatekeeperLink::kStreamJobCountMax;
    config.job_burst = kStreamBurst;
  }
  config.takes_unsealed = true;
  const std::size_t size = sealed::SealedServer::memory_size(config);
  medium.memory = rt::SecretMemory(size);
  config.memory = medium.memory.bytes();
  if (config.memory.size() == size) medium.server.emplace(config, sessions);
}

wire::Verdict Seals::on_frame(bool is_stream, MutableBytes frame, const wire::PeerAddress& peer,
                              MonotonicTime now) noexcept {
  sealed::SealedServer& server = is_stream ? streams() : datagrams();
  const sealed::SealedServer::Outcome outcome = server.on_frame(frame, peer, now);
  if (outcome.job != nullptr) link_.submit({outcome.job, is_stream});
  return outcome.verdict;
}

void Seals::begin_turn(MonotonicTime now) noexcept {
  turn_left_ = kReviewsPerTurn;
  for (Medium* const medium : {&datagrams_, &streams_}) {
    if (now >= medium->server->next_time()) medium->server->on_time(now);
  }
  const std::uint32_t generation = control_.generation();
  if (review_ != Review::kNone || generation == reviewed_) [[likely]]
    return;
  reviewing_ = generation;
  begin_part(Review::kDatagrams, session_count_max_);
}

void Seals::begin_part(Review part, std::size_t count) noexcept {
  review_ = part;
  review_left_ = count;
}

std::optional<Seals::Event> Seals::next_event(Connections& connections,
                                              MonotonicTime now) noexcept {
  while (const auto work = link_.take_done()) {
    has_progress_ = true;
    if (auto event = on_done(*work, connections, now)) return event;
  }
  while (review_ != Review::kNone && turn_left_ > 0) {
    --turn_left_;
    if (auto event = review_next(connections, now)) {
      has_progress_ = true;
      return event;
    }
  }
  return std::nullopt;
}

std::optional<Seals::Event> Seals::on_done(const HandshakeWork& work, Connections& connections,
                                           MonotonicTime now) noexcept {
  sealed::SealedServer& server = work.is_stream ? streams() : datagrams();
  Slot* const slot = work.is_stream ? connections.of_peer(work.job->peer()) : nullptr;
  if (work.is_stream && slot == nullptr) {
    server.give_up(*work.job);
    return std::nullopt;
  }
  const sealed::SealedServer::Outcome outcome = server.on_job(*work.job, now);
  if (outcome.job != nullptr) link_.submit({outcome.job, work.is_stream});
  if (outcome.verdict.action != wire::Verdict::Action::kSend) return std::nullopt;
  return Event{outcome.peer, outcome.verdict.frame, slot};
}

// Visits the slots from last to first, because the last connection moves to the slot of an ended
// one.
std::optional<Seals::Event> Seals::review_next(Connections& connections,
                                               MonotonicTime now) noexcept {
  const bool is_stream = review_ == Review::kStreams;
  if (review_left_ == 0) {
    const std::size_t memory_count = connections.of_medium(/*is_memory=*/true).size();
    if (review_ == Review::kDatagrams) {
      begin_part(Review::kStreams, session_count_max_);
    } else if (is_stream) {
      begin_part(Review::kMemory, memory_count);
    } else {
      begin_part(Review::kNone, 0);
      reviewed_ = reviewing_;
    }
    return std::nullopt;
  }
  --review_left_;
  if (review_ == Review::kMemory) return review_memory(connections);
  sealed::SealedServer& server = is_stream ? streams() : datagrams();
  const auto ended =
      server.review(static_cast<std::uint32_t>(session_count_max_ - 1 - review_left_), now);
  if (!ended) return std::nullopt;
  Event event{ended->peer, ended->frame};
  if (is_stream) event.slot = connections.of_peer(ended->peer);
  event.ends_connection = event.slot != nullptr;
  if (is_stream && event.slot == nullptr) return std::nullopt;
  return event;
}

std::optional<Seals::Event> Seals::review_memory(Connections& connections) noexcept {
  const auto slots = connections.of_medium(/*is_memory=*/true);
  if (review_left_ >= slots.size()) return std::nullopt;
  Slot* const slot = slots[review_left_];
  if (control_.keeps(origin_of_user(slot->user), reviewed_)) return std::nullopt;
  return Event{slot->peer, {}, slot, /*ends_connection=*/true};
}

MonotonicTime Seals::next_time() const noexcept {
  if (review_ != Review::kNone) return transport::kAlready;
  return std::min(datagrams_.server->next_time(), streams_.server->next_time());
}

wire::FrameCounters Seals::counters() const noexcept {
  wire::FrameCounters sum = datagrams_.server->counters();
  sum.add(streams_.server->counters());
  return sum;
}

}  // namespace rtpm::rpc
