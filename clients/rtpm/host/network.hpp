#pragma once

#include <vector>

#include "cli/context.hpp"
#include "rtpm/rt/finding.hpp"

namespace rtpm::tool {

/// Whether the default group of multicast and the default ports of RTPM can be used on this host. A
/// datagram to the group goes out, but not beyond this host. Takes at most some seconds.
[[nodiscard]] std::vector<rt::Finding> survey_network(Context& context);

}  // namespace rtpm::tool
