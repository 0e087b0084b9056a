#include "rtpm/replay/pace.hpp"

#include <algorithm>

namespace rtpm::replay {
namespace {

/// Pause between the last message of a round and the first one of the next.
constexpr Duration kBetweenRounds = std::chrono::milliseconds{1};
/// A recording may contain any time; beyond this limit, sums of times could overflow.
constexpr double kLongestNs = 1e18;

Duration in_range(double ns) noexcept {
  return Duration{static_cast<Duration::rep>(std::clamp(ns, -kLongestNs, kLongestNs))};
}

}  // namespace

Pace::Pace(const Config& config) noexcept
    : config_(config), stepping_count_(config.stepped_count) {}

void Pace::play(MonotonicTime now, double speed) noexcept {
  course_.write({.begin = now, .from = played(now), .speed = speed, .is_playing = true});
}

void Pace::pause(MonotonicTime now) noexcept {
  course_.write({.begin = now, .from = played(now)});
}

void Pace::seek(Duration at) noexcept {
  course_.write({.from = at});
}

void Pace::step_to(Position position) noexcept {
  const Duration reached = played_at(position);
  Duration before = stepped_.load(std::memory_order_acquire);
  while (before < reached &&
         !stepped_.compare_exchange_weak(before, reached, std::memory_order_acq_rel)) {
  }
}

void Pace::end_steps(MonotonicTime now) noexcept {
  if (stepping_count_.fetch_sub(1, std::memory_order_acq_rel) != 1) return;
  step_to({config_.length, 0});
  over_since_.store(now, std::memory_order_release);
}

Duration Pace::played(MonotonicTime now) const noexcept {
  if (is_stepped()) return stepped_.load(std::memory_order_acquire);
  const Course course = this->course();
  if (!course.is_playing || now <= course.begin) return course.from;
  return course.from + in_range(static_cast<double>((now - course.begin).count()) * course.speed);
}

Duration Pace::played_at(Position position) const noexcept {
  const auto round = static_cast<Duration::rep>(position.round);
  return round * (config_.length + kBetweenRounds) + position.at;
}

Pace::Position Pace::position(MonotonicTime now) const noexcept {
  const Duration played = std::max(this->played(now), Duration{0});
  if (!config_.loops) return {std::min(played, config_.length), 0};
  const Duration round = config_.length + kBetweenRounds;
  return {std::min(played % round, config_.length), static_cast<std::uint64_t>(played / round)};
}

bool Pace::has_reached(Position position, MonotonicTime now) const noexcept {
  return played(now) >= played_at(position);
}

bool Pace::is_over(MonotonicTime now) const noexcept {
  if (config_.loops) return false;
  if (is_stepped()) return now >= over_since_.load(std::memory_order_acquire);
  return played(now) > config_.length;
}

MonotonicTime Pace::due(Position position) const noexcept {
  const Course course = this->course();
  if (!course.is_playing) return kNever;
  const auto ahead_ns = static_cast<double>((played_at(position) - course.from).count());
  return course.begin + in_range(ahead_ns / course.speed);
}

}  // namespace rtpm::replay
