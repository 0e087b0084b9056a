#pragma once

#include <vector>

#include "cli/context.hpp"
#include "rtpm/rt/finding.hpp"

namespace rtpm::tool {

/// Finds faults in this user's key, known servers and grants.
[[nodiscard]] std::vector<rt::Finding> survey_keys(const Context& context);

/// Finds servers on this host that accept every caller from other hosts.
[[nodiscard]] std::vector<rt::Finding> survey_open_servers();

}  // namespace rtpm::tool
