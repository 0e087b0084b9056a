#include "zero_calibration.hpp"

#include <cmath>
#include <string>

namespace rtpm::device_serial {

driver::CalibrationState ZeroCalibration::step(const driver::Sample& sample,
                                               std::optional<std::string_view> answer) {
  is_ready_ = is_ready_ || answer.has_value();
  if (!is_ready_)
    return driver::CalibrationPrompt{0, "Hold all joints in their zero position.", {"ready"}};
  for (std::size_t i = 0; i < zero_.size(); ++i) {
    const double position = sample.joints[i];
    if (count_ == 0) first_[i] = position;
    if (std::abs(position - first_[i]) > kMovementMax)
      return driver::CalibrationFailed{"joint " + std::to_string(i) +
                                       " moved; hold it still, and calibrate again"};
    sum_[i] += position;
  }
  ++count_;
  if (count_ == kSampleCount) return result();
  return driver::CalibrationRunning{static_cast<double>(count_) / kSampleCount};
}

driver::CalibrationState ZeroCalibration::result() const {
  std::vector<double> zero = zero_;
  std::string corrections;
  for (std::size_t i = 0; i < zero.size(); ++i) {
    const double correction = sum_[i] / static_cast<double>(count_);
    zero[i] += correction;
    if (!(std::abs(zero[i]) <= kZeroMax))
      return driver::CalibrationFailed{"joint " + std::to_string(i) +
                                       " reads a position beyond any joint's; check its sensor"};
    corrections += (i == 0 ? "" : ", ") + std::to_string(correction);
  }
  return driver::CalibrationDone{{{"joint.zero", zero}},
                                 "The joints read " + corrections + " in their zero position."};
}

}  // namespace rtpm::device_serial
