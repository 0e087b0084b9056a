#pragma once

#include <memory>
#include <optional>
#include <string>

#include "configuration.hpp"
#include "control.hpp"
#include "follow_meter.hpp"
#include "player_channels.hpp"
#include "rtpm/gvd/client.hpp"

namespace rtpm::media {

/// The paper's "Master Control" of §3.2: a client of the knob, whose feel it sets, and of the
/// player, whose rate and position it commands.
/// @threads  one
/// @realtime set-up only
class Session {
 public:
  /// Opens both devices and acquires both leases.
  /// @errors   those of gvd::DeviceClient::open(); the lease is held; a device of another class
  [[nodiscard]] static expected<std::unique_ptr<Session>, SetupError> open(
      rpc::Node& node, const Configuration& configuration);

  /// One cycle: reads both devices, commands the player, and maintains the knob's feel.
  /// @errors   an error that lasted for the patience, or that a retry can't fix
  [[nodiscard]] expected<void, SetupError> step();

  [[nodiscard]] std::string line() const;
  [[nodiscard]] const FollowMeter& meter() const noexcept { return meter_; }

 private:
  Session(Configuration configuration, gvd::DeviceClient knob, gvd::DeviceClient player,
          KnobChannel knob_channel, PlayerChannels channels) noexcept;
  /// Why a cycle failed: the device and its error.
  struct Failure {
    const std::string* device = nullptr;
    gvd::DeviceError error;
  };
  using Result = expected<void, Failure>;
  [[nodiscard]] Result run_cycle(MonotonicTime now);
  void enter(Mode mode, MonotonicTime now) noexcept;
  [[nodiscard]] Result command(MonotonicTime now);
  [[nodiscard]] Result keep_feel(MonotonicTime now);
  [[nodiscard]] double angle_rad() const noexcept;

  Configuration configuration_;
  gvd::DeviceClient knob_;
  gvd::DeviceClient player_;
  KnobChannel knob_channel_;
  PlayerChannels channels_;
  rpc::CallOptions call_{};
  Control control_;
  FollowMeter meter_{};
  driver::Sample knob_sample_{};
  PlayerView view_{};
  std::uint16_t edges_ = 0;
  double duration_s_ = -1;  ///< Length of the file that the control knows; -1 if none.
  MonotonicTime next_models_{};
  std::optional<MonotonicTime> failing_since_{};
};

}  // namespace rtpm::media
