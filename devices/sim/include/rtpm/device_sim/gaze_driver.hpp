#pragma once

#include <atomic>
#include <memory>
#include <span>
#include <string_view>
#include <vector>

#include "rtpm/device_sim/twin.hpp"

namespace rtpm::device_sim {

/// A direction of gaze, relative to straight ahead.
struct Gaze {
  double right_rad = 0;
  double up_rad = 0;
};

/// The correction of a gaze tracker: gaze = offset + gain × measured, for each direction.
struct GazeCorrection {
  Gaze offset{};
  Gaze gain{1, 1};
};

/// The simulated person in front of the tracker.
/// @threads  any
/// @realtime alloc-free
class GazeSubject {
 public:
  /// Makes the person look at a point until the next call; if negative, wherever they like.
  void look_at(int point) noexcept { told_.store(point, std::memory_order_relaxed); }
  [[nodiscard]] int told() const noexcept { return told_.load(std::memory_order_relaxed); }

 private:
  std::atomic<int> told_{-1};
};

/// A gaze tracker and its subject: the pose's orientation rotates -z to where the subject looks, in
/// the head's frame; analog "pupil" is the diameter of the pupil; button "blink" is pressed for
/// 0.15 s every 4 s. The subject looks at nine points in turn, with the tremor of an eye, or at the
/// point selected by look_at() or a prompt. The optics have an offset and a gain error, which the
/// calibration "nine_points" measures and the parameters "correction." remove.
class GazeDriver final : public Twin {
 public:
  /// Nine points: three by three, this far apart.
  static constexpr int kPointCount = 9;
  static constexpr double kPointDistanceRad = 0.2;
  /// The error of the optics; a calibration finds its inverse.
  static constexpr Gaze kOpticsOffset{0.03, -0.02};
  static constexpr Gaze kOpticsGain{1.1, 0.93};
  // The range of a correction.
  static constexpr double kOffsetMaxRad = 0.5;
  static constexpr double kGainMin = 0.5;
  static constexpr double kGainMax = 2;

  explicit GazeDriver(TwinConfig twin) : Twin(std::move(twin)) {}
  [[nodiscard]] driver::Descriptor describe() const override;
  [[nodiscard]] std::vector<driver::ParameterSpec> parameters() const override;
  [[nodiscard]] expected<void, SetupError> set_parameters(
      std::span<driver::ParameterSetting> settings) override;
  [[nodiscard]] std::vector<driver::CalibrationInfo> calibrations() const override;
  [[nodiscard]] std::unique_ptr<driver::Calibration> make_calibration(
      std::string_view name) override;

  /// Point 0 to kPointCount - 1, row by row, starting at the upper left.
  [[nodiscard]] static Gaze point(int index) noexcept;
  /// Makes the subject look at a point until the next call; if negative, wherever they like.
  /// @threads  any
  void look_at(int point) noexcept { subject_->look_at(point); }
  [[nodiscard]] const GazeCorrection& correction() const noexcept { return correction_; }

 private:
  void reset() noexcept override {}
  void step(const driver::Command& command, double elapsed_s,
            driver::Sample& sample) noexcept override;
  [[nodiscard]] Gaze gaze() const noexcept;

  GazeCorrection correction_{};
  std::shared_ptr<GazeSubject> subject_ = std::make_shared<GazeSubject>();
};

/// The direction of gaze that the orientation in a sample describes.
[[nodiscard]] Gaze gaze_of(const driver::Quaternion& orientation) noexcept;

}  // namespace rtpm::device_sim
