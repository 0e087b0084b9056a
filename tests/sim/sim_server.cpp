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
  bulk_.assign(profile_.bulk_count * kMessageSizeMax, std::byte{0xee});
  config.bulk_memory = bulk_;
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
    send(datagram.from, verdict.frame);
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
  const Message message = Message::read(request.payload);
  const std::uint32_t run_number = history_.run(scheduler_.now(), message.token);
  if (!message.has_its_filling(request.payload)) {
    history_.broken(scheduler_.now(), message.token, "ran with bytes that are not its own");
  }
  const auto status =
      random_.chance(profile_.failing_per_mille) ? wire::Status::kServantFailed : wire::Status::kOk;
  // The payload views the frame, which is gone when a deferred call ends.
  wire::Request kept = request;
  kept.payload = {};
  scheduler_.after(random_.between(Duration{1000}, profile_.service_max),
                   [this, kept, from, message, run_number, status, life = life_] {
                     if (life != life_) return;
                     finish(kept, from, message.token, run_number, message.reply_size, status);
                   });
}

void SimServer::finish(const wire::Request& request, const wire::PeerAddress& from,
                       History::Token token, std::uint32_t run_number, std::uint32_t reply_size,
                       wire::Status status) {
  const MutableBytes room = sessions_->reply_buffer(request);
  // Where all rooms are taken there may be place for one frame only.
  const std::size_t size = std::min<std::size_t>(reply_size, room.size());
  Message{token, run_number, 0}.write(room.first(size));
  send(from,
       sessions_->complete(request, status, static_cast<std::uint32_t>(size), scheduler_.now()));
  if (profile_.is_lane) serve_next();
}

void SimServer::send(const wire::PeerAddress& to, ConstBytes frame) {
  for (; !frame.empty(); frame = sessions_->next_frame(scheduler_.now())) {
    network_.send(kServerPort, to.port, frame);
  }
}

}  // namespace rtpm::sim
