#pragma once

#include <cstdint>

#include "rtpm/base/time.hpp"
#include "rtpm/driver/command.hpp"

namespace rtpm::gvd {

/// A client's command.
struct ClientCommand {
  std::uint64_t lease = 0;
  std::uint32_t sequence = 0;
  Duration hold{0};  ///< Limited to SafetyConfig::hold_max.
  driver::Setpoint setpoint{};
};

}  // namespace rtpm::gvd
