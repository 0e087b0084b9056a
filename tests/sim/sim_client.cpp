#include "sim_client.hpp"

#include "message.hpp"
#include "rtpm/base/bytes.hpp"
#include "sim_server.hpp"

namespace rtpm::sim {
namespace {

using Kind = wire::ChannelEvent::Kind;

constexpr Priority kPriority{1000};

}  // namespace

SimClient::SimClient(Scheduler& scheduler, Random& random, Network& network, History& history,
                     const ClientProfile& profile)
    : scheduler_(scheduler),
      random_(random),
      network_(network),
      history_(history),
      profile_(profile),
      port_(10'000 + profile.number),
      channel_({.medium = wire::Medium::kDatagram,
                .client_epoch = 100 + profile.number,
                .channel = 1,
                .clock_domain = profile.clock_domain,
                .message_size_max = kMessageSizeMax},
               buffer_),
      calls_left_(profile.call_count) {
  network_.listen(port_, [this](const Bytes& frame, const wire::PeerAddress&) {
    wire::ChannelEvent event = channel_.on_frame(frame, local_now());
    if (event.kind == Kind::kNeedRoom) {
      room_.resize(event.room_size);
      channel_.give_room(room_);
      event = channel_.on_frame(frame, local_now());
    }
    handle(event);
  });
}

void SimClient::start() {
  pause();
}

void SimClient::pause() {
  const bool is_long = random_.chance(profile_.long_pause_per_mille);
  scheduler_.after(is_long ? random_.between(wire::kSessionIdleMin, 2 * wire::kSessionIdleMin)
                           : random_.between(Duration{0}, profile_.pause_max),
                   [this] {
                     if (channel_.is_ready() && random_.chance(profile_.close_per_mille)) {
                       send(channel_.close(local_now()));
                     }
                     begin_call(random_.between(profile_.deadline_min, profile_.deadline_max));
                   });
}

void SimClient::call_once_more(Duration deadline) {
  calls_left_ = 1;
  begin_call(deadline);
}

void SimClient::begin_call(Duration deadline) {
  is_idempotent_ = random_.chance(profile_.idempotent_per_mille);
  const bool is_one_clock = profile_.clock_domain == kServerClock;
  token_ = history_.begin(scheduler_.now(), profile_.number, is_idempotent_,
                          is_one_clock ? scheduler_.now() + deadline : kNever);
  deadline_ = local_now() + deadline;
  payload_.resize(message_size());
  Message{token_, 0, message_size()}.write(payload_);
  may_have_run_ = is_resending_ = false;
  round_ = 0;
  advance();
}

// Sends what is next: a HELLO, or the call.
void SimClient::advance() {
  if (!channel_.is_ready()) {
    send(channel_.open(kPriority, deadline_, local_now()));
  } else {
    epoch_of_call_ = channel_.welcome().server_epoch;
    const auto frame =
        channel_.call({.service = 1, .method = 1, .priority = kPriority, .deadline = deadline_},
                      payload_, local_now());
    // The server said in WELCOME how much it takes.
    if (!frame) return end(Outcome::kNotRun, to_string(frame.error()));
    begun_ = channel_.call_begun();
    send(*frame);
  }
  wait();
}

// Mostly one frame; else up to some dozens, more than a window, unless the server takes none.
std::uint32_t SimClient::message_size() {
  const bool is_refused =
      channel_.is_ready() && channel_.welcome().message_size_max < kMessageSizeMax;
  if (is_refused || !random_.chance(profile_.large_per_mille)) {
    return static_cast<std::uint32_t>(random_.between(Message::kSizeMin, std::size_t{64}));
  }
  return static_cast<std::uint32_t>(
      random_.between(wire::kDatagramPayloadSizeMax, std::size_t{kMessageSizeMax}));
}

void SimClient::send(ConstBytes frame) {
  for (; !frame.empty(); frame = channel_.next_frame(local_now())) {
    network_.send(port_, kServerPort, frame);
  }
}

// Wakes up when the channel has something to do; a little late, as threads do.
void SimClient::wait() {
  const MonotonicTime next = channel_.next_time();
  if (next == kNever) return;
  const Duration lateness = random_.between(Duration{0}, std::chrono::microseconds{100});
  scheduler_.at(next - profile_.clock_offset + lateness, [this, number = ++wait_number_] {
    if (number == wait_number_) handle(channel_.on_time(local_now()));
  });
}

void SimClient::handle(const wire::ChannelEvent& event) {
  switch (event.kind) {
    case Kind::kNothing:
      return wait();
    case Kind::kSend:
      send(event.frame);
      return wait();
    case Kind::kReady:
      return on_ready();
    case Kind::kReply:
      send(event.frame);
      return on_reply(event);
    case Kind::kLost:
      return on_lost();
    case Kind::kRefused:
      return end(may_have_run_ || is_resending_ ? Outcome::kMayHaveRun : Outcome::kNotRun,
                 "no session");
    case Kind::kTimeout:
      return end(Outcome::kMayHaveRun, "timeout");
    case Kind::kBroken:
    case Kind::kItems:
    case Kind::kClosed:
    case Kind::kNeedRoom:
      return end(Outcome::kMayHaveRun, "what a datagram channel does not say");
  }
}

void SimClient::on_ready() {
  if (is_resending_) {
    is_resending_ = false;
    const bool is_same_server = channel_.welcome().server_epoch == epoch_of_call_;
    if (!is_same_server || local_now() - begun_ >= wire::kSessionIdleMin) {
      return end(Outcome::kMayHaveRun, "the server restarted");
    }
  }
  advance();
}

void SimClient::on_reply(const wire::ChannelEvent& event) {
  if (event.status == wire::Status::kOk || event.status == wire::Status::kServantFailed) {
    const Message reply = Message::read(event.payload);
    if (event.payload.size() > wire::kDatagramPayloadSizeMax) ++large_reply_count_;
    history_.reply(scheduler_.now(), token_, reply.token, reply.run_number);
    if (!reply.has_its_filling(event.payload)) {
      history_.broken(scheduler_.now(), token_, "got a reply with bytes that are not its own");
    }
    return end(Outcome::kDone, to_string(event.status));
  }
  end(may_have_run_ ? Outcome::kMayHaveRun : Outcome::kNotRun, to_string(event.status));
}

void SimClient::on_lost() {
  ++lost_count_;
  history_.note(scheduler_.now(),
                "client " + std::to_string(profile_.number) + " lost its session");
  if (++round_ == kRoundCountMax) return end(Outcome::kMayHaveRun, "lost too often");
  if (is_idempotent_) {
    may_have_run_ = true;
  } else {
    is_resending_ = true;
  }
  advance();
}

void SimClient::end(Outcome outcome, std::string_view why) {
  history_.end(scheduler_.now(), token_, outcome, why);
  last_outcome_ = outcome;
  if (--calls_left_ > 0) pause();
}

}  // namespace rtpm::sim
