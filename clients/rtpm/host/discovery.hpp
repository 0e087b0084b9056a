#pragma once

#include <vector>

#include "cli/context.hpp"
#include "rtpm/rt/finding.hpp"

namespace rtpm::tool {

/// Surveys discovery: the folder of this host's programs and, if --discover includes it, the LAN
/// and whether its interface passes multicast. Takes at most a second.
[[nodiscard]] std::vector<rt::Finding> survey_discovery(Context& context);

}  // namespace rtpm::tool
