#pragma once

#include <array>
#include <cstdint>
#include <string_view>
#include <vector>

#include "player_channels.hpp"
#include "rtpm/models/model.hpp"

namespace rtpm::media {

/// The effect of turning the knob.
enum class Mode : std::uint8_t {
  kSpeed = 0,  ///< The angle is the rate.
  kScrub = 1,  ///< The angle is the position.
  kFrame = 2,  ///< Each detent is a frame.
};
inline constexpr std::uint8_t kModeCount = 3;
/// "speed", "scrub", "frame".
[[nodiscard]] std::string_view to_string(Mode mode) noexcept;
/// The mode that a press of the knob's button selects.
[[nodiscard]] Mode next(Mode mode) noexcept;

/// The request that the control makes to the player.
struct Request {
  double rate = 0;
  double seek_s = -1;  ///< Below 0 for no seek.
};

/// Maps the knob's angle to the player's rate and position, and defines how the knob feels. Pure:
/// no clock, no device.
///
/// | mode  | one turn                 | feel                                                     |
/// |-------|--------------------------|----------------------------------------------------------|
/// | speed | 24 detents of 0.25 x     | firm detents, a pull to the pause, stops at the ends     |
/// | scrub | 10 s                     | soft detents of 0.5 s, heavy, stops at the clip's ends   |
/// | frame | 24 frames                | crisp detents, stops at the clip's ends                  |
/// @ownership a value
/// @threads  one at a time
class Control {
 public:
  static constexpr double kScrubSecondsPerTurn = 10;
  static constexpr double kScrubDetentSeconds = 0.5;
  static constexpr int kNotchesPerTurn = 24;
  static constexpr double kRateStep = 0.25;

  Control(const KnobChannel& knob, double rate_max) noexcept : knob_(knob), rate_max_(rate_max) {}

  /// Changes the mode; the knob's current angle then corresponds to the player's current state.
  void enter(Mode mode, double angle_rad, const PlayerView& player) noexcept;
  [[nodiscard]] Mode mode() const noexcept { return mode_; }

  /// The models that the knob should render from now on.
  /// @realtime set-up only: allocates
  [[nodiscard]] std::vector<gvd::Model> models() const;
  /// @realtime alloc-free
  [[nodiscard]] Request step(double angle_rad) noexcept;
  /// The knob's angle, in detents of the mode.
  [[nodiscard]] double notch(double angle_rad) const noexcept;

 private:
  [[nodiscard]] double spacing_rad() const noexcept;
  [[nodiscard]] double last_frame_s() const noexcept;
  [[nodiscard]] double to_frame(double position_s) const noexcept;
  [[nodiscard]] double angle_of(double position_s) const noexcept;

  KnobChannel knob_;
  double rate_max_;
  Mode mode_ = Mode::kSpeed;
  double origin_rad_ = 0;  ///< The angle of the first detent.
  PlayerView origin_{};    ///< The player's state at `origin_rad_`.
  double notch_ = 0;       ///< The knob's current detent, with hysteresis.
};

}  // namespace rtpm::media
