#include "sim_client.hpp"

#include <algorithm>

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
      epoch_(100 * profile.number),
      calls_left_(profile.call_count) {
  make_channel();
  network_.listen(port_, [this](const Bytes& frame, const wire::PeerAddress&) { receive(frame); });
}

void SimClient::make_channel() {
  MutableBytes buffer(buffer_);
  if (profile_.sealing != nullptr) {
    Sealing& sealing = *profile_.sealing;
    buffer = buffer.first(wire::kHeaderSize + wire::sealed_payload_max(wire::Medium::kDatagram));
    sealed_.emplace(sealed::SealedClientConfig{
        .own = &sealing.client_key(profile_.number),
        .server = sealing.identity().key.public_key,
        .preshared = &sealing.identity().preshared,
        .handshake_number = static_cast<std::uint32_t>(random_.between(0, 0xffff'ffff)),
        .random = sealing.source(),
        .limits = sealing.limits()});
  }
  channel_.emplace(wire::ClientChannelConfig{.medium = wire::Medium::kDatagram,
                                             .client_epoch = ++epoch_,
                                             .channel = 1,
                                             .clock_domain = profile_.clock_domain,
                                             .message_size_max = kMessageSizeMax,
                                             .open_call_max = profile_.open_call_max,
                                             .handshake_number = static_cast<std::uint32_t>(
                                                 random_.between(0, 0xffff'ffff))},
                   buffer);
}

void SimClient::restart() {
  history_.note(scheduler_.now(), "client " + std::to_string(profile_.number) + " restarts");
  make_channel();
  is_opening_ = false;
  ++wait_number_;
  // Calls that waited before the restart get no reply any more, so any outcome is possible.
  while (!jobs_.empty())
    end(jobs_.begin(), Outcome::kMayHaveRun, "the client died");
}

void SimClient::start() {
  pause();
}

void SimClient::pause() {
  if (is_pausing_ || calls_left_ == 0) return;
  is_pausing_ = true;
  const bool is_long = jobs_.empty() && random_.chance(profile_.long_pause_per_mille);
  scheduler_.after(
      is_long ? random_.between(wire::kSessionIdleMin, 2 * wire::kSessionIdleMin)
              : random_.between(Duration{0}, profile_.pause_max),
      [this] {
        is_pausing_ = false;
        if (calls_left_ == 0 || jobs_.size() >= profile_.open_call_max) return;
        if (sealed_ && channel_->is_ready()) renew();
        if (jobs_.empty() && channel_->is_ready() && random_.chance(profile_.close_per_mille)) {
          send(channel_->close(local_now()));
        }
        --calls_left_;
        if (random_.chance(profile_.abandoned_per_mille)) {
          begin_abandoned_job();
        } else {
          begin_job(random_.between(profile_.deadline_min, profile_.deadline_max),
                    /*is_plain=*/false);
        }
        if (jobs_.size() < profile_.open_call_max) pause();
      });
}

// Sometimes makes new keys, which the channel adopts when it has no open call.
void SimClient::renew() {
  if (jobs_.empty() && sealed_->has_next(local_now())) {
    ++renewal_count_;
    is_opening_ = true;
    send(channel_->open(kPriority, local_now() + Duration{1'000'000'000}, local_now()));
  } else if (random_.chance(200)) {
    follow(sealed_->renew(local_now()));
  }
}

void SimClient::call_once_more(Duration deadline) {
  begin_job(deadline, /*is_plain=*/true);
}

void SimClient::begin_job(Duration deadline, bool is_plain) {
  Job& job = jobs_.emplace_back();
  job.number = ++job_serial_;
  job.is_idempotent = random_.chance(profile_.idempotent_per_mille);
  if (!is_plain && random_.chance(profile_.oneway_per_mille)) {
    job.delivery = random_.chance(500) ? wire::Delivery::kSent : wire::Delivery::kReceipt;
  } else if (!is_plain && random_.chance(profile_.stream_per_mille)) {
    job.is_stream = true;
    deadline += random_.between(Duration{0}, Duration{20'000'000'000});
  }
  job.token = history_.begin(scheduler_.now(), profile_.number, job.is_idempotent,
                             scheduler_.now() + deadline);
  job.deadline = local_now() + deadline;
  const bool is_small = job.delivery == wire::Delivery::kSent;
  // After the disasters there is memory for large messages, whatever was left unfinished before.
  const std::uint64_t large_per_mille =
      is_plain && profile_.large_per_mille > 0 ? 1000 : profile_.large_per_mille;
  job.payload.resize(is_small ? std::size_t{32} : message_size(large_per_mille));
  Message{job.token, 0, message_size(large_per_mille)}.write(job.payload);
  if (!is_plain && random_.chance(profile_.cancel_per_mille)) plan_cancel(job.number);
  pump();
}

// Leaves the server with half a request, or with a large reply, that it would keep for an hour.
void SimClient::begin_abandoned_job() {
  begin_job(std::chrono::hours{1}, /*is_plain=*/true);
  scheduler_.after(random_.between(Duration{0}, Duration{20'000'000}),
                   [this, number = job_serial_] {
                     if (job_number(number) != jobs_.end()) restart();
                   });
}

void SimClient::plan_cancel(std::uint64_t number) {
  scheduler_.after(random_.between(Duration{0}, Duration{100'000'000}), [this, number] {
    const auto job = job_number(number);
    if (job == jobs_.end() || job->is_waiting || job->is_over) return;
    ++cancelled_count_;
    send(channel_->cancel(job->index, local_now()));
    end(job, Outcome::kMayHaveRun, "cancelled");
    wait();
  });
}

// Sends all that is possible: a HELLO, or calls.
void SimClient::pump() {
  const auto is_waiting = [](const Job& job) { return job.is_waiting; };
  if (!channel_->is_ready()) {
    const auto first = std::ranges::find_if(jobs_, is_waiting);
    if (first != jobs_.end() && !is_opening_) {
      is_opening_ = true;
      send(channel_->open(kPriority, first->deadline, local_now()));
    }
    return wait();
  }
  while (channel_->has_free_call()) {
    const auto job = std::ranges::find_if(jobs_, is_waiting);
    if (job == jobs_.end()) break;
    if (may_begin(*job)) {
      begin_call(job);
    } else {
      end(job, Outcome::kMayHaveRun, "the server restarted");
    }
  }
  wait();
}

// hp-5.5-2
bool SimClient::may_begin(Job& job) {
  if (!std::exchange(job.is_resending, false)) return true;
  return channel_->welcome().server_epoch == job.epoch &&
         local_now() - job.begun < wire::kSessionIdleMin;
}

void SimClient::begin_call(Jobs::iterator job) {
  job->epoch = channel_->welcome().server_epoch;
  wire::CallParameters parameters{.service = 1,
                                  .method = 1,
                                  .priority = kPriority,
                                  .deadline = job->deadline,
                                  .delivery = job->delivery};
  if (job->is_stream) {
    parameters.stream_window = static_cast<std::uint32_t>(random_.between(1, wire::kStreamWindow));
    constexpr std::uint32_t kByteWindow = wire::kStreamBytesFirstDatagram;
    job->items.resize(
        std::size_t{wire::kDatagramPayloadSizeMax} *
        wire::stream_frame_count(wire::Medium::kDatagram, parameters.stream_window, kByteWindow));
    job->large_item.resize(kMessageSizeMax);
    parameters.stream_buffers = {.frames = job->items,
                                 .frame_size = wire::kDatagramPayloadSizeMax,
                                 .item = job->large_item,
                                 .byte_window = kByteWindow};
  }
  const auto frame = channel_->call(parameters, job->payload, local_now());
  // Only WELCOME says how large a message the server accepts.
  if (!frame) return end(job, Outcome::kNotRun, to_string(frame.error()));
  job->is_waiting = false;
  job->begun = local_now();
  job->index = channel_->last_call();
  send(*frame);
  if (job->delivery == wire::Delivery::kSent) end(job, Outcome::kSent, "sent");
}

// Mostly one frame; otherwise up to some dozens, more than a window, unless the server accepts
// none.
std::uint32_t SimClient::message_size(std::uint64_t large_per_mille) {
  const bool is_refused =
      channel_->is_ready() && channel_->welcome().message_size_max < kMessageSizeMax;
  if (is_refused || !random_.chance(large_per_mille)) {
    return static_cast<std::uint32_t>(random_.between(Message::kSizeMin, std::size_t{64}));
  }
  return static_cast<std::uint32_t>(
      random_.between(wire::kDatagramPayloadSizeMax, std::size_t{kMessageSizeMax}));
}

void SimClient::send(ConstBytes frame) {
  for (; !frame.empty(); frame = channel_->next_frame(local_now())) {
    if (sealed_) {
      follow(sealed_->send(frame, local_now()));
    } else {
      network_.send(port_, kServerPort, frame);
    }
  }
}

void SimClient::transmit(ConstBytes frame) {
  if (frame.empty()) return;
  profile_.sealing->on_sent(scheduler_.now(), /*is_client=*/true, frame);
  network_.send(port_, kServerPort, frame);
}

// Executes the sealed session's steps for a frame, until there are none.
void SimClient::follow(sealed::SealedClient::Step step) {
  transmit(step.send);
  if (!step.deliver.empty()) {
    // Delivers the frame later: the channel may be in the middle of sending.
    scheduler_.after(Duration{0}, [this, frame = Bytes(step.deliver.begin(), step.deliver.end()),
                                   epoch = epoch_] {
      if (epoch == epoch_) take(frame);
    });
  }
  if (sealed_->has_work()) follow(sealed_->work(local_now()));
}

void SimClient::receive(const Bytes& frame) {
  if (!sealed_) return take(frame);
  Bytes opened = frame;
  follow(sealed_->receive(opened, local_now()));
}

void SimClient::take(ConstBytes frame) {
  wire::ChannelEvent event = channel_->on_frame(frame, local_now());
  if (event.kind == Kind::kNeedBuffer) {
    rooms_[event.call].resize(event.reply_size);
    channel_->set_reply_buffer(rooms_[event.call], event.call);
    event = channel_->on_frame(frame, local_now());
  }
  handle(event);
  wait();
}

// Wakes up when the channel has work; a little late, as threads do.
void SimClient::wait() {
  const MonotonicTime next = channel_->next_time();
  if (next == kNever) return;
  const Duration lateness = random_.between(Duration{0}, std::chrono::microseconds{100});
  scheduler_.at(next - profile_.clock_offset + lateness, [this, number = ++wait_number_] {
    if (number == wait_number_) on_time();
  });
}

void SimClient::on_time() {
  while (true) {
    const wire::ChannelEvent event = channel_->on_time(local_now());
    if (event.kind == Kind::kNothing) break;
    handle(event);
  }
  wait();
}

SimClient::Jobs::iterator SimClient::job_of(wire::CallIndex index) {
  return std::ranges::find_if(
      jobs_, [&](const Job& job) { return !job.is_waiting && job.index == index; });
}

SimClient::Jobs::iterator SimClient::job_number(std::uint64_t number) {
  return std::ranges::find_if(jobs_, [&](const Job& job) { return job.number == number; });
}

void SimClient::handle(const wire::ChannelEvent& event) {
  send(event.frame);
  switch (event.kind) {
    case Kind::kNothing:
    case Kind::kSend:
      return;
    case Kind::kReady:
      is_opening_ = false;
      return pump();
    case Kind::kReply:
      return on_reply(event);
    case Kind::kItems: {
      const auto job = job_of(event.call);
      if (!random_.chance(profile_.slow_taker_per_mille)) return take_items(job);
      scheduler_.after(random_.between(Duration{0}, Duration{50'000'000}),
                       [this, number = job->number] {
                         if (const auto found = job_number(number); found != jobs_.end()) {
                           take_items(found);
                           wait();
                         }
                       });
      return;
    }
    case Kind::kLost:
      return on_lost();
    case Kind::kClosed:
      return on_closed();
    case Kind::kRefused:
      return on_no_session(event);
    case Kind::kTimeout:
      if (is_opening_) return on_no_session(event);
      return end(job_of(event.call), Outcome::kMayHaveRun, "timeout");
    case Kind::kBroken:
    case Kind::kNeedBuffer:
      history_.note(scheduler_.now(), "FAULT: what a datagram channel does not say");
      return;
  }
}

void SimClient::on_reply(const wire::ChannelEvent& event) {
  const auto job = job_of(event.call);
  if (job->is_stream) {
    job->is_over = true;
    job->end_status = event.status;
    return take_items(job);
  }
  if (job->delivery == wire::Delivery::kReceipt) {
    const bool is_received = event.status == wire::Status::kOk;
    return end(job,
               is_received         ? Outcome::kReceived
               : job->may_have_run ? Outcome::kMayHaveRun
                                   : Outcome::kNotRun,
               to_string(event.status));
  }
  if (event.status == wire::Status::kOk || event.status == wire::Status::kServantFailed) {
    const Message reply = Message::read(event.payload);
    if (event.payload.size() > wire::kDatagramPayloadSizeMax) ++large_reply_count_;
    history_.reply(scheduler_.now(), job->token, reply.token, reply.run_number);
    if (!reply.has_its_filling(event.payload)) {
      history_.broken(scheduler_.now(), job->token, "got a reply with bytes that are not its own");
    }
    return end(job, Outcome::kDone, to_string(event.status));
  }
  end(job, job->may_have_run ? Outcome::kMayHaveRun : Outcome::kNotRun, to_string(event.status));
}

// Checks that items come in order and without a gap, each with its own contents.
void SimClient::take_items(Jobs::iterator job) {
  while (const auto item = channel_->next_item(job->index)) {
    const Message message = Message::read(*item);
    ++item_count_;
    if (item->size() > wire::kDatagramPayloadSizeMax) ++large_item_count_;
    if (message.token != job->token || message.run_number != job->item_count ||
        !message.has_its_filling(*item)) {
      history_.broken(scheduler_.now(), job->token, "got an item that is not the next of its own");
    }
    ++job->item_count;
  }
  send(channel_->next_frame(local_now()));
  if (!job->is_over) return;
  switch (job->end_status) {
    case wire::Status::kOk:
    case wire::Status::kServantFailed:
      ++stream_count_;
      history_.end_stream(scheduler_.now(), job->token, job->item_count);
      return end(job, Outcome::kDone, to_string(job->end_status));
    case wire::Status::kLost:
    case wire::Status::kCancelled:
      return end(job, Outcome::kMayHaveRun, to_string(job->end_status));
    default:
      return end(job, Outcome::kNotRun, to_string(job->end_status));
  }
}

void SimClient::on_lost() {
  ++lost_count_;
  history_.note(scheduler_.now(),
                "client " + std::to_string(profile_.number) + " lost its session");
  for (auto job = jobs_.begin(); job != jobs_.end();) {
    const auto next = std::next(job);
    if (!job->is_waiting) {
      if (job->is_stream || ++job->round == kRoundCountMax) {
        end(job, Outcome::kMayHaveRun, "lost");
      } else {
        job->is_waiting = true;
        (job->is_idempotent ? job->may_have_run : job->is_resending) = true;
      }
    }
    job = next;
  }
  pump();
}

void SimClient::on_closed() {
  for (auto job = jobs_.begin(); job != jobs_.end();) {
    const auto next = std::next(job);
    if (!job->is_waiting) end(job, Outcome::kMayHaveRun, "the server stopped");
    job = next;
  }
  pump();
}

// The handshake failed: calls that can't wait longer give up.
void SimClient::on_no_session(const wire::ChannelEvent& event) {
  is_opening_ = false;
  for (auto job = jobs_.begin(); job != jobs_.end();) {
    const auto next = std::next(job);
    if (event.kind == Kind::kRefused || job->deadline <= local_now()) {
      end(job, job->may_have_run || job->is_resending ? Outcome::kMayHaveRun : Outcome::kNotRun,
          "no session");
    }
    job = next;
  }
  pump();
}

void SimClient::end(Jobs::iterator job, Outcome outcome, std::string_view why) {
  history_.end(scheduler_.now(), job->token, outcome, why);
  last_outcome_ = outcome;
  jobs_.erase(job);
  pause();
  if (std::ranges::any_of(jobs_, [](const Job& each) { return each.is_waiting; }) &&
      channel_->is_ready() && channel_->has_free_call()) {
    scheduler_.after(Duration{0}, [this] { pump(); });
  }
}

}  // namespace rtpm::sim
