#pragma once

#include <cstddef>
#include <optional>
#include <string_view>
#include <utility>
#include <vector>

#include "rtpm/driver/calibration.hpp"

namespace rtpm::device_serial {

/// Finds the board's readings of its joints at their zero positions, as the mean of several
/// samples.
class ZeroCalibration final : public driver::Calibration {
 public:
  static constexpr std::size_t kSampleCount = 50;
  /// Largest movement of a paddle that is held still, in rad or m.
  static constexpr double kMovementMax = 0.02;

  /// The largest zero position, in rad or m.
  static constexpr double kZeroMax = 1e6;

  /// @param zero  the current correction, which the samples contain
  explicit ZeroCalibration(std::vector<double> zero)
      : zero_(std::move(zero)), first_(zero_.size()), sum_(zero_.size()) {}
  [[nodiscard]] driver::CalibrationState step(const driver::Sample& sample,
                                              std::optional<std::string_view> answer) override;

 private:
  [[nodiscard]] driver::CalibrationState result() const;

  std::vector<double> zero_;
  std::vector<double> first_;
  std::vector<double> sum_;
  std::size_t count_ = 0;
  bool is_ready_ = false;
};

}  // namespace rtpm::device_serial
