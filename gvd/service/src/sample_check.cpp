#include "sample_check.hpp"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>

#include "rtpm/driver/vector.hpp"
#include "rtpm/safety/finite.hpp"

namespace rtpm::gvd {
namespace {

constexpr double kDistanceMaxM = 1000;
/// The allowed error of a rotation's length: drivers use floats, and some do not normalise.
constexpr double kLengthErrorMax = 0.1;
/// How long before its opening a device may have measured a sample.
constexpr Duration kBeforeOpenMax = std::chrono::seconds{1};

template <class Value, std::size_t kCount>
bool is_finite(const std::array<Value, kCount>& values) noexcept {
  return std::ranges::all_of(values, [](Value value) { return std::isfinite(value); });
}

bool is_finite(const driver::Pose& pose) noexcept {
  const driver::Quaternion& turn = pose.orientation;
  return is_finite(pose.position_m) && std::isfinite(turn.x) && std::isfinite(turn.y) &&
         std::isfinite(turn.z) && std::isfinite(turn.w);
}

}  // namespace

std::string_view not_finite_field(const driver::Sample& sample) noexcept {
  if (!is_finite(sample.pose)) return "pose";
  if (!is_finite(sample.twist.linear_m_per_s) || !is_finite(sample.twist.angular_rad_per_s)) {
    return "twist";
  }
  if (!is_finite(sample.wrench_applied)) return "wrench_applied";
  if (!is_finite(sample.joints)) return "joints";
  if (!is_finite(sample.joint_velocities)) return "joint_velocities";
  if (!is_finite(sample.efforts_applied)) return "efforts_applied";
  if (!is_finite(sample.outputs_applied)) return "outputs_applied";
  if (!is_finite(sample.analogs)) return "analogs";
  return {};
}

bool is_plausible(const driver::Sample& sample, const MeasurementTimes& times) noexcept {
  const driver::Quaternion& turn = sample.pose.orientation;
  const double length_of_turn =
      std::sqrt(turn.x * turn.x + turn.y * turn.y + turn.z * turn.z + turn.w * turn.w);
  // A device that only reports changes has no time before the first change.
  const bool is_in_time =
      sample.host_time == MonotonicTime{} || (sample.host_time >= times.opened - kBeforeOpenMax &&
                                              sample.host_time <= times.cycle + times.period);
  return is_in_time && length(sample.pose.position_m) <= kDistanceMaxM &&
         std::abs(length_of_turn - 1) <= kLengthErrorMax;
}

}  // namespace rtpm::gvd
