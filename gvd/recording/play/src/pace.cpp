#include "rtpm/replay/pace.hpp"

#include <algorithm>

namespace rtpm::replay {
namespace {

/// Pause between the last message of a round and the first one of the next.
constexpr Duration kBetweenRounds = std::chrono::milliseconds{1};

}  // namespace

Pace::Position Pace::position(MonotonicTime now) const noexcept {
  const MonotonicTime begin = begin_.load(std::memory_order_acquire);
  if (now <= begin) return {};
  const double passed_ns = static_cast<double>((now - begin).count()) * speed_;
  const Duration passed{static_cast<Duration::rep>(std::min(passed_ns, 9e18))};
  if (!loops_) return {std::min(passed, length_), 0, passed > length_};
  const Duration round = length_ + kBetweenRounds;
  return {std::min(passed % round, length_), static_cast<std::uint64_t>(passed / round), false};
}

}  // namespace rtpm::replay
