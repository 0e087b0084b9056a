#pragma once

#include <cstddef>
#include <Eigen/Core>
#include <limits>

#include "rtpm/driver/calibration.hpp"

namespace rtpm::device_sim {

/// Finds the encoder readings in the home position, the origin, as the mean of several samples.
class EncoderOffsetCalibration final : public driver::Calibration {
 public:
  static constexpr std::size_t kSampleCount = 50;
  /// Largest movement of the arm while a hand rests on it.
  static constexpr double kMovementMaxMetres = 5e-4;
  /// The largest offset of the encoders.
  static constexpr double kOffsetMaxMetres = 0.02;

  /// @param offset_m  the current correction, which the samples contain
  explicit EncoderOffsetCalibration(const Eigen::Vector3d& offset_m) : offset_m_(offset_m) {}
  [[nodiscard]] driver::CalibrationState step(const driver::Sample& sample,
                                              std::optional<std::string_view> answer) override;

 private:
  [[nodiscard]] driver::CalibrationState result() const;

  Eigen::Vector3d offset_m_;
  Eigen::Vector3d first_m_ = Eigen::Vector3d::Zero();
  Eigen::Vector3d sum_m_ = Eigen::Vector3d::Zero();
  std::size_t count_ = 0;
  bool is_ready_ = false;
};

/// Finds the space that the arm can reach: the extreme positions of an operator's tour.
class WorkspaceCalibration final : public driver::Calibration {
 public:
  /// The smallest extent of a tour in each direction.
  static constexpr double kExtentMinMetres = 0.02;

  /// @param low_m,high_m  the range of the parameters
  WorkspaceCalibration(double low_m, double high_m) : range_low_m_(low_m), range_high_m_(high_m) {}
  [[nodiscard]] driver::CalibrationState step(const driver::Sample& sample,
                                              std::optional<std::string_view> answer) override;

 private:
  [[nodiscard]] driver::CalibrationState result() const;

  double range_low_m_;
  double range_high_m_;
  Eigen::Vector3d low_m_ = Eigen::Vector3d::Constant(std::numeric_limits<double>::infinity());
  Eigen::Vector3d high_m_ = Eigen::Vector3d::Constant(-std::numeric_limits<double>::infinity());
};

}  // namespace rtpm::device_sim
