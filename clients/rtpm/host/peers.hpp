#pragma once

#include <vector>

#include "cli/context.hpp"
#include "rtpm/rt/finding.hpp"

namespace rtpm::tool {

/// Whether the registry answers, and whether the servers it names have schemas and compilers in
/// common: a finding each for what differs.
[[nodiscard]] std::vector<rt::Finding> survey_peers(Context& context);

}  // namespace rtpm::tool
