#pragma once

#include <cstddef>
#include <span>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/device_falcon/transport.hpp"

namespace rtpm::device_falcon {

/// The sizes of a plausible firmware file; the known ones have 7324 to 8492 bytes.
inline constexpr std::size_t kFirmwareSizeMin = 4096;
inline constexpr std::size_t kFirmwareSizeMax = 16'384;
/// Attempts to load the firmware before the start has failed.
inline constexpr int kLoadAttemptMax = 3;

/// Sets the FTDI chip up, and loads the firmware if none runs. The motors get no force. Takes below
/// 0.1 s if a firmware runs, some 3 s to load one, and at most 20 s if every attempt fails.
/// @param firmware  contents of the user's file; may be empty
/// @realtime set-up only
/// @errors   in words with the remedy: unplugged, no firmware, a file that does not run, no answer
[[nodiscard]] expected<void, SetupError> start_up(Transport& transport,
                                                  std::span<const std::byte> firmware);

}  // namespace rtpm::device_falcon
