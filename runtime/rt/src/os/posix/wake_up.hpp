#pragma once

#include "rtpm/base/time.hpp"

namespace rtpm::rt::os {

/// A sleep that ends later than this was delayed by a stall, not by the usual wake-up.
inline constexpr Duration kWakeUpMax = std::chrono::microseconds{250};

}  // namespace rtpm::rt::os
