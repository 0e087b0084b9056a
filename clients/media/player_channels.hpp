#pragma once

#include <cstddef>
#include <optional>
#include <string>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/driver/descriptor.hpp"
#include "rtpm/driver/sample.hpp"

namespace rtpm::media {

/// The player's state as the control sees it.
struct PlayerView {
  double position_s = 0;
  double duration_s = 0;
  double frame_s = 0.04;  ///< The frame time; above 0.
  double rate = 0;
};

/// The indices of a player's channels in its descriptor.
/// @ownership plain value
class PlayerChannels {
 public:
  /// @errors   the device is not a player with outputs "rate" and "seek" and an analog "position"
  [[nodiscard]] static expected<PlayerChannels, SetupError> of(const std::string& name,
                                                               const driver::Descriptor& player);
  [[nodiscard]] PlayerView view(const driver::Sample& sample) const noexcept;
  /// @param seek_s  below 0 for no seek
  [[nodiscard]] driver::Setpoint setpoint(double rate, double seek_s) const noexcept;
  [[nodiscard]] double rate_max() const noexcept { return rate_max_; }

 private:
  std::size_t rate_output_ = 0;
  std::size_t seek_output_ = 0;
  std::size_t position_ = 0;
  std::optional<std::size_t> rate_{};
  std::optional<std::size_t> duration_{};
  std::optional<std::size_t> frame_{};
  double rate_max_ = 1;
  double duration_max_s_ = 0;
};

/// The turning joint of a knob with a motor.
struct KnobChannel {
  std::size_t joint = 0;
  double effort_newton_metre_max = 0;
};
/// @errors   a device without such a joint
[[nodiscard]] expected<KnobChannel, SetupError> knob_channel(const std::string& name,
                                                             const driver::Descriptor& knob);

}  // namespace rtpm::media
