#include "rtpm/replay/playback.hpp"

#include <algorithm>
#include <mutex>
#include <utility>

#include "rtpm/rt/clock.hpp"

namespace rtpm::replay {
namespace {

/// The interval at which due messages are played, and steps are checked.
constexpr Duration kTick = std::chrono::milliseconds{1};

}  // namespace

bool Turn::is_present() const noexcept {
  return playback_.turn_.load(std::memory_order_acquire) == number_;
}

bool Turn::reach(Duration at) const {
  const Pace& pace = playback_.pace_;
  {
    const std::lock_guard lock(playback_.mutex_);
    if (!is_present()) return false;
    playback_.next_ = at;
  }
  while (is_present()) {
    const MonotonicTime now = rt::now();
    if (pace.has_reached({at, round_}, now)) return true;
    static_cast<void>(playback_.wake_.wait_until(std::max(now + kTick, due(at))));
  }
  return false;
}

MonotonicTime Turn::due(Duration at) const {
  const Pace& pace = playback_.pace_;
  return pace.is_stepped() ? rt::now() : pace.due({at, round_});
}

bool Turn::wait(Duration span) const {
  const MonotonicTime end = rt::now() + span;
  while (is_present() && rt::now() < end)
    static_cast<void>(playback_.wake_.wait_until(end));
  return is_present();
}

expected<void, SetupError> Playback::start() {
  auto thread = rt::Thread::start({.name = "rtpm-play", .realtime = rt::RealtimeMode::kOff},
                                  [this] { run(); });
  if (!thread) return unexpected{std::move(thread.error())};
  thread_ = std::move(*thread);
  return {};
}

void Playback::stop() noexcept {
  is_stopping_ = true;
  begin_turn();
  if (thread_.is_running()) thread_.join();
}

void Playback::begin_turn() {
  turn_.fetch_add(1, std::memory_order_acq_rel);
  wake_.post();
}

void Playback::play(double speed) {
  const std::lock_guard lock(mutex_);
  const bool is_at_end = place(rt::now()).at >= pace_.config().length;
  if (is_at_end && !pace_.config().loops) go_to(Duration{0});
  speed_ = speed;
  is_playing_ = true;
  begin_turn();
}

void Playback::pause() {
  const std::lock_guard lock(mutex_);
  pace_.pause(rt::now());
  is_playing_ = false;
  begin_turn();
}

void Playback::seek(Duration at) {
  const std::lock_guard lock(mutex_);
  sought_ = std::clamp(at, Duration{0}, pace_.config().length);
  go_to(*sought_);
  begin_turn();
}

Pace::Position Playback::place(MonotonicTime now) const noexcept {
  const Pace::Position position = pace_.position(now);
  return pace_.config().loops ? position : Pace::Position{std::min(position.at, next_), 0};
}

void Playback::go_to(Duration at) {
  pace_.seek(at);
  next_ = at;
}

Playback::Status Playback::status() const {
  const std::lock_guard lock(mutex_);
  return {pace_.position(rt::now()), speed_, is_playing_, problem_};
}

void Playback::run() {
  std::unique_lock lock(mutex_);
  while (!is_stopping_) {
    Turn turn(*this, turn_.load(std::memory_order_acquire), 0);
    const std::optional<Duration> sought = std::exchange(sought_, std::nullopt);
    const bool is_playing = is_playing_;
    // Steps may already be ahead of this thread; plays all of them.
    Pace::Position from{};
    if (is_playing && !sought) {
      const MonotonicTime now = rt::now();
      if (!pace_.is_stepped()) {
        from = place(now);
        if (!pace_.config().loops) go_to(from.at);
      }
      pace_.play(now, speed_);
      turn.round_ = from.round;
    }
    lock.unlock();
    if (sought) {
      const auto shown = script_.show(*sought, turn);
      if (!shown) end(turn, shown);
    } else if (is_playing) {
      play_on(turn, from.at);
    } else {
      static_cast<void>(wake_.wait_until(kNever));
    }
    lock.lock();
  }
}

void Playback::play_on(const Turn& turn, Duration from) {
  Turn round = turn;
  while (true) {
    const auto played = script_.play(from, round);
    if (!played || !pace_.config().loops) return end(turn, played);
    // Skips rounds that are already over.
    round.round_ = std::max(round.round_ + 1, pace_.position(rt::now()).round);
    from = Duration{0};
    if (!round.reach(from)) return;
  }
}

void Playback::end(const Turn& turn, const expected<void, SetupError>& outcome) {
  const std::lock_guard lock(mutex_);
  if (!turn.is_present()) return;
  is_playing_ = false;
  if (outcome) {
    next_ = pace_.config().length;
    return;
  }
  problem_ = outcome.error().reason();
  pace_.pause(rt::now());
}

}  // namespace rtpm::replay
