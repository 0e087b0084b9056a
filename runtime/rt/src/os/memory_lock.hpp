#pragma once

#include "rtpm/base/setup_error.hpp"

namespace rtpm::rt::os {

/// Locks all current and future memory of the process once it is touched, and keeps freed heap
/// mapped.
/// @realtime set-up only
/// @errors   the limit is too small; the system has no such right
[[nodiscard]] expected<void, SetupError> lock_all_memory();

}  // namespace rtpm::rt::os
