#include "arm_calibration.hpp"

#include <algorithm>
#include <array>
#include <cstdio>
#include <string>
#include <vector>

namespace rtpm::device_sim {
namespace {

Eigen::Vector3d position_of(const driver::Sample& sample) {
  const driver::Vector3& position_m = sample.pose.position_m;
  return {position_m.x, position_m.y, position_m.z};
}

/// Rounds to a micrometre, which is less than an encoder step; the result is never a negative zero.
Eigen::Vector3d rounded(const Eigen::Vector3d& metres) {
  return ((metres.array() * 1e6).round() / 1e6 + 0.0).matrix();
}

std::vector<double> elements_of(const Eigen::Vector3d& vector) {
  return {vector.x(), vector.y(), vector.z()};
}

std::string in_mm(double metres) {
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "%.2f", metres * 1e3);
  return text.data();
}

std::string in_mm(const Eigen::Vector3d& metres) {
  return "(" + in_mm(metres.x()) + ", " + in_mm(metres.y()) + ", " + in_mm(metres.z()) + ") mm";
}

}  // namespace

driver::CalibrationState EncoderOffsetCalibration::step(const driver::Sample& sample,
                                                        std::optional<std::string_view> answer) {
  is_ready_ = is_ready_ || answer.has_value();
  if (!is_ready_) {
    return driver::CalibrationPrompt{
        0, "Put the arm at rest in its home position, the middle of its workspace.", {"ready"}};
  }
  const Eigen::Vector3d position_m = position_of(sample);
  if (count_ == 0) first_m_ = position_m;
  const double moved_m = (position_m - first_m_).norm();
  if (moved_m > kMovementMaxMetres) {
    return driver::CalibrationFailed{"the arm moved by " + in_mm(moved_m) +
                                     " mm; leave it at rest in its home position, and calibrate "
                                     "again"};
  }
  sum_m_ += position_m;
  ++count_;
  if (count_ == kSampleCount) return result();
  return driver::CalibrationRunning{static_cast<double>(count_) / kSampleCount};
}

driver::CalibrationState EncoderOffsetCalibration::result() const {
  // A sample is the reading of the encoders minus the current correction.
  const Eigen::Vector3d error_m = rounded(sum_m_ / static_cast<double>(count_));
  const Eigen::Vector3d offset_m = rounded(offset_m_ + error_m);
  if (offset_m.cwiseAbs().maxCoeff() > kOffsetMaxMetres) {
    return driver::CalibrationFailed{"the arm reads " + in_mm(error_m) +
                                     ", too far from its home position; put it there, and "
                                     "calibrate again"};
  }
  return driver::CalibrationDone{{{"encoder.offset_m", elements_of(offset_m)}},
                                 "The encoders' offset is " + in_mm(offset_m) +
                                     "; positions were wrong by " + in_mm(error_m) + "."};
}

driver::CalibrationState WorkspaceCalibration::step(const driver::Sample& sample,
                                                    std::optional<std::string_view> answer) {
  const Eigen::Vector3d position_m = position_of(sample);
  low_m_ = low_m_.cwiseMin(position_m);
  high_m_ = high_m_.cwiseMax(position_m);
  if (answer) return result();
  return driver::CalibrationPrompt{
      0, "Move the arm through all corners of its workspace, then say so.", {"done"}};
}

driver::CalibrationState WorkspaceCalibration::result() const {
  const Eigen::Vector3d low_m = rounded(low_m_.cwiseMax(range_low_m_));
  const Eigen::Vector3d high_m = rounded(high_m_.cwiseMin(range_high_m_));
  const Eigen::Vector3d extent_m = high_m - low_m;
  if (extent_m.minCoeff() < kExtentMinMetres) {
    return driver::CalibrationFailed{"the arm moved over " + in_mm(extent_m) +
                                     " only; move it through all corners of its workspace, and "
                                     "calibrate again"};
  }
  return driver::CalibrationDone{
      {{"workspace.low_m", elements_of(low_m)}, {"workspace.high_m", elements_of(high_m)}},
      "The workspace is from " + in_mm(low_m) + " to " + in_mm(high_m) + "."};
}

}  // namespace rtpm::device_sim
