#pragma once

#include <span>
#include <string_view>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/rpc/server.hpp"

namespace rtpm::rpc {

/// Whether an object may be served so by these lanes; the table is at ObjectOptions.
/// @realtime set-up only
/// @errors   the contradiction, in words
[[nodiscard]] expected<void, SetupError> check_policy(std::string_view path,
                                                      const ObjectOptions& options,
                                                      std::span<const LaneConfig> lanes,
                                                      bool borrows);

}  // namespace rtpm::rpc
