#include "view.hpp"

#include <algorithm>

#include "rtpm/driver/vector.hpp"
#include "rtpm/program/text.hpp"

namespace rtpm::scene {
namespace {

using program::formatted;

constexpr Duration kSilence = std::chrono::milliseconds{500};
/// How far from the surface a proxy in contact may be.
constexpr double kSurfaceMetre = 1e-5;

double to_s(Duration duration) {
  return std::chrono::duration<double>(duration).count();
}

template <class Value>
void keep(std::deque<Value>& values, const Value& value) {
  values.push_back(value);
  if (values.size() > View::kHistoryMax) values.pop_front();
}

template <class Value>
std::vector<Value> newest(const std::deque<Value>& values, std::size_t count_max) {
  const auto count = static_cast<std::ptrdiff_t>(std::min(values.size(), count_max));
  return {values.end() - count, values.end()};
}

std::string state_text(const Sight& sight, MonotonicTime now) {
  if (sight.samples.is_silent(now)) return "device is silent";
  if (sight.touches.is_silent(now)) return "force is silent";
  return sight.touch->touch.depth_m > 0 ? "touching" : "free";
}

}  // namespace

double Pace::rate_hz() const noexcept {
  const double span_s = to_s(last_ - first_);
  return span_s > 0 ? static_cast<double>(count_ - 1) / span_s : 0;
}

bool Pace::is_silent(MonotonicTime now) const noexcept {
  return count_ == 0 || now - last_ > kSilence;
}

void View::see(const driver::Sample& sample, MonotonicTime now) {
  const std::lock_guard lock(mutex_);
  sight_.samples.record(now);
  sight_.sample = sample;
  if (is_position(sample.pose.position_m)) keep(device_m_, sample.pose.position_m);
}

void View::see(const TouchReport& report, MonotonicTime now) {
  const std::lock_guard lock(mutex_);
  sight_.touches.record(now);
  sight_.touch = report;
  sight_.force_newton_max = std::max(sight_.force_newton_max, length(report.touch.force_newton));
  sight_.depth_m_max = std::max(sight_.depth_m_max, report.touch.depth_m);
  if (report.touch.depth_m > 0) {
    const double clearance_m = report.scene.clearance_m(report.touch.proxy_m);
    ++sight_.contact_count;
    if (clearance_m >= 0 && clearance_m <= kSurfaceMetre) ++sight_.on_surface_count;
  }
  keep(touches_, report);
}

Sight View::sight() const {
  const std::lock_guard lock(mutex_);
  return sight_;
}

History View::history(std::size_t count_max) const {
  const std::lock_guard lock(mutex_);
  return {newest(device_m_, count_max), newest(touches_, count_max)};
}

std::string status_text(const Sight& sight, MonotonicTime now, Duration since_start) {
  const driver::Vector3 at = sight.sample ? sight.sample->pose.position_m : driver::Vector3{};
  const Touch touch = sight.touch ? sight.touch->touch : Touch{};
  return formatted("%5.1f s  at %+6.1f %+6.1f %+6.1f mm  depth %4.1f mm  force %5.2f N  %s",
                   to_s(since_start), at.x * 1e3, at.y * 1e3, at.z * 1e3, touch.depth_m * 1e3,
                   length(touch.force_newton), state_text(sight, now).c_str());
}

std::string caption_text(const Sight& sight, const std::string& device) {
  if (!sight.touch) return device + ": the force node is silent";
  return device + " at the " + std::string(to_string(sight.touch->scene.shape)) +
         formatted(": greatest depth %.1f mm, greatest force %.2f N", sight.depth_m_max * 1e3,
                   sight.force_newton_max);
}

std::string summary_text(const Sight& sight, std::uint64_t frame_count, Duration since_start) {
  return formatted(
      "%llu frames in %.1f s of %.1f samples/s and %.1f touches/s; proxy on the surface in "
      "%llu of %llu contacts, greatest depth %.1f mm, greatest force %.2f N",
      static_cast<unsigned long long>(frame_count), to_s(since_start), sight.samples.rate_hz(),
      sight.touches.rate_hz(), static_cast<unsigned long long>(sight.on_surface_count),
      static_cast<unsigned long long>(sight.contact_count), sight.depth_m_max * 1e3,
      sight.force_newton_max);
}

}  // namespace rtpm::scene
