#pragma once

#include <vector>

#include "cli/context.hpp"
#include "rtpm/rt/finding.hpp"

namespace rtpm::tool {

/// What is wrong with this user's key, known servers and grants.
[[nodiscard]] std::vector<rt::Finding> survey_keys(const Context& context);

/// Servers of this host that serve every caller of other hosts.
[[nodiscard]] std::vector<rt::Finding> survey_open_servers();

}  // namespace rtpm::tool
