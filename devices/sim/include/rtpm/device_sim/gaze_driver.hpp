#pragma once

#include <atomic>
#include <cstdint>

#include "rtpm/device_sim/twin.hpp"

namespace rtpm::device_sim {

/// A direction of gaze, from straight ahead.
struct Gaze {
  double right_rad = 0;
  double up_rad = 0;
};

/// A correction of a gaze tracker: gaze = offset + gain × measured, in each direction.
struct GazeCorrection {
  Gaze offset{};
  Gaze gain{1, 1};
};

/// A gaze tracker and its subject: the pose's orientation turns -z to where the subject looks, in
/// the frame of the head; analog "pupil" is the pupil's diameter; button "blink" is pressed for
/// 0.15 s every 4 s. The subject looks at one of nine points after the other, with the tremor of an
/// eye, or where look_at() says. The optics have an offset and a gain of their own, which a
/// calibration finds and set_correction() takes out.
class GazeDriver final : public Twin {
 public:
  /// Nine points: three by three, this far from each other.
  static constexpr int kPointCount = 9;
  static constexpr double kPointDistanceRad = 0.2;
  /// What the optics do to a gaze; a calibration finds the inverse.
  static constexpr Gaze kOpticsOffset{0.03, -0.02};
  static constexpr Gaze kOpticsGain{1.1, 0.93};

  explicit GazeDriver(TwinConfig twin) : Twin(std::move(twin)) {}
  [[nodiscard]] driver::Descriptor describe() const override;

  /// Point 0 to kPointCount - 1, row by row from the upper left.
  [[nodiscard]] static Gaze point(int index) noexcept;
  /// Lets the subject look at a point until further notice; below zero: at will.
  /// @threads  any
  void look_at(int point) noexcept { told_.store(point, std::memory_order_relaxed); }
  /// Of the next samples.
  /// @threads  that of exchange()
  void set_correction(const GazeCorrection& correction) noexcept { correction_ = correction; }
  [[nodiscard]] const GazeCorrection& correction() const noexcept { return correction_; }

 private:
  void reset() noexcept override {}
  void step(const driver::Command& command, double elapsed_s,
            driver::Sample& sample) noexcept override;
  [[nodiscard]] Gaze gaze() const noexcept;

  GazeCorrection correction_{};
  std::atomic<int> told_{-1};
};

/// The direction of gaze that a sample's orientation stands for.
[[nodiscard]] Gaze gaze_of(const driver::Quaternion& orientation) noexcept;

}  // namespace rtpm::device_sim
