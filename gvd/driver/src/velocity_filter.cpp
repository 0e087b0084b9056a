#include "rtpm/driver/velocity_filter.hpp"

#include <algorithm>
#include <cmath>

namespace rtpm::driver {
namespace {

/// Positions exactly one step off the line still count as on it.
constexpr double kRounding = 1 + 1e-6;

double seconds(Duration duration) noexcept {
  return std::chrono::duration<double>(duration).count();
}

}  // namespace

double VelocityFilter::add(MonotonicTime time, double position) noexcept {
  if (!std::isfinite(position) || (count_ > 0 && time <= at(0).time)) return velocity_;
  newest_ = (newest_ + 1) % kWindow;
  window_[newest_] = {time, position};
  count_ = std::min(count_ + 1, kWindow);
  for (std::size_t age = 1; age < count_; ++age) {
    const double slope = slope_to(age);
    if (!std::isfinite(slope) || (age > 1 && !is_line(age, slope))) break;
    velocity_ = slope;
  }
  return velocity_;
}

void VelocityFilter::reset() noexcept {
  count_ = 0;
  velocity_ = 0;
}

double VelocityFilter::slope_to(std::size_t age) const noexcept {
  return (at(0).position - at(age).position) / seconds(at(0).time - at(age).time);
}

bool VelocityFilter::is_line(std::size_t age, double slope) const noexcept {
  for (std::size_t i = 1; i < age; ++i) {
    const double expected = at(0).position - slope * seconds(at(0).time - at(i).time);
    if (std::abs(at(i).position - expected) > resolution_ * kRounding) return false;
  }
  return true;
}

}  // namespace rtpm::driver
