#pragma once

#include <vector>

#include "cli/context.hpp"
#include "rtpm/rt/finding.hpp"

namespace rtpm::tool {

/// Whether the default multicast group and the default ports of RTPM can be used on this host.
/// Sends a datagram to the group that does not leave this host. Takes at most some seconds.
[[nodiscard]] std::vector<rt::Finding> survey_network(Context& context);

}  // namespace rtpm::tool
