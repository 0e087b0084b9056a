#include <utility>

#include "consumer_impl.hpp"
#include "rtpm/rt/clock.hpp"

// A consumer whose events do not come by its stream, but in the hub's ring or by multicast.
namespace rtpm::events {
namespace {

using namespace std::chrono_literals;

// Such a consumer looks at its stream only so often: it tells of little, and lives on.
constexpr Duration kStreamLookInterval = 50ms;

// Why it is over; none if it is not.
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

// The stream tells of losses in the hub, and of the end.
std::optional<std::string> Consumer::Impl::attend(Session& session, auto& source) {
  if (auto why = look_at_stream(session, rt::now())) return why;
  if (has_new_policy_.exchange(false)) {
    const std::lock_guard lock(mutex_);
    source.set_policy(config_.delivery);
  }
  if (source.losses() != own_losses_) {
    own_losses_ = source.losses();
    update_losses();
  }
  return std::nullopt;
}

std::string Consumer::Impl::read_multicast(Session& session) {
  MulticastSession& source = *session.multicast;
  const auto hand = [this](std::span<const EventView> group) { hand_over(group); };
  MonotonicTime next_look{};
  while (!is_stopping_) {
    const MonotonicTime now = rt::now();
    if (now >= next_look) {
      if (auto why = attend(session, source)) return std::move(*why);
      next_look = now + kStreamLookInterval;
    }
    const SessionOutcome outcome = source.take(hand);
    if (auto why = in_words(outcome)) return std::move(*why);
    if (outcome == SessionOutcome::kDelivered) {
      last_heard_ = now;
      continue;
    }
    source.wait(node_.config().wait.strategy, next_look);
    // Woken for nothing: there may be something in the stream.
    if (!source.has_more()) next_look = MonotonicTime{};
  }
  return {};
}

std::string Consumer::Impl::read_ring(Session& session) {
  const rt::WaitStrategy strategy = node_.config().wait.strategy;
  RingSession& ring = *session.ring;
  ring_ = &ring;
  ring_end_.reset();
  ReaderSeat::Member& me = *this;
  const auto seat = std::make_shared<ReaderSeat>(me, ring.wake_bits());
  std::shared_ptr<CommonReader> reader;
  {
    const std::lock_guard lock(mutex_);
    seat_ = seat;
    if (!config_.has_own_thread && strategy != rt::WaitStrategy::kSpin) {
      reader = CommonReader::of(
          {&node_, ring.id(), config_.priority, config_.cpus, config_.realtime}, ring.view());
    }
  }
  bool is_joined = false;
  MonotonicTime next_look{};
  std::optional<std::string> why;
  while (true) {
    seat->claim();
    seat->set_common(false);
    if (is_stopping_) break;
    if (const MonotonicTime now = rt::now(); now >= next_look) {
      why = attend(session, ring);
      next_look = now + kStreamLookInterval;
    }
    if (!why) why = take_all(*seat, next_look);
    if (why) break;
    if (reader && seat->is_slow(rt::now()) == is_joined) {
      if (is_joined) {
        reader->leave(seat);
      } else {
        reader->join(seat);
      }
      is_joined = !is_joined;
    }
    const bool is_common = is_joined && reader->serves();
    seat->set_common(is_common);
    if (seat->release()) continue;
    if (is_common) {
      seat->rest(next_look);
      continue;
    }
    ring.wait(strategy, next_look);
    // Woken for nothing in the ring: there may be something in the stream.
    if (!ring.has_more()) next_look = MonotonicTime{};
  }
  // With the seat claimed for ever: the reader does not touch it any more.
  if (is_joined) reader->leave(seat);
  const std::lock_guard lock(mutex_);
  seat_.reset();
  ring_ = nullptr;
  return std::move(why).value_or("");
}

// All that there is, as far as there is time until the next look at the stream.
std::optional<std::string> Consumer::Impl::take_all(ReaderSeat& seat, MonotonicTime until) {
  const auto hand = [this](std::span<const EventView> group) { hand_over(group); };
  if (ring_end_) return in_words(*ring_end_);
  MonotonicTime now = rt::now();
  while (now < until && !is_stopping_) {
    const SessionOutcome outcome = ring_->take(hand);
    if (outcome != SessionOutcome::kDelivered) return in_words(outcome);
    const MonotonicTime begin = std::exchange(now, rt::now());
    last_heard_ = now;
    seat.note_duration(now - begin, now);
  }
  return std::nullopt;
}

ReaderSeat::Member::Taking Consumer::Impl::take_one() noexcept {
  common_thread_ = std::this_thread::get_id();
  const SessionOutcome outcome =
      ring_->take([this](std::span<const EventView> group) { hand_over(group); });
  common_thread_ = std::thread::id{};
  if (outcome == SessionOutcome::kNothing) return Taking::kNothing;
  if (outcome == SessionOutcome::kDelivered) {
    last_heard_ = rt::now();
    return Taking::kDelivered;
  }
  ring_end_ = outcome;
  return Taking::kEnded;
}

void Consumer::Impl::call_own_thread() {
  std::shared_ptr<ReaderSeat> seat;
  {
    const std::lock_guard lock(mutex_);
    seat = seat_.lock();
  }
  if (seat) seat->call();
}

}  // namespace rtpm::events
