#pragma once

#include <vector>

#include "cli/context.hpp"
#include "rtpm/rt/finding.hpp"

namespace rtpm::tool {

/// Checks whether RTPM's default multicast group and ports can be used on this host. Sends a
/// datagram to the group that stays on this host. Takes at most a few seconds.
[[nodiscard]] std::vector<rt::Finding> survey_network(Context& context);

}  // namespace rtpm::tool
