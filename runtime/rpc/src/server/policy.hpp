#pragma once

#include <span>
#include <string_view>
#include <vector>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/rpc/server.hpp"

namespace rtpm::rpc {

/// Whether the server's limits are within the protocol's.
/// @realtime set-up only
[[nodiscard]] expected<void, SetupError> check_limits(const ServerConfig& config);
/// Checks the lanes, sorts them by band and fills in their defaults.
/// @realtime set-up only
/// @errors   lanes that overlap or leave out 0, a number out of range
[[nodiscard]] expected<std::vector<LaneConfig>, SetupError> checked_lanes(
    std::vector<LaneConfig> lanes);

/// Whether these lanes may serve an object with these options; the table is at ObjectOptions.
/// @realtime set-up only
/// @errors   the contradiction, in words
[[nodiscard]] expected<void, SetupError> check_policy(std::string_view path,
                                                      const ObjectOptions& options,
                                                      std::span<const LaneConfig> lanes,
                                                      bool borrows);

}  // namespace rtpm::rpc
