#include "rtpm/wire/retransmit.hpp"

#include <algorithm>

namespace rtpm::wire {

Duration RetransmitTimer::interval() const noexcept {
  if (smoothed_ == Duration{0}) return kRetransmitIntervalFirst;
  return std::clamp<Duration>(smoothed_ + 4 * deviation_, kRetransmitIntervalMin,
                              kRetransmitIntervalMax);
}

void RetransmitTimer::begin(MonotonicTime now) noexcept {
  sent_ = now;
  repeat_count_ = 0;
  is_measured_ = true;
  current_ = std::max(interval(), backed_off_);
  due_ = now + current_;
}

void RetransmitTimer::repeat(MonotonicTime now) noexcept {
  ++repeat_count_;
  // hp-5.3-3: the server may forget a session that is silent for long.
  current_ = std::min<Duration>(2 * current_, kRetransmitIntervalMax);
  due_ = now + current_;
}

void RetransmitTimer::progress(MonotonicTime now) noexcept {
  is_measured_ = false;
  current_ = interval();
  due_ = now + current_;
}

void RetransmitTimer::end(MonotonicTime now) noexcept {
  due_ = kNever;
  // Without this a round trip that grew beyond the wait would never be measured again: each call
  // would be repeated, so none would count.
  backed_off_ = repeat_count_ > 0 ? current_ : Duration{0};
  if (repeat_count_ > 0 || !is_measured_) return;
  const Duration sample = std::max(now - sent_, Duration{1});
  if (smoothed_ == Duration{0}) {
    smoothed_ = sample;
    deviation_ = sample / 2;
    return;
  }
  const Duration error = sample > smoothed_ ? sample - smoothed_ : smoothed_ - sample;
  deviation_ += (error - deviation_) / 4;
  smoothed_ = std::max(smoothed_ + (sample - smoothed_) / 8, Duration{1});
}

}  // namespace rtpm::wire
