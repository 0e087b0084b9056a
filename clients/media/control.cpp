#include "control.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace rtpm::media {
namespace {

constexpr double kTurnRad = 2 * std::numbers::pi;

/// A knob halfway between two detents keeps the detent that it came from.
constexpr double kHysteresisNotches = 0.6;

/// Shares of the knob's maximum effort, and of that effort at one turn per second.
struct Feel {
  double detent = 0;
  double damping = 0;
};
constexpr std::array<Feel, kModeCount> kFeels{{
    {.detent = 0.05, .damping = 0.01},
    {.detent = 0.01, .damping = 0.06},
    {.detent = 0.06, .damping = 0.02},
}};
/// The effort that pulls towards the pause, at the fastest rate.
constexpr double kPauseEffort = 0.02;
/// The effort of the end stops, over one detent.
constexpr double kEndEffort = 0.5;

}  // namespace

std::string_view to_string(Mode mode) noexcept {
  static constexpr std::array<std::string_view, kModeCount> kNames{"speed", "scrub", "frame"};
  return kNames[static_cast<std::size_t>(mode)];
}

Mode next(Mode mode) noexcept {
  return static_cast<Mode>((static_cast<unsigned>(mode) + 1) % kModeCount);
}

void Control::enter(Mode mode, double angle_rad, const PlayerView& player) noexcept {
  mode_ = mode;
  origin_rad_ = angle_rad;
  origin_ = player;
  origin_.position_s = std::clamp(to_frame(player.position_s), 0.0, last_frame_s());
  notch_ = 0;
}

double Control::spacing_rad() const noexcept {
  if (mode_ == Mode::kScrub) return kTurnRad * kScrubDetentSeconds / kScrubSecondsPerTurn;
  return kTurnRad / kNotchesPerTurn;
}

double Control::notch(double angle_rad) const noexcept {
  return (angle_rad - origin_rad_) / spacing_rad();
}

double Control::last_frame_s() const noexcept {
  return std::max(0.0, to_frame(origin_.duration_s - origin_.frame_s));
}

double Control::to_frame(double position_s) const noexcept {
  return std::round(position_s / origin_.frame_s) * origin_.frame_s;
}

double Control::angle_of(double position_s) const noexcept {
  const double notches = (position_s - origin_.position_s) /
                         (mode_ == Mode::kScrub ? kScrubDetentSeconds : origin_.frame_s);
  return origin_rad_ + notches * spacing_rad();
}

std::vector<gvd::Model> Control::models() const {
  const Feel& feel = kFeels[static_cast<std::size_t>(mode_)];
  const double effort = knob_.effort_newton_metre_max;
  const double range_rad = rate_max_ / kRateStep * spacing_rad();
  gvd::DialDetents detents;
  detents.joint = static_cast<std::uint8_t>(knob_.joint);
  detents.origin_rad = origin_rad_;
  detents.spacing_rad = spacing_rad();
  detents.effort_newton_metre = feel.detent * effort;
  detents.damping_newton_metre_s_per_rad = feel.damping * effort / kTurnRad;
  const bool is_speed = mode_ == Mode::kSpeed;
  detents.low_rad = is_speed ? origin_rad_ - range_rad : angle_of(0);
  detents.high_rad = is_speed ? origin_rad_ + range_rad : angle_of(last_frame_s());
  detents.end_stiffness_newton_metre_per_rad = kEndEffort * effort / spacing_rad();
  std::vector<gvd::Model> models{detents};
  if (is_speed) {
    // The pull is strongest at a quarter of the spacing, which is placed at the fastest rate.
    models.emplace_back(gvd::DialDetents{.joint = detents.joint,
                                         .origin_rad = origin_rad_,
                                         .spacing_rad = 4 * range_rad,
                                         .effort_newton_metre = kPauseEffort * effort});
  }
  return models;
}

Request Control::step(double angle_rad) noexcept {
  const double notches = notch(angle_rad);
  if (std::abs(notches - notch_) > kHysteresisNotches) notch_ = std::round(notches);
  switch (mode_) {
    case Mode::kSpeed:
      return {.rate = std::clamp(notch_ * kRateStep, -rate_max_, rate_max_)};
    case Mode::kScrub: {
      const double position_s = origin_.position_s + notches * kScrubDetentSeconds;
      return {.seek_s = std::clamp(to_frame(position_s), 0.0, last_frame_s())};
    }
    case Mode::kFrame: {
      const double position_s = origin_.position_s + notch_ * origin_.frame_s;
      return {.seek_s = std::clamp(to_frame(position_s), 0.0, last_frame_s())};
    }
  }
  return {};
}

}  // namespace rtpm::media
