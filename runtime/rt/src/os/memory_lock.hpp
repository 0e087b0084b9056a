#pragma once

#include <string>

#include "rtpm/base/setup_error.hpp"

namespace rtpm::rt::os {

/// Locks all current and future memory of the process once it is touched, and keeps freed heap
/// mapped. Returns how far, as a clause, if the system locks less; otherwise an empty text.
/// @realtime set-up only
/// @errors   the limit is too small; the system has no such right
[[nodiscard]] expected<std::string, SetupError> lock_all_memory();

}  // namespace rtpm::rt::os
