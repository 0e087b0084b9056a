#include "departures.hpp"

#include <algorithm>
#include <utility>

namespace rtpm::events {

std::string_view to_string(DepartureReason reason) noexcept {
  switch (reason) {
    case DepartureReason::kUnsubscribed:
      return "it unsubscribed";
    case DepartureReason::kLeft:
      return "it is gone";
    case DepartureReason::kSilent:
      return "it missed too many signs of life";
    case DepartureReason::kQueueFull:
      break;
  }
  return "its queue was full";
}

void Departures::note(std::string& name, DepartureReason reason, MonotonicTime now) noexcept {
  const std::lock_guard lock(mutex_);
  Departure& place = last_[count_ % last_.size()];
  place.number = ++count_;
  std::swap(place.name, name);
  place.reason = reason;
  place.time = now;
  switch (reason) {
    case DepartureReason::kUnsubscribed:
      ++counters_.unsubscribed_count;
      return;
    case DepartureReason::kLeft:
      ++counters_.left_count;
      return;
    case DepartureReason::kSilent:
      ++counters_.silent_count;
      return;
    case DepartureReason::kQueueFull:
      ++counters_.queue_full_count;
      return;
  }
}

std::vector<Departure> Departures::after(std::uint64_t number) const {
  std::vector<Departure> some;
  const std::lock_guard lock(mutex_);
  const std::uint64_t kept = std::min<std::uint64_t>(count_, last_.size());
  for (std::uint64_t i = std::max(number, count_ - kept); i < count_; ++i)
    some.push_back(last_[i % last_.size()]);
  return some;
}

DepartureCounters Departures::counters() const noexcept {
  const std::lock_guard lock(mutex_);
  return counters_;
}

}  // namespace rtpm::events
