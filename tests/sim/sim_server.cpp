#include "sim_server.hpp"

#include <algorithm>

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
  sessions_ = std::make_unique<wire::ServerSessions>(config);
  is_busy_ = false;
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
  sessions_.reset();
  queue_.clear();
}

wire::FrameCounters SimServer::counters() const {
  wire::FrameCounters sum = former_lives_;
  if (sessions_) sum.add(sessions_->counters());
  return sum;
}

void SimServer::on_datagram(const Bytes& frame, const wire::PeerAddress& from) {
  if (is_busy_) {
    if (queue_.size() < profile_.queue_max) queue_.push_back({frame, from});
    return;
  }
  take_up({frame, from});
}

void SimServer::take_up(const Datagram& datagram) {
  const wire::Verdict verdict =
      sessions_->on_frame(datagram.frame, datagram.from, scheduler_.now());
  if (verdict.action == wire::Verdict::Action::kSend) {
    network_.send(kServerPort, datagram.from.port, verdict.frame);
  } else if (verdict.action == wire::Verdict::Action::kDispatch) {
    is_busy_ = profile_.is_lane;
    run(verdict.request, datagram.from);
  }
}

void SimServer::serve_next() {
  is_busy_ = false;
  while (!is_busy_ && !queue_.empty()) {
    const Datagram datagram = std::move(queue_.front());
    queue_.pop_front();
    take_up(datagram);
  }
}

void SimServer::run(const wire::Request& request, const wire::PeerAddress& from) {
  const auto token = ByteReader(request.payload).take<std::uint64_t>();
  const std::uint32_t run_number = history_.run(scheduler_.now(), token);
  const auto status =
      random_.chance(profile_.failing_per_mille) ? wire::Status::kServantFailed : wire::Status::kOk;
  // The payload views the frame, which is gone when a deferred call ends.
  wire::Request kept = request;
  kept.payload = {};
  scheduler_.after(random_.between(Duration{1000}, profile_.service_max),
                   [this, kept, from, token, run_number, status, life = life_] {
                     if (life != life_) return;
                     finish(kept, from, token, run_number, status);
                   });
}

void SimServer::finish(const wire::Request& request, const wire::PeerAddress& from,
                       History::Token token, std::uint32_t run_number, wire::Status status) {
  ByteWriter writer(sessions_->reply_buffer(request));
  writer.put(token);
  writer.put(run_number);
  const ConstBytes reply = sessions_->complete(
      request, status, static_cast<std::uint32_t>(writer.size()), scheduler_.now());
  network_.send(kServerPort, from.port, reply);
  if (profile_.is_lane) serve_next();
}

}  // namespace rtpm::sim
