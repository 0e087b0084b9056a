#include "rtpm/device_sim/arm.hpp"

#include <algorithm>
#include <cmath>

namespace rtpm::device_sim {
namespace {

constexpr double kSliceSeconds = 0.001;

Eigen::Vector3d to_eigen(const driver::Vector3& vector) noexcept {
  return {vector.x, vector.y, vector.z};
}

}  // namespace

Arm::Arm(const ArmConfig& config, Hand hand) : config_(config), hand_(std::move(hand)) {
  motion_.position_m = hand_->target_at(0).position_m;
}

void Arm::step(const Eigen::Vector3d& command_newton, Duration elapsed) noexcept {
  const bool is_finite = command_newton.allFinite();
  applied_newton_ = is_finite ? command_newton : Eigen::Vector3d::Zero();
  const double length_newton = applied_newton_.stableNorm();
  is_saturated_ = !is_finite || length_newton > config_.force_newton_max;
  if (length_newton > config_.force_newton_max) {
    // Normalizes first: the square of a very long vector's length is not finite.
    applied_newton_ = applied_newton_.stableNormalized() * config_.force_newton_max;
  }
  const Duration span = std::clamp(elapsed, Duration{0}, kStepMax);
  const double span_s = std::chrono::duration<double>(span).count();
  const auto slice_count = static_cast<int>(std::ceil(span_s / kSliceSeconds));
  for (int slice = 0; slice < slice_count; ++slice)
    step_slice(span_s / slice_count);
}

void Arm::step_slice(double slice_s) noexcept {
  time_s_ += slice_s;
  // The new velocity solves m (v' − v) / dt = F + hand(x + dt v', v') − b v', so that neither a
  // stiff hand nor a long slice can add energy.
  double resistance = config_.mass_kg + slice_s * config_.damping_newton_s_per_m;
  Eigen::Vector3d impulse = config_.mass_kg * motion_.velocity_m_per_s + slice_s * applied_newton_;
  Eigen::Vector3d velocity = impulse / resistance;
  if (hand_) {
    const Motion target = hand_->target_at(time_s_);
    const HandConfig& hand = hand_->config();
    const double grip =
        slice_s * hand.damping_newton_s_per_m + slice_s * slice_s * hand.stiffness_newton_per_m;
    const Eigen::Vector3d pull =
        hand.stiffness_newton_per_m * (target.position_m - motion_.position_m) +
        hand.damping_newton_s_per_m * target.velocity_m_per_s;
    const Eigen::Vector3d held = (impulse + slice_s * pull) / (resistance + grip);
    hand_newton_ = pull - grip / slice_s * held;
    const double hand_length_newton = hand_newton_.norm();
    if (hand_length_newton > hand.force_newton_max) {
      hand_newton_ *= hand.force_newton_max / hand_length_newton;
      velocity = (impulse + slice_s * hand_newton_) / resistance;
    } else {
      velocity = held;
    }
  }
  motion_.velocity_m_per_s = velocity;
  motion_.position_m += slice_s * velocity;
  stop_at_workspace();
}

void Arm::stop_at_workspace() noexcept {
  const Eigen::Vector3d low_m = to_eigen(config_.workspace.low_m);
  const Eigen::Vector3d high_m = to_eigen(config_.workspace.high_m);
  is_at_stop_ = false;
  for (Eigen::Index axis = 0; axis < 3; ++axis) {
    const double stopped_m = std::clamp(motion_.position_m[axis], low_m[axis], high_m[axis]);
    if (stopped_m == motion_.position_m[axis]) continue;
    // A stop absorbs the motion: the arm does not bounce.
    motion_.position_m[axis] = stopped_m;
    motion_.velocity_m_per_s[axis] = 0;
    is_at_stop_ = true;
  }
}

Eigen::Vector3d Arm::measured_position_m() const noexcept {
  if (config_.resolution_m <= 0) return motion_.position_m;
  return (motion_.position_m / config_.resolution_m).array().round() * config_.resolution_m;
}

Eigen::Vector3d VelocityEstimator::update(const Eigen::Vector3d& position_m,
                                          double time_s) noexcept {
  const Point& last = points_[(count_ + kWindow) % points_.size()];
  if (count_ > 0 && time_s <= last.time_s) return velocity_m_per_s_;
  points_[count_ % points_.size()] = {position_m, time_s};
  ++count_;
  const std::size_t known = std::min(count_, window_ + 1);
  const Point& oldest = points_[(count_ - known) % points_.size()];
  if (known > 1) velocity_m_per_s_ = (position_m - oldest.position_m) / (time_s - oldest.time_s);
  return velocity_m_per_s_;
}

}  // namespace rtpm::device_sim
