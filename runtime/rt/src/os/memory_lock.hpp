#pragma once

#include <optional>
#include <string>

namespace rtpm::rt::os {

struct LockRefusal {
  std::string what;  ///< The refusal with its cause.
  std::string remedy;
};

/// Locks all current and future memory of the process once it is touched, and keeps freed heap
/// mapped; nullopt if that is granted.
/// @realtime set-up only
[[nodiscard]] std::optional<LockRefusal> lock_all_memory();

}  // namespace rtpm::rt::os
