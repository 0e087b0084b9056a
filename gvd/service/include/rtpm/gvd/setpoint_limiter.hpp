#pragma once

#include <array>
#include <cstddef>

#include "rtpm/driver/descriptor.hpp"

namespace rtpm::gvd {

/// Whether every number of the setpoint is finite.
/// @realtime alloc-free
[[nodiscard]] bool is_finite(const driver::Setpoint& setpoint) noexcept;

/// Limits setpoints to a device's descriptor: positions to workspace and joint ranges, velocities
/// and efforts to their maxima, outputs to their ranges. The safety filter limits the wrench.
/// @ownership a value
/// @threads  const methods from any
/// @realtime alloc-free, except the constructor
class SetpointLimiter {
 public:
  explicit SetpointLimiter(const driver::Descriptor& descriptor);

  /// Whether the device accepts commands of `mode`; every device accepts kOff.
  [[nodiscard]] bool takes(driver::CommandMode mode) const noexcept;
  /// Limits `setpoint`, which must be finite. Channels that the device lacks become zero.
  [[nodiscard]] driver::Setpoint limit(const driver::Setpoint& setpoint) const noexcept;
  /// The values of the outputs without a command.
  [[nodiscard]] const std::array<float, driver::kOutputCountMax>& safe_outputs() const noexcept {
    return safe_outputs_;
  }

 private:
  struct Range {
    double low = 0;
    double high = 0;
  };

  [[nodiscard]] double limit_joint(std::size_t joint, driver::CommandMode mode,
                                   double value) const noexcept;

  std::array<bool, driver::kCommandModeCount> modes_{};
  std::array<Range, driver::kJointCountMax> positions_{};
  std::array<double, driver::kJointCountMax> velocities_max_{};
  std::array<double, driver::kJointCountMax> efforts_max_{};
  std::array<Range, driver::kOutputCountMax> outputs_{};
  std::array<float, driver::kOutputCountMax> safe_outputs_{};
  driver::Workspace workspace_{};
  double velocity_m_per_s_max_ = 0;
  double velocity_rad_per_s_max_ = 0;
};

}  // namespace rtpm::gvd
