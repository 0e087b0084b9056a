#pragma once

#include <cstddef>

namespace rtpm::rt::os {

/// Hides whole pages from core dumps, and makes them zeros in forked children, as far as the system
/// can; false if it refuses.
/// @realtime set-up only
[[nodiscard]] bool hide(void* begin, std::size_t size) noexcept;

}  // namespace rtpm::rt::os
