#include "events/stream_meter.hpp"

#include <algorithm>
#include <cmath>

namespace rtpm::tool {

void StreamMeter::add(std::uint64_t sequence, MonotonicTime origin, Duration latency) {
  if (count_ == 0) {
    begin(sequence, origin);
  } else if (sequence > newest_) {
    go_on(sequence, origin);
  } else if (sequence < newest_ && origin > newest_origin_) {
    // Newer event, lower sequence: the source restarted.
    ++restart_count_;
    begin(sequence, origin);
  } else if (missing_.erase(sequence) > 0) {
    ++late_count_;
  } else {
    ++duplicate_count_;
    return;
  }
  ++count_;
  latency_.record(latency);
}

void StreamMeter::begin(std::uint64_t sequence, MonotonicTime origin) noexcept {
  given_up_ += missing_.size();
  missing_.clear();
  newest_ = sequence;
  newest_origin_ = origin;
}

void StreamMeter::go_on(std::uint64_t sequence, MonotonicTime origin) {
  const std::uint64_t step = sequence - newest_;
  const std::uint64_t room = kMissingMax - std::min(kMissingMax, missing_.size());
  const std::uint64_t kept = std::min(step - 1, room);
  for (std::uint64_t i = 1; i <= kept; ++i)
    missing_.insert(missing_.end(), newest_ + i);
  given_up_ += step - 1 - kept;
  const Duration time = origin - newest_origin_;
  if (time < Duration{0}) {
    ++clock_jump_count_;
  } else {
    step_count_ += step;
    step_time_ += time;
    if (step == 1) add_interval(time);
  }
  newest_ = sequence;
  newest_origin_ = origin;
}

void StreamMeter::add_interval(Duration interval) noexcept {
  ++interval_count_;
  interval_min_ = std::min(interval_min_, interval);
  interval_max_ = std::max(interval_max_, interval);
  const auto ns = static_cast<long double>(interval.count());
  interval_sum_ns_ += ns;
  interval_square_sum_ns_ += ns * ns;
}

double StreamMeter::rate_hz() const noexcept {
  if (step_time_ == Duration{0}) return 0;
  return static_cast<double>(step_count_) / std::chrono::duration<double>(step_time_).count();
}

std::optional<StreamMeter::Jitter> StreamMeter::jitter() const noexcept {
  if (interval_count_ == 0) return std::nullopt;
  const auto count = static_cast<long double>(interval_count_);
  const long double mean_ns = interval_sum_ns_ / count;
  const long double variance = std::max(0.0L, interval_square_sum_ns_ / count - mean_ns * mean_ns);
  const Duration mean{std::llround(mean_ns)};
  return Jitter{.mean = mean,
                .rms_ns = static_cast<double>(std::sqrt(variance)),
                .max = std::max(interval_max_ - mean, mean - interval_min_)};
}

}  // namespace rtpm::tool
