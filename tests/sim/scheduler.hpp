#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <random>
#include <utility>

#include "rtpm/base/time.hpp"

namespace rtpm::sim {

/// The only source of chance in a simulation: one seed, one history.
class Random {
 public:
  explicit Random(std::uint64_t seed) : engine_(seed) {}
  /// A number from `low` to `high`, both included.
  [[nodiscard]] std::uint64_t between(std::uint64_t low, std::uint64_t high) {
    // The numbers of std::uniform_int_distribution would differ from library to library.
    return low + engine_() % (high - low + 1);
  }
  [[nodiscard]] Duration between(Duration low, Duration high) {
    return low + Duration{static_cast<std::int64_t>(
                     between(std::uint64_t{0}, static_cast<std::uint64_t>((high - low).count())))};
  }
  [[nodiscard]] bool chance(std::uint64_t per_mille) {
    return between(std::uint64_t{1}, std::uint64_t{1000}) <= per_mille;
  }

 private:
  std::mt19937_64 engine_;
};

/// Simulated time: runs the scheduled actions, in the order of their times.
class Scheduler {
 public:
  [[nodiscard]] MonotonicTime now() const noexcept { return now_; }
  void at(MonotonicTime when, std::function<void()> action) {
    actions_.emplace(std::pair{std::max(when, now_), ++serial_}, std::move(action));
  }
  void after(Duration delay, std::function<void()> action) { at(now_ + delay, std::move(action)); }
  /// Runs the next action; false if there is none before `until`, which is then the time.
  [[nodiscard]] bool step(MonotonicTime until) {
    if (actions_.empty() || actions_.begin()->first.first > until) {
      now_ = std::max(now_, until);
      return false;
    }
    now_ = actions_.begin()->first.first;
    auto action = std::move(actions_.begin()->second);
    actions_.erase(actions_.begin());
    action();
    return true;
  }

 private:
  MonotonicTime now_ = time_from_ns(1'000'000'000'000);
  std::uint64_t serial_ = 0;
  std::map<std::pair<MonotonicTime, std::uint64_t>, std::function<void()>> actions_;
};

}  // namespace rtpm::sim
