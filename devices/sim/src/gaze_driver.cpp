#include "rtpm/device_sim/gaze_driver.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "gaze_calibration.hpp"
#include "settings.hpp"

namespace rtpm::device_sim {
namespace {

constexpr double kFixationS = 0.5;
constexpr double kSaccadeS = 0.04;
constexpr double kTremorRad = 5e-4;

/// Rotates first about y to the left, then upwards about the rotated x.
driver::Quaternion orientation_of(const Gaze& gaze) noexcept {
  const double left = -gaze.right_rad / 2;
  const double up = gaze.up_rad / 2;
  return {std::cos(left) * std::sin(up), std::sin(left) * std::cos(up),
          -std::sin(left) * std::sin(up), std::cos(left) * std::cos(up)};
}

double wave(double time_s, double frequency_hz, double phase) noexcept {
  return std::sin(2 * std::numbers::pi * (frequency_hz * time_s + phase));
}

}  // namespace

Gaze gaze_of(const driver::Quaternion& q) noexcept {
  // The vector -z rotated by q.
  const double x = -2 * (q.x * q.z + q.w * q.y);
  const double y = -2 * (q.y * q.z - q.w * q.x);
  const double z = -(1 - 2 * (q.x * q.x + q.y * q.y));
  return {std::atan2(x, -z), std::atan2(y, std::hypot(x, z))};
}

driver::Descriptor GazeDriver::describe() const {
  driver::Descriptor descriptor =
      identity(driver::DeviceClass::kTracker, "RTPM simulated gaze tracker");
  descriptor.axes = {{.name = "rx"}, {.name = "ry"}};
  descriptor.buttons = {"blink"};
  descriptor.analogs = {{.name = "pupil", .unit = "m", .low = 0, .high = 0.01}};
  descriptor.rate_hz = 250;
  return descriptor;
}

Gaze GazeDriver::point(int index) noexcept {
  return {(index % 3 - 1) * kPointDistanceRad, (1 - index / 3) * kPointDistanceRad};
}

Gaze GazeDriver::gaze() const noexcept {
  const int told = subject_->told();
  if (told >= 0 && told < kPointCount) return point(told);
  const auto fixation = static_cast<std::uint64_t>(time_s() / kFixationS);
  const auto point_of = [&](std::uint64_t number) {
    return point(static_cast<int>(random_share(config().seed, number) * kPointCount));
  };
  const Gaze to = point_of(fixation + 1);
  const Gaze from = point_of(fixation);
  const double since_s = time_s() - static_cast<double>(fixation) * kFixationS;
  const double share = std::min(1.0, since_s / kSaccadeS);
  return {from.right_rad + share * (to.right_rad - from.right_rad),
          from.up_rad + share * (to.up_rad - from.up_rad)};
}

void GazeDriver::step(const driver::Command&, double, driver::Sample& sample) noexcept {
  Gaze gaze = this->gaze();
  const double phase = random_share(config().seed, 0);
  gaze.right_rad += kTremorRad * wave(time_s(), 83, phase);
  gaze.up_rad += kTremorRad * wave(time_s(), 67, phase);
  const Gaze measured{kOpticsOffset.right_rad + kOpticsGain.right_rad * gaze.right_rad,
                      kOpticsOffset.up_rad + kOpticsGain.up_rad * gaze.up_rad};
  const Gaze corrected{
      correction_.offset.right_rad + correction_.gain.right_rad * measured.right_rad,
      correction_.offset.up_rad + correction_.gain.up_rad * measured.up_rad};
  sample.pose.orientation = orientation_of(corrected);
  sample.analogs[0] = static_cast<float>(4e-3 + 5e-4 * wave(time_s(), 0.2, phase));
  set_button(sample, std::fmod(time_s(), 4.0) >= 3.85);
}

std::vector<driver::ParameterSpec> GazeDriver::parameters() const {
  using driver::ParameterType;
  return {{.name = "correction.offset_rad",
           .type = ParameterType::kVector,
           .unit = "rad",
           .low = -kOffsetMaxRad,
           .high = kOffsetMaxRad,
           .vector_size = 2,
           .default_value = std::vector<double>{0, 0},
           .description = "Added to the gaze to the right and upwards, after the gain."},
          {.name = "correction.gain",
           .type = ParameterType::kVector,
           .unit = "1",
           .low = kGainMin,
           .high = kGainMax,
           .vector_size = 2,
           .default_value = std::vector<double>{1, 1},
           .description = "Factor of the measured gaze to the right and upwards."}};
}

expected<void, SetupError> GazeDriver::set_parameters(
    std::span<driver::ParameterSetting> settings) {
  const auto take_gaze = [&](std::string_view name, Gaze& to) {
    const auto* const elements = find<std::vector<double>>(settings, name);
    if (elements != nullptr) to = {elements->at(0), elements->at(1)};
  };
  take_gaze("correction.offset_rad", correction_.offset);
  take_gaze("correction.gain", correction_.gain);
  return {};
}

std::vector<driver::CalibrationInfo> GazeDriver::calibrations() const {
  return {{"nine_points", "Finds the correction: look at nine points, one after the other."}};
}

std::unique_ptr<driver::Calibration> GazeDriver::make_calibration(std::string_view name) {
  if (name != "nine_points") return nullptr;
  return std::make_unique<NinePointCalibration>(correction_, subject_);
}

}  // namespace rtpm::device_sim
