#pragma once

#include <array>
#include <cstddef>
#include <memory>

#include "rtpm/device_sim/gaze_driver.hpp"
#include "rtpm/driver/calibration.hpp"

namespace rtpm::device_sim {

/// Finds a tracker's correction: prompts the person to look at nine points, collects samples of
/// each, and computes the correction with the smallest squared error.
class NinePointCalibration final : public driver::Calibration {
 public:
  static constexpr std::size_t kSampleCount = 20;  ///< Number of samples per point.
  /// Number of samples ignored at the start of each point.
  static constexpr std::size_t kSettleCount = 5;
  /// The largest movement of a fixating eye.
  static constexpr double kMovementMaxRad = 0.02;
  /// The largest accepted error of a fit, as a root mean square.
  static constexpr double kErrorMaxRad = 0.02;

  /// @param correction  the current correction, which the samples contain
  /// @param subject     the simulated person, who follows the prompts
  NinePointCalibration(const GazeCorrection& correction, std::shared_ptr<GazeSubject> subject)
      : correction_(correction), subject_(std::move(subject)) {}
  /// Lets the person look wherever they like again.
  ~NinePointCalibration() override { subject_->look_at(-1); }
  [[nodiscard]] driver::CalibrationState step(const driver::Sample& sample,
                                              std::optional<std::string_view> answer) override;

 private:
  [[nodiscard]] driver::CalibrationState prompt();
  [[nodiscard]] driver::CalibrationState result() const;
  [[nodiscard]] double progress() const noexcept;

  GazeCorrection correction_;
  std::shared_ptr<GazeSubject> subject_;
  std::array<Gaze, GazeDriver::kPointCount> measured_{};  ///< The means, without the correction.
  int point_ = 0;
  bool is_ready_ = false;
  std::size_t count_ = 0;  ///< Number of samples of this point, including ignored ones.
  Gaze first_{};
  Gaze sum_{};
};

}  // namespace rtpm::device_sim
