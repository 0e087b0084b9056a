#include "rtpm/wire/clock_sync.hpp"

#include <algorithm>
#include <cmath>

namespace rtpm::wire {
namespace {

// The clocks of two ordinary hosts drift apart by less than this ratio.
constexpr double kDriftMax = 200e-6;
// A server states its share of the trip in whole microseconds.
constexpr Duration kQuantum = std::chrono::microseconds{1};
// One point per second.
constexpr Duration kPointSpan = std::chrono::seconds{1};
// A slope over a shorter span would measure the probes' errors rather than the clocks.
constexpr Duration kSlopeSpanMin = std::chrono::seconds{4};

}  // namespace

void ClockEstimator::add(const ClockProbe& probe) noexcept {
  const Duration trip =
      (probe.reply_received - probe.request_sent) - (probe.reply_sent - probe.request_received);
  // Ignores a peer whose stated times do not fit the round trip.
  if (trip < -kQuantum || probe.reply_sent < probe.request_received) return;
  Point point;
  point.time = probe.request_sent + (probe.reply_received - probe.request_sent) / 2;
  point.offset =
      ((probe.request_received - probe.request_sent) + (probe.reply_sent - probe.reply_received)) /
      2;
  point.half_trip = std::max(trip, Duration{0}) / 2 + kQuantum;
  if (count_ > 0) {
    const Point& last = points_[newest_];
    // More than drift can explain: the peer's host was restarted.
    const Duration allowed =
        last.half_trip + point.half_trip +
        Duration{static_cast<Duration::rep>(kDriftMax *
                                            static_cast<double>((point.time - last.time).count()))};
    if (std::chrono::abs(point.offset - last.offset) > allowed) clear();
  }
  if (count_ > 0 && point.time - points_[newest_].time < kPointSpan) {
    if (point.half_trip <= points_[newest_].half_trip) points_[newest_] = point;
    return;
  }
  newest_ = count_ == 0 ? 0 : (newest_ + 1) % kPointCountMax;
  points_[newest_] = point;
  count_ = std::min(count_ + 1, kPointCountMax);
}

// Least squares through the points, relative to the newest one to keep numbers small.
std::optional<double> ClockEstimator::slope() const noexcept {
  const Point& last = points_[newest_];
  double sum_x = 0;
  double sum_y = 0;
  double sum_xx = 0;
  double sum_xy = 0;
  Duration span{0};
  for (std::size_t i = 0; i < count_; ++i) {
    const Duration before = last.time - points_[i].time;
    const auto x = -static_cast<double>(before.count());
    const auto y = static_cast<double>((points_[i].offset - last.offset).count());
    span = std::max(span, before);
    sum_x += x;
    sum_y += y;
    sum_xx += x * x;
    sum_xy += x * y;
  }
  if (span < kSlopeSpanMin) return std::nullopt;
  const auto n = static_cast<double>(count_);
  const double divisor = n * sum_xx - sum_x * sum_x;
  if (divisor <= 0) return std::nullopt;
  return std::clamp((n * sum_xy - sum_x * sum_y) / divisor, -kDriftMax, kDriftMax);
}

std::optional<PeerClock> ClockEstimator::estimate(MonotonicTime now) const noexcept {
  if (count_ == 0) return std::nullopt;
  const std::optional<double> drift = slope();
  PeerClock best;
  best.uncertainty = Duration::max();
  for (std::size_t i = 0; i < count_; ++i) {
    const Point& point = points_[i];
    const auto age = static_cast<double>((now - point.time).count());
    // While the drift is unknown, its bound adds to the uncertainty.
    const Duration drifted{static_cast<Duration::rep>(std::abs(age) * kDriftMax)};
    const Duration uncertainty = point.half_trip + drifted;
    if (uncertainty >= best.uncertainty) continue;
    best.offset = point.offset + Duration{static_cast<Duration::rep>(age * drift.value_or(0))};
    best.uncertainty = uncertainty;
  }
  best.drift_ppm = drift.value_or(0) * 1e6;
  return best;
}

}  // namespace rtpm::wire
