#include "sim_server.hpp"

#include <algorithm>

#include "message.hpp"
#include "rtpm/base/bytes.hpp"

namespace rtpm::sim {

SimServer::SimServer(Scheduler& scheduler, Random& random, Network& network, History& history,
                     const ServerProfile& profile)
    : scheduler_(scheduler),
      random_(random),
      network_(network),
      history_(history),
      profile_(profile) {}

void SimServer::start() {
  ++life_;
  wire::ServerSessionsConfig config;
  config.epoch = random_.between(std::uint64_t{1}, ~std::uint64_t{0} - 1);
  config.clock_domain = kServerClock;
  config.key = {random_.between(std::uint64_t{0}, ~std::uint64_t{0} - 1), life_};
  config.session_count_max = profile_.session_count_max;
  config.message_size_max = kMessageSizeMax;
  large_.assign(profile_.large_count * kMessageSizeMax, std::byte{0xee});
  config.large_memory = large_;
  streams_.assign(profile_.stream_count * stream_buffer_size(wire::Medium::kDatagram),
                  std::byte{0xdd});
  config.stream_memory = streams_;
  if (profile_.sealing != nullptr) {
    config.frame_payload_max =
        static_cast<std::uint32_t>(wire::sealed_payload_max(wire::Medium::kDatagram));
  }
  sessions_ = std::make_unique<wire::ServerSessions>(config);
  if (profile_.sealing != nullptr) {
    sealed_ = std::make_unique<sealed::SealedServer>(
        sealed::SealedServerConfig{.identity = &profile_.sealing->identity(),
                                   .admission = profile_.sealing,
                                   .key = config.key,
                                   .session_count_max = config.session_count_max,
                                   .job_count_max = 3,
                                   .limits = profile_.sealing->limits()},
        *sessions_);
  }
  is_busy_ = false;
  planned_ = kNever;
  network_.listen(kServerPort, [this](const Bytes& frame, const wire::PeerAddress& from) {
    on_datagram(frame, from);
  });
  history_.note(scheduler_.now(), "the server starts");
}

void SimServer::kill() {
  history_.note(scheduler_.now(), "the server dies");
  ++life_;
  network_.listen(kServerPort, nullptr);
  former_lives_ = counters();
  sealed_.reset();
  sessions_.reset();
  queue_.clear();
  jobs_.clear();
}

void SimServer::on_revoked() {
  history_.note(scheduler_.now(), "a client loses its grant");
  if (sealed_) sealed_->end_unadmitted(scheduler_.now());
  if (sessions_) learn_of_cancelled();
}

void SimServer::stop() {
  while (const auto close = sessions_->close_next(scheduler_.now())) {
    transmit(close->peer.port, close->frame);
  }
  kill();
}

wire::FrameCounters SimServer::counters() const {
  wire::FrameCounters sum = former_lives_;
  if (sessions_) sum.add(sessions_->counters());
  if (sealed_) sum.add(sealed_->counters());
  return sum;
}

std::uint32_t SimServer::held_count() const {
  if (!sessions_) return 0;
  return sessions_->stream_count() + sessions_->large_message_count(scheduler_.now()) +
         static_cast<std::uint32_t>(jobs_.size());
}

void SimServer::on_datagram(const Bytes& frame, const wire::PeerAddress& from) {
  if (is_busy_) {
    if (queue_.size() < profile_.queue_max) queue_.push_back({frame, from});
    return;
  }
  take_up({frame, from});
}

void SimServer::take_up(const Datagram& datagram) {
  if (!sealed_) {
    return take_verdict(sessions_->on_frame(datagram.frame, datagram.from, scheduler_.now()),
                        datagram.from);
  }
  Bytes opened = datagram.frame;
  const auto outcome = sealed_->on_frame(opened, datagram.from, scheduler_.now());
  if (outcome.job != nullptr) plan_job(*outcome.job);
  take_verdict(outcome.verdict, datagram.from);
}

// Another thread works on it for a while.
void SimServer::plan_job(sealed::HandshakeJob& job) {
  scheduler_.after(random_.between(Duration{100'000}, Duration{300'000}),
                   [this, &job, life = life_] {
                     if (life != life_) return;
                     job.run();
                     const auto outcome = sealed_->on_job(job, scheduler_.now());
                     if (outcome.job != nullptr) plan_job(*outcome.job);
                     take_verdict(outcome.verdict, outcome.peer);
                   });
}

void SimServer::transmit(std::uint32_t port, ConstBytes frame) {
  if (sealed_) {
    frame = sealed_->seal(frame);
    if (frame.empty()) return;
    profile_.sealing->on_sent(scheduler_.now(), /*is_client=*/false, frame);
  }
  network_.send(kServerPort, port, frame);
}

void SimServer::take_verdict(const wire::Verdict& verdict, const wire::PeerAddress& from) {
  if (verdict.action == wire::Verdict::Action::kSend) {
    send(from, verdict.frame);
  } else if (verdict.action == wire::Verdict::Action::kDispatch) {
    run(verdict.request, from);
  }
  learn_of_cancelled();
  if (verdict.credit_tag != 0) give_items(verdict.credit_tag);
  plan_time();
}

void SimServer::learn_of_cancelled() {
  while (const std::uint32_t tag = sessions_->next_cancelled()) {
    const auto job = jobs_.find(tag);
    if (job == jobs_.end()) {
      history_.note(scheduler_.now(), "FAULT: a call is cancelled that does not run");
      continue;
    }
    job->second.is_cancelled = true;
    // A stream that waits for its caller would wait for ever.
    if (!job->second.request.wants_stream()) continue;
    scheduler_.after(random_.between(Duration{0}, Duration{100'000}), [this, tag, life = life_] {
      if (life == life_) give_items(tag);
    });
  }
}

// Streams end by themselves when no caller asks for them.
void SimServer::plan_time() {
  const MonotonicTime next = sessions_->next_time();
  if (next >= planned_) return;
  planned_ = next;
  scheduler_.at(next, [this, next, life = life_] {
    if (life != life_ || next != planned_) return;
    planned_ = kNever;
    sessions_->on_time(scheduler_.now());
    learn_of_cancelled();
    plan_time();
  });
}

void SimServer::serve_next() {
  is_busy_ = false;
  while (!is_busy_ && !queue_.empty()) {
    const Datagram datagram = std::move(queue_.front());
    queue_.pop_front();
    take_up(datagram);
  }
}

// How late a call may be. sec-6.1: by a millisecond, and by the duration of the fastest call of its
// session, which the server takes for zero.
std::optional<Duration> SimServer::tolerance_of(const wire::Request& request,
                                                const wire::PeerAddress& from) {
  constexpr Duration kRounding = std::chrono::microseconds{2};
  const auto offset = profile_.clock_offset(from.port);
  if (!offset) return kRounding;
  if (!sealed_) return std::nullopt;
  const MonotonicTime now = scheduler_.now();
  const auto sent =
      time_from_ns(static_cast<std::int64_t>(request.header.sender_time_ns)) - *offset;
  Fastest& fastest =
      fastest_.try_emplace(request.header.session, Fastest{now - sent, now}).first->second;
  const Duration grown = fastest.age + (now - fastest.at) / sealed::Freshness::kDriftDivisor;
  if (now - sent < grown) fastest = {now - sent, now};
  return std::min(grown, now - sent) + sealed::Freshness::kTolerance + kRounding;
}

void SimServer::run(const wire::Request& request, const wire::PeerAddress& from) {
  if (request.wants_receipt()) {
    // Some calls are for a missing object.
    const bool is_refused = random_.chance(50);
    const auto status = is_refused ? wire::Status::kNoSuchObject : wire::Status::kOk;
    send(from, sessions_->accept(request, status, scheduler_.now()));
    if (is_refused) {
      send(from, sessions_->complete(request, status, 0, scheduler_.now()));
      return;
    }
  }
  const Message message = Message::read(request.payload);
  const std::uint32_t run_number =
      history_.run(scheduler_.now(), message.token, tolerance_of(request, from));
  if (!message.has_its_filling(request.payload)) {
    history_.broken(scheduler_.now(), message.token, "ran with bytes that are not its own");
  }
  const std::uint32_t tag = ++last_tag_;
  Job& job = jobs_[tag];
  job = {request, message.token, run_number, message.reply_size};
  // The payload views the frame, which is gone when a deferred call ends.
  job.request.payload = {};
  if (random_.chance(profile_.failing_per_mille)) job.status = wire::Status::kServantFailed;
  const Duration service = random_.between(Duration{1000}, profile_.service_max);
  if (request.wants_stream() || !profile_.is_lane) {
    sessions_->set_tag(request, tag);
  } else {
    is_busy_ = true;
  }
  if (request.wants_stream()) {
    job.items_left = static_cast<std::uint32_t>(random_.between(0, profile_.item_count_max));
    give_items(tag);
    return;
  }
  scheduler_.after(service, [this, tag, life = life_] {
    if (life == life_) finish(tag);
  });
}

// Writes an item to the stream if its caller accepts one; then the next, after a while. A stream
// that stopped because of its caller continues when the caller reports more credit.
void SimServer::give_items(std::uint32_t tag) {
  const auto found = jobs_.find(tag);
  if (found == jobs_.end()) return;
  Job& job = found->second;
  if (job.is_cancelled || (job.items_left == 0 && job.item.empty())) return finish(tag);
  if (!send_item(job)) return;
  const Duration gap = random_.chance(10) ? random_.between(Duration{0}, Duration{2'000'000'000})
                                          : random_.between(Duration{0}, Duration{2'000'000});
  scheduler_.after(gap, [this, tag, life = life_] {
    if (life == life_) give_items(tag);
  });
}

// Sends as much of the current item, or of the next one, as its caller accepts; false if the item
// is not complete then.
bool SimServer::send_item(Job& job) {
  const std::size_t size_max = sessions_->item_size_max(job.request);
  if (size_max == 0) return false;
  if (job.item.empty()) {
    const bool is_large = random_.chance(profile_.large_item_per_mille);
    job.item.resize(std::min(size_max, is_large
                                           ? random_.between(std::size_t{64}, size_max)
                                           : random_.between(std::size_t{16}, std::size_t{64})));
    Message{job.token, job.item_number, 0}.write(job.item);
  }
  do {
    const ConstBytes frame = sessions_->push_item(job.request, job.item, scheduler_.now());
    if (frame.empty()) return false;
    if (!std::exchange(job.is_midway, true)) {
      --job.items_left;
      static_cast<void>(history_.give_item(job.token));
    }
    if (const auto peer = sessions_->peer_of(job.request)) {
      transmit(peer->port, frame);
    }
  } while (sessions_->is_item_midway(job.request));
  ++job.item_number;
  job.item.clear();
  job.is_midway = false;
  return true;
}

void SimServer::finish(std::uint32_t tag) {
  const Job job = jobs_.at(tag);
  jobs_.erase(tag);
  const auto peer = sessions_->peer_of(job.request);
  const MutableBytes buffer = sessions_->reply_buffer(job.request, scheduler_.now());
  // With all buffers taken, one frame may still fit.
  std::size_t size = std::min<std::size_t>(job.reply_size, buffer.size());
  if (job.request.wants_stream()) size = 0;
  if (size > 0) Message{job.token, job.run_number, 0}.write(buffer.first(size));
  const ConstBytes frame = sessions_->complete(job.request, job.status,
                                               static_cast<std::uint32_t>(size), scheduler_.now());
  if (peer) send(*peer, frame);
  if (profile_.is_lane && !job.request.wants_stream()) serve_next();
}

void SimServer::send(const wire::PeerAddress& to, ConstBytes frame) {
  for (; !frame.empty(); frame = sessions_->next_frame(scheduler_.now())) {
    transmit(to.port, frame);
  }
}

}  // namespace rtpm::sim
