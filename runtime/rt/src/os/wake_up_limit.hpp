#pragma once

#include <cstdint>

#include "rtpm/base/setup_error.hpp"

namespace rtpm::rt::os {

/// Limits how long this host's CPUs may take to wake, until end_wake_up_limit() of the result, which
/// is not negative.
/// @realtime set-up only
/// @errors   the process lacks a right; the system has no such limit
[[nodiscard]] expected<int, SetupError> limit_wake_up(std::int32_t us);
/// @realtime set-up only
void end_wake_up_limit(int limit) noexcept;

}  // namespace rtpm::rt::os
