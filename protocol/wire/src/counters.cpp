#include "rtpm/wire/counters.hpp"

namespace rtpm::wire {

std::string_view to_string(DropReason reason) noexcept {
  static constexpr std::array<std::string_view, kDropReasonCount> kNames{
      "too_short",       "bad_magic",       "bad_version",  "bad_kind",          "reserved_set",
      "bad_priority",    "bad_length",      "bad_fragment", "bad_payload",       "bad_cookie",
      "unknown_session", "foreign_address", "stale_call",   "duplicate_running", "unexpected",
      "rate_limited",    "unsealed",        "bad_seal",     "replayed"};
  const auto index = static_cast<std::size_t>(reason);
  return index < kNames.size() ? kNames[index] : "unknown";
}

void FrameCounters::add(const FrameCounters& other) noexcept {
  received_count += other.received_count;
  duplicate_answered_count += other.duplicate_answered_count;
  expired_count += other.expired_count;
  refused_count += other.refused_count;
  session_opened_count += other.session_opened_count;
  session_evicted_count += other.session_evicted_count;
  cancelled_count += other.cancelled_count;
  orphaned_count += other.orphaned_count;
  large_evicted_count += other.large_evicted_count;
  item_count += other.item_count;
  item_repeated_count += other.item_repeated_count;
  for (std::size_t i = 0; i < dropped.size(); ++i)
    dropped[i] += other.dropped[i];
}

}  // namespace rtpm::wire
