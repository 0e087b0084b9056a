#include "rtpm/gvd/safety.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>

#include "finite.hpp"

namespace rtpm::gvd {
namespace {

using driver::Fault;
using driver::Vector3;

/// Longest elapsed time for rates and soft start, so that a delayed thread does not jump to full
/// force.
constexpr Duration kElapsedMax = std::chrono::milliseconds{10};
constexpr Duration kConfigTimeMax = std::chrono::seconds{10};
constexpr std::optional<WrenchCommand> kNoCommand{};

Vector3 scaled(const Vector3& vector, double by) noexcept {
  return {vector.x * by, vector.y * by, vector.z * by};
}
Vector3 sum(const Vector3& a, const Vector3& b) noexcept {
  return {a.x + b.x, a.y + b.y, a.z + b.z};
}
Vector3 difference(const Vector3& a, const Vector3& b) noexcept {
  return {a.x - b.x, a.y - b.y, a.z - b.z};
}
/// Shortens `vector` to `length_max`, keeping its direction; true if it was longer. Never squares a
/// component, which could overflow.
bool shorten(Vector3& vector, double length_max) noexcept {
  const double greatest = std::max({std::abs(vector.x), std::abs(vector.y), std::abs(vector.z)});
  if (greatest <= 0) return false;
  const Vector3 direction{vector.x / greatest, vector.y / greatest, vector.z / greatest};
  const double direction_length = std::hypot(direction.x, direction.y, direction.z);
  const double share = length_max / direction_length;
  if (greatest <= share) return false;
  vector = scaled(direction, share);
  return true;
}

/// Moves `from` towards `to` by at most `way_max`; true if that was not enough.
bool approach(Vector3& from, const Vector3& to, double way_max) noexcept {
  Vector3 way = difference(to, from);
  const bool is_limited = shorten(way, way_max);
  from = is_limited ? sum(from, way) : to;
  return is_limited;
}

/// `time` + `span`, saturating at kNever.
MonotonicTime after(MonotonicTime time, Duration span) noexcept {
  return time > kNever - span ? kNever : time + span;
}

double seconds(Duration duration) noexcept {
  return std::chrono::duration<double>(duration).count();
}

}  // namespace

SafetyConfig SafetyConfig::for_device(const driver::Limits& limits) noexcept {
  SafetyConfig config;
  config.force_newton_max = limits.force_newton_max;
  config.torque_newton_metre_max = limits.torque_newton_metre_max;
  return config;
}

expected<void, SetupError> SafetyConfig::check() const {
  struct Limit {
    const char* name;
    double value;
  };
  const std::array limits{Limit{"force_newton_max", force_newton_max},
                          Limit{"torque_newton_metre_max", torque_newton_metre_max},
                          Limit{"force_newton_per_s_max", force_newton_per_s_max},
                          Limit{"torque_newton_metre_per_s_max", torque_newton_metre_per_s_max}};
  for (const Limit& limit : limits) {
    if (std::isfinite(limit.value) && limit.value >= 0) continue;
    return setup_error(
        std::string("the safety limit ") + limit.name + " is " + std::to_string(limit.value), "",
        "choose a number, zero or above");
  }
  struct Time {
    const char* name;
    Duration value;
  };
  const std::array times{Time{"hold_max", hold_max}, Time{"ramp", ramp},
                         Time{"soft_start", soft_start}};
  for (const Time& time : times) {
    if (time.value >= Duration{0} && time.value <= kConfigTimeMax) continue;
    return setup_error(std::string("the safety time ") + time.name + " is " +
                           std::to_string(seconds(time.value)) + " s",
                       "", "choose 0 to 10 s");
  }
  return {};
}

driver::Wrench SafetyFilter::step(MonotonicTime now,
                                  const std::optional<WrenchCommand>& offered) noexcept {
  if (last_step_) now = std::max(now, *last_step_);
  const Duration elapsed = last_step_ ? now - *last_step_ : Duration{0};
  last_step_ = now;
  faults_ = {};

  if (offered && !is_latched_ && !is_finite(offered->wrench)) {
    is_latched_ = true;
    ++counters_.not_finite_count;
  }
  if (is_latched_) {
    go_off();
    faults_.set(Fault::kCommandNotFinite);
    return output_;
  }
  // The next client's commands count in the cycle after the first one without force.
  const bool is_changing_client = is_changing_client_;
  const std::optional<WrenchCommand>& newest = is_changing_client ? kNoCommand : offered;
  // The command of a client without the lease ends now.
  const MonotonicTime ends =
      newest ? std::min(newest->deadline, after(newest->received, config_.hold_max)) : now;
  if (now < ends) {
    zero_at_ = after(ends, config_.ramp);
    follow(*newest, elapsed);
  } else {
    if (is_following_) {
      is_following_ = false;
      is_lost_ = newest.has_value();
      if (is_lost_) ++counters_.lost_count;
    }
    // A loss ends with a new command, or when no client may command.
    if (!newest) is_lost_ = false;
    zero_at_ = std::min(zero_at_, after(ends, config_.ramp));
    ramp_down(now, elapsed);
  }
  if (is_lost_) faults_.set(Fault::kCommandLost);
  if (is_changing_client && is_off()) {
    is_changing_client_ = false;
    gain_ = 0;
  }
  return output_;
}

void SafetyFilter::follow(const WrenchCommand& command, Duration elapsed) noexcept {
  is_following_ = true;
  is_lost_ = false;
  elapsed = std::min(elapsed, kElapsedMax);
  gain_ = config_.soft_start > Duration{0}
              ? std::min(1.0, gain_ + seconds(elapsed) / seconds(config_.soft_start))
              : 1.0;
  if (gain_ < 1.0) faults_.set(Fault::kSoftStart);

  driver::Wrench target = command.wrench;
  const bool is_force_clamped = shorten(target.force_newton, config_.force_newton_max);
  const bool is_torque_clamped =
      shorten(target.torque_newton_metre, config_.torque_newton_metre_max);
  if (is_force_clamped || is_torque_clamped) {
    faults_.set(Fault::kForceClamped);
    ++counters_.clamped_count;
  }
  target.force_newton = scaled(target.force_newton, gain_);
  target.torque_newton_metre = scaled(target.torque_newton_metre, gain_);

  const double elapsed_s = seconds(elapsed);
  const bool is_force_limited = approach(output_.force_newton, target.force_newton,
                                         config_.force_newton_per_s_max * elapsed_s);
  const bool is_torque_limited = approach(output_.torque_newton_metre, target.torque_newton_metre,
                                          config_.torque_newton_metre_per_s_max * elapsed_s);
  if (is_force_limited || is_torque_limited) {
    faults_.set(Fault::kForceRateLimited);
    ++counters_.rate_limited_count;
  }
}

void SafetyFilter::ramp_down(MonotonicTime now, Duration elapsed) noexcept {
  if (now >= zero_at_ || config_.ramp <= Duration{0}) {
    output_ = {};
    gain_ = 0;
    return;
  }
  // The ramp began at zero_at − ramp, perhaps between two steps. Each step shrinks the force by the
  // elapsed share of the remaining time, which is linear from any start.
  const Duration rest_now = zero_at_ - now;
  const Duration rest_before = std::min(rest_now + elapsed, config_.ramp);
  const double share = std::clamp(seconds(rest_now) / seconds(rest_before), 0.0, 1.0);
  output_.force_newton = scaled(output_.force_newton, share);
  output_.torque_newton_metre = scaled(output_.torque_newton_metre, share);
  gain_ *= share;
}

void SafetyFilter::go_off() noexcept {
  output_ = {};
  gain_ = 0;
  is_following_ = false;
  is_changing_client_ = false;
  is_lost_ = false;
  if (last_step_) zero_at_ = *last_step_;
}

void SafetyFilter::recover() noexcept {
  is_latched_ = false;
  reset();
}

void SafetyFilter::change_client() noexcept {
  is_changing_client_ = true;
}

void SafetyFilter::reset() noexcept {
  go_off();
  faults_ = {};
}

}  // namespace rtpm::gvd
