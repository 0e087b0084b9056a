#pragma once

#include <vector>

#include "cli/context.hpp"
#include "rtpm/rt/finding.hpp"

namespace rtpm::tool {

/// What discovery finds: the folder of this host's programs, and, where --discover says so, the LAN
/// and whether its interface passes multicast. Takes at most a second.
[[nodiscard]] std::vector<rt::Finding> survey_discovery(Context& context);

}  // namespace rtpm::tool
