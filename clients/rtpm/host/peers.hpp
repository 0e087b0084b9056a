#pragma once

#include <vector>

#include "cli/context.hpp"
#include "rtpm/rt/finding.hpp"

namespace rtpm::tool {

/// Checks whether the registry answers, and whether the servers that it names share schemas and
/// compilers: one finding for each difference.
[[nodiscard]] std::vector<rt::Finding> survey_peers(Context& context);

}  // namespace rtpm::tool
