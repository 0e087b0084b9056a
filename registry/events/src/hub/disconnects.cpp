#include "hub/disconnects.hpp"

#include <algorithm>
#include <utility>

namespace rtpm::events {

std::string_view to_string(DisconnectReason reason) noexcept {
  switch (reason) {
    case DisconnectReason::kUnsubscribed:
      return "it unsubscribed";
    case DisconnectReason::kLeft:
      return "it is gone";
    case DisconnectReason::kSilent:
      return "it missed too many signs of life";
    case DisconnectReason::kQueueFull:
      break;
  }
  return "its queue was full";
}

void Disconnects::note(std::string& name, DisconnectReason reason, MonotonicTime now) noexcept {
  const std::lock_guard lock(mutex_);
  Disconnect& slot = last_[count_ % last_.size()];
  slot.number = ++count_;
  std::swap(slot.name, name);
  slot.reason = reason;
  slot.time = now;
  switch (reason) {
    case DisconnectReason::kUnsubscribed:
      ++counters_.unsubscribed_count;
      return;
    case DisconnectReason::kLeft:
      ++counters_.left_count;
      return;
    case DisconnectReason::kSilent:
      ++counters_.silent_count;
      return;
    case DisconnectReason::kQueueFull:
      ++counters_.queue_full_count;
      return;
  }
}

std::vector<Disconnect> Disconnects::after(std::uint64_t number) const {
  std::vector<Disconnect> some;
  const std::lock_guard lock(mutex_);
  const std::uint64_t kept = std::min<std::uint64_t>(count_, last_.size());
  for (std::uint64_t i = std::max(number, count_ - kept); i < count_; ++i)
    some.push_back(last_[i % last_.size()]);
  return some;
}

DisconnectCounters Disconnects::counters() const noexcept {
  const std::lock_guard lock(mutex_);
  return counters_;
}

}  // namespace rtpm::events
