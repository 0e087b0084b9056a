#pragma once

#include <cstddef>
#include <span>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/device_falcon/transport.hpp"

namespace rtpm::device_falcon {

/// The plausible sizes of a firmware file; known files have 7324 to 8492 bytes.
inline constexpr std::size_t kFirmwareSizeMin = 4096;
inline constexpr std::size_t kFirmwareSizeMax = 16'384;
/// Number of attempts to load the firmware before start-up fails.
inline constexpr int kLoadAttemptMax = 3;

/// Sets up the FTDI chip, and loads the firmware if none is running. The motors apply no force.
/// Takes less than 0.1 s if firmware is running, about 3 s to load it, and at most 20 s if every
/// attempt fails.
/// @param firmware  contents of the user's file; may be empty
/// @realtime set-up only
/// @errors   unplugged, no firmware, a file that does not run, no answer; described in words with
///           the remedy
[[nodiscard]] expected<void, SetupError> start_up(Transport& transport,
                                                  std::span<const std::byte> firmware);

}  // namespace rtpm::device_falcon
