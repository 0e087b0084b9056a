#pragma once

#include <string>

#include "rtpm/base/setup_error.hpp"

namespace rtpm::media {

/// An uncompressed clip: a bar that circles once, and a light that is on during even seconds.
struct ClipConfig {
  int width = 160;  ///< In pixels; must be even.
  int height = 90;  ///< In pixels; must be even.
  int frames_per_s = 25;
  int duration_s = 20;
};

/// Writes the clip to `path` as YUV4MPEG2 (.y4m), so that a player can seek to each frame.
/// @realtime set-up only
/// @errors   the file can't be written
/// @source   yuv4mpeg(5) of mjpegtools
[[nodiscard]] expected<void, SetupError> write_clip(const std::string& path,
                                                    const ClipConfig& config = {});

}  // namespace rtpm::media
