#include <utility>

#include "consumer/consumer_impl.hpp"
#include "rtpm/rt/clock.hpp"

// Consumers that read the hub's ring or receive its multicast.
namespace rtpm::events {
namespace {

using namespace std::chrono_literals;

// The stream then only reports losses and its end, and must be kept alive.
constexpr Duration kStreamPollInterval = 50ms;

// Why the session ended; nullopt if it has not.
std::optional<std::string> in_words(SessionOutcome outcome) {
  switch (outcome) {
    case SessionOutcome::kFallenBehind:
      return std::string(kQueueWasFull);
    case SessionOutcome::kGone:
      return "The hub dropped the subscription, as it heard nothing of this consumer.";
    case SessionOutcome::kBroken:
      return "The hub sends what is no event: it is of another release.";
    case SessionOutcome::kDelivered:
    case SessionOutcome::kNothing:
      break;
  }
  return std::nullopt;
}

}  // namespace

// Polls the stream and applies changes.
std::optional<std::string> Consumer::Impl::attend(Session& session) {
  if (auto why = poll_stream(session, rt::now())) return why;
  if (has_new_policy_.exchange(false)) {
    const std::lock_guard lock(mutex_);
    broadcast_->set_policy(config_.delivery);
  }
  if (const Losses losses = broadcast_->losses(); losses != own_losses_) {
    own_losses_ = losses;
    update_losses();
  }
  return std::nullopt;
}

std::string Consumer::Impl::read_broadcast(Session& session) {
  const rt::WaitStrategy strategy = node_.config().wait.strategy;
  BroadcastSession& broadcast = *session.broadcast;
  CommonReader* const reader = session.reader.get();
  broadcast_ = &broadcast;
  broadcast_end_.reset();
  ReaderSeat::Member& me = *this;
  const auto seat = std::make_shared<ReaderSeat>(me, broadcast.wake_bits());
  {
    const std::lock_guard lock(mutex_);
    seat_ = seat;
  }
  bool is_joined = false;
  MonotonicTime next_poll{};
  std::optional<std::string> why;
  while (true) {
    seat->claim();
    seat->set_common(false);
    if (is_stopping_) break;
    if (const MonotonicTime now = rt::now(); now >= next_poll) {
      why = attend(session);
      next_poll = now + kStreamPollInterval;
    }
    if (!why) why = take_all(*seat, next_poll);
    if (why) break;
    if (reader != nullptr && seat->is_slow(rt::now()) == is_joined) {
      if (is_joined) {
        reader->leave(seat);
      } else {
        reader->join(seat);
      }
      is_joined = !is_joined;
      // The reader may have missed events that arrived just before.
      static_cast<void>(seat->release());
      continue;
    }
    // A repair would delay the other consumers.
    const bool is_common = is_joined && reader->serves() && !broadcast.is_lacking();
    seat->set_common(is_common);
    if (seat->release()) continue;
    if (is_common) {
      seat->rest(next_poll);
      continue;
    }
    broadcast.wait(strategy, next_poll);
    // Woken without an arrival: poll the stream.
    if (!broadcast.has_more()) next_poll = MonotonicTime{};
  }
  // The seat stays claimed, so the reader skips it from now on.
  if (is_joined) reader->leave(seat);
  const std::lock_guard lock(mutex_);
  seat_.reset();
  broadcast_ = nullptr;
  return std::move(why).value_or("");
}

// Delivers received events until the next poll of the stream.
std::optional<std::string> Consumer::Impl::take_all(ReaderSeat& seat, MonotonicTime until) {
  if (broadcast_end_) return in_words(*broadcast_end_);
  MonotonicTime now = rt::now();
  while (now < until && !is_stopping_) {
    // The time until the hub answers does not count as the handler's.
    const bool may_ask = broadcast_->is_lacking();
    const SessionOutcome outcome = broadcast_->take(taker_, BroadcastSession::Asking::kNow);
    if (outcome != SessionOutcome::kDelivered) return in_words(outcome);
    const MonotonicTime begin = std::exchange(now, rt::now());
    last_heard_ = now;
    if (!may_ask) seat.note_duration(now - begin, now);
  }
  return std::nullopt;
}

ReaderSeat::Member::Taking Consumer::Impl::take_one() noexcept {
  common_thread_ = std::this_thread::get_id();
  const SessionOutcome outcome = broadcast_->take(taker_, BroadcastSession::Asking::kLater);
  common_thread_ = std::thread::id{};
  if (outcome == SessionOutcome::kNothing) {
    return broadcast_->is_lacking() ? Taking::kApart : Taking::kNothing;
  }
  if (outcome == SessionOutcome::kDelivered) {
    last_heard_ = rt::now();
    return Taking::kDelivered;
  }
  broadcast_end_ = outcome;
  return Taking::kApart;
}

void Consumer::Impl::wake_own_thread() {
  std::shared_ptr<ReaderSeat> seat;
  {
    const std::lock_guard lock(mutex_);
    seat = seat_.lock();
  }
  if (seat) seat->call();
}

}  // namespace rtpm::events
