#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/recording/file_reader.hpp"

namespace rtpm::capture {

/// The most bytes of the messages that a part begins with.
inline constexpr std::size_t kPrecedentByteMax = std::size_t{64} << 20;

/// Writes a new recording of the messages that `query` selects, like recording::cut(), which stands
/// by itself: of the channels that `query` selects it begins with what held before its first
/// moment. These are, at that moment, the descriptions and parameters of devices, their local
/// models, lifecycle, contact, lease, stop and faults; and the begins of the trials that were
/// running, which keep their origins.
/// @return   the number of messages in the new recording, with those at its beginning
/// @errors   those of recording::cut(); what held takes more than kPrecedentByteMax
/// @realtime never
[[nodiscard]] expected<std::uint64_t, SetupError> cut(const std::string& from,
                                                      const std::string& to,
                                                      const recording::Query& query,
                                                      const recording::Progress& progress = {});

}  // namespace rtpm::capture
