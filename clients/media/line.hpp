#pragma once

#include <string>

#include "control.hpp"
#include "follow_meter.hpp"
#include "player_channels.hpp"

namespace rtpm::media {

/// The player's state in one line:
/// "scrub  [=======|............]   7.24 of 20.00 s   paused   dial +98°".
/// @realtime set-up only
[[nodiscard]] std::string line_text(Mode mode, const PlayerView& player, double angle_rad);

/// A summary of the targets: "followed 231 targets, 12.4 s forwards and 10.3 s backwards; …".
/// @realtime set-up only
[[nodiscard]] std::string follow_text(const FollowMeter& meter);

}  // namespace rtpm::media
