#include "rtpm/wire/retransmit.hpp"

#include <algorithm>

namespace rtpm::wire {

Duration RoundTrip::interval() const noexcept {
  if (smoothed_ == Duration{0}) return std::max<Duration>(kRetransmitIntervalFirst, interval_min_);
  return std::clamp<Duration>(smoothed_ + 4 * deviation_, interval_min_, kRetransmitIntervalMax);
}

void RoundTrip::back_off(Duration wait) noexcept {
  backed_off_ = was_repeated_ ? wait : Duration{0};
  was_repeated_ = wait > Duration{0};
}

Duration RoundTrip::first_interval() const noexcept {
  return std::max(interval(), backed_off_);
}

void RoundTrip::add(Duration sample) noexcept {
  sample = std::max(sample, Duration{1});
  if (smoothed_ == Duration{0}) {
    smoothed_ = sample;
    deviation_ = sample / 2;
    return;
  }
  const Duration error = sample > smoothed_ ? sample - smoothed_ : smoothed_ - sample;
  deviation_ += (error - deviation_) / 4;
  smoothed_ = std::max(smoothed_ + (sample - smoothed_) / 8, Duration{1});
}

void RetransmitTimer::begin(MonotonicTime now) noexcept {
  sent_ = now;
  repeat_count_ = 0;
  is_measured_ = true;
  current_ = path_->first_interval();
  due_ = now + current_;
}

void RetransmitTimer::repeat(MonotonicTime now) noexcept {
  ++repeat_count_;
  // hp-5.3-3: the server may evict a session that is silent for long.
  current_ = std::min<Duration>(2 * current_, kRetransmitIntervalMax);
  due_ = now + current_;
}

void RetransmitTimer::progress(MonotonicTime now) noexcept {
  wait(now, path_->interval());
}

void RetransmitTimer::wait(MonotonicTime now, Duration wait) noexcept {
  is_measured_ = false;
  current_ = wait;
  due_ = now + wait;
}

void RetransmitTimer::end(MonotonicTime now) noexcept {
  due_ = kNever;
  const Duration took = std::max(now - sent_, Duration{1});
  // A quarter more than the upper bound, so that an equal round trip will be measured next time.
  path_->back_off(repeat_count_ > 0 ? std::min<Duration>(current_, took + took / 4) : Duration{0});
  if (repeat_count_ == 0 && is_measured_) path_->add(took);
}

}  // namespace rtpm::wire
