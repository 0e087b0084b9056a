#pragma once

#include <cstdint>
#include <string>

#include "rtpm/driver/command.hpp"
#include "rtpm/driver/descriptor.hpp"
#include "rtpm/driver/sample.hpp"

/// mpv as a device, independent of how the driver reaches it.
namespace rtpm::device_mpv {

inline constexpr float kRateMax = 4;
inline constexpr double kLengthMaxSeconds = 86'400;

/// The newest state of the player.
/// @ownership plain value, trivially copyable
struct PlayerState {
  double position_s = 0;  ///< The time of the displayed frame.
  double duration_s = 0;  ///< 0 if nothing is loaded or the length is unknown.
  double speed = 1;       ///< The selected speed, even while paused.
  double frame_s = 0;     ///< Duration of one frame; 0 without video.
  bool is_paused = true;
  bool is_backwards = false;
  std::uint64_t report_count = 0;
};

/// A client's request to the player.
/// @ownership plain value, trivially copyable
struct PlayerRequest {
  float rate = 0;     ///< 0 pauses; a negative rate plays backwards.
  float seek_s = -1;  ///< A negative value does not seek.
};

/// Outputs "rate" (1 plays, 0 pauses, negative plays backwards) and "seek" (seeks to this time when
/// it changes; not if negative); analogs "position", "rate", "duration", "pause" and "frame".
/// @realtime set-up only
[[nodiscard]] driver::Descriptor player_descriptor(std::string serial, std::string frame);

/// The request for a command, within the descriptor's ranges; in any other mode a pause.
/// @realtime alloc-free
[[nodiscard]] PlayerRequest request_of(const driver::Command& command) noexcept;

/// Fills the descriptor's channels, within their ranges regardless of what the player reports.
/// @realtime alloc-free
void fill(driver::Sample& sample, const PlayerState& player, const PlayerRequest& request) noexcept;

}  // namespace rtpm::device_mpv
