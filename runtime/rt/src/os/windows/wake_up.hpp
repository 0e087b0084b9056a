#pragma once

#include "rtpm/base/time.hpp"

namespace rtpm::rt::os {

/// A sleep that ends later than this was delayed by a stall, not by the usual wake-up: the timers
/// have steps of about half a millisecond.
inline constexpr Duration kWakeUpMax = std::chrono::milliseconds{1};

}  // namespace rtpm::rt::os
