#include "gaze_calibration.hpp"

#include <cmath>
#include <cstdio>
#include <string>
#include <vector>

namespace rtpm::device_sim {
namespace {

constexpr std::array kPointNames{"upper left",  "upper middle", "upper right",
                                 "middle left", "middle",       "middle right",
                                 "lower left",  "lower middle", "lower right"};
static_assert(kPointNames.size() == GazeDriver::kPointCount);
constexpr std::uint32_t kBlink = 1;  // Bit of button 0.

Gaze corrected(const GazeCorrection& correction, const Gaze& measured) noexcept {
  return {correction.offset.right_rad + correction.gain.right_rad * measured.right_rad,
          correction.offset.up_rad + correction.gain.up_rad * measured.up_rad};
}

Gaze uncorrected(const GazeCorrection& correction, const Gaze& gaze) noexcept {
  return {(gaze.right_rad - correction.offset.right_rad) / correction.gain.right_rad,
          (gaze.up_rad - correction.offset.up_rad) / correction.gain.up_rad};
}

double distance_rad(const Gaze& a, const Gaze& b) noexcept {
  return std::hypot(a.right_rad - b.right_rad, a.up_rad - b.up_rad);
}

/// Rounds to a millionth, far less than the tremor of the eye; the result is never a negative zero.
double rounded(double value) noexcept {
  return std::round(value * 1e6) / 1e6 + 0.0;
}

/// The line y = offset + gain · x through nine points with the smallest squared error.
struct Line {
  double offset = 0;
  double gain = 1;
};
using Points = std::array<Gaze, GazeDriver::kPointCount>;
Line fit(const Points& measured, double Gaze::*direction) noexcept {
  double x_mean = 0;
  double y_mean = 0;
  for (int i = 0; i < GazeDriver::kPointCount; ++i) {
    x_mean += measured[static_cast<std::size_t>(i)].*direction / GazeDriver::kPointCount;
    y_mean += GazeDriver::point(i).*direction / GazeDriver::kPointCount;
  }
  double xx = 0;
  double xy = 0;
  for (int i = 0; i < GazeDriver::kPointCount; ++i) {
    const double x = measured[static_cast<std::size_t>(i)].*direction - x_mean;
    xx += x * x;
    xy += x * (GazeDriver::point(i).*direction - y_mean);
  }
  const double gain = rounded(xx > 0 ? xy / xx : 0);
  return {rounded(y_mean - gain * x_mean), gain};
}

/// The root mean square of the error at the nine points.
double error_rad(const GazeCorrection& correction, const Points& measured) noexcept {
  double sum = 0;
  for (int i = 0; i < GazeDriver::kPointCount; ++i) {
    const Gaze gaze = corrected(correction, measured[static_cast<std::size_t>(i)]);
    sum += std::pow(distance_rad(gaze, GazeDriver::point(i)), 2);
  }
  return std::sqrt(sum / GazeDriver::kPointCount);
}

std::string in_mrad(double rad) {
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "%.2f mrad", rad * 1e3);
  return text.data();
}

bool is_gain(double gain) noexcept {
  return gain >= GazeDriver::kGainMin && gain <= GazeDriver::kGainMax;
}

}  // namespace

double NinePointCalibration::progress() const noexcept {
  return static_cast<double>(point_) / GazeDriver::kPointCount;
}

driver::CalibrationState NinePointCalibration::prompt() {
  subject_->look_at(point_);
  return driver::CalibrationPrompt{progress(),
                                   "Look at the point " +
                                       std::string(kPointNames[static_cast<std::size_t>(point_)]) +
                                       ", until the next prompt.",
                                   {"ready"}};
}

driver::CalibrationState NinePointCalibration::step(const driver::Sample& sample,
                                                    std::optional<std::string_view> answer) {
  is_ready_ = is_ready_ || answer.has_value();
  if (!is_ready_) return prompt();
  if ((sample.buttons & kBlink) != 0) return driver::CalibrationRunning{progress()};
  if (++count_ <= kSettleCount) return driver::CalibrationRunning{progress()};
  const Gaze gaze = uncorrected(correction_, gaze_of(sample.pose.orientation));
  if (count_ == kSettleCount + 1) first_ = gaze;
  if (distance_rad(gaze, first_) > kMovementMaxRad) {
    return driver::CalibrationFailed{
        "the gaze moved by " + in_mrad(distance_rad(gaze, first_)) + " at the point " +
        kPointNames[static_cast<std::size_t>(point_)] +
        "; look at each point until the next prompt, and calibrate again"};
  }
  sum_.right_rad += gaze.right_rad;
  sum_.up_rad += gaze.up_rad;
  if (count_ < kSettleCount + kSampleCount) return driver::CalibrationRunning{progress()};
  measured_[static_cast<std::size_t>(point_)] = {sum_.right_rad / kSampleCount,
                                                 sum_.up_rad / kSampleCount};
  sum_ = {};
  count_ = 0;
  is_ready_ = false;
  return ++point_ < GazeDriver::kPointCount ? prompt() : result();
}

driver::CalibrationState NinePointCalibration::result() const {
  const Line right = fit(measured_, &Gaze::right_rad);
  const Line up = fit(measured_, &Gaze::up_rad);
  const GazeCorrection found{{right.offset, up.offset}, {right.gain, up.gain}};
  const double after_rad = error_rad(found, measured_);
  const bool is_possible = is_gain(right.gain) && is_gain(up.gain) &&
                           std::abs(right.offset) <= GazeDriver::kOffsetMaxRad &&
                           std::abs(up.offset) <= GazeDriver::kOffsetMaxRad;
  if (!is_possible || after_rad > kErrorMaxRad) {
    return driver::CalibrationFailed{"the gaze does not suit the nine points (error " +
                                     in_mrad(after_rad) +
                                     "); look at each point as prompted, and calibrate again"};
  }
  return driver::CalibrationDone{
      {{"correction.offset_rad", std::vector<double>{right.offset, up.offset}},
       {"correction.gain", std::vector<double>{right.gain, up.gain}}},
      "The error at the nine points is " + in_mrad(after_rad) +
          " (before: " + in_mrad(error_rad(correction_, measured_)) + ")."};
}

}  // namespace rtpm::device_sim
