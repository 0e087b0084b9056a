#pragma once

#include <array>
#include <cstddef>
#include <memory>

#include "rtpm/device_sim/gaze_driver.hpp"
#include "rtpm/driver/calibration.hpp"

namespace rtpm::device_sim {

/// Finds a tracker's correction: nine prompts to look at a point, samples of each, and the
/// correction with the least squares of the error.
class NinePointCalibration final : public driver::Calibration {
 public:
  static constexpr std::size_t kSampleCount = 20;  ///< Samples per point.
  static constexpr std::size_t kSettleCount = 5;   ///< First samples of a point, ignored.
  /// Largest movement of a fixating eye.
  static constexpr double kMovementMaxRad = 0.02;
  /// The greatest error of a fit, as a root mean square.
  static constexpr double kErrorMaxRad = 0.02;

  /// @param correction  the present one, which samples contain
  /// @param subject     the simulated person, who follows the prompts
  NinePointCalibration(const GazeCorrection& correction, std::shared_ptr<GazeSubject> subject)
      : correction_(correction), subject_(std::move(subject)) {}
  /// Lets the person look at will again.
  ~NinePointCalibration() override { subject_->look_at(-1); }
  [[nodiscard]] driver::CalibrationState step(const driver::Sample& sample,
                                              std::optional<std::string_view> answer) override;

 private:
  [[nodiscard]] driver::CalibrationState prompt();
  [[nodiscard]] driver::CalibrationState result() const;
  [[nodiscard]] double progress() const noexcept;

  GazeCorrection correction_;
  std::shared_ptr<GazeSubject> subject_;
  std::array<Gaze, GazeDriver::kPointCount> measured_{};  ///< Means, without the correction.
  int point_ = 0;
  bool is_ready_ = false;
  std::size_t count_ = 0;  ///< Samples of this point, ignored ones included.
  Gaze first_{};
  Gaze sum_{};
};

}  // namespace rtpm::device_sim
