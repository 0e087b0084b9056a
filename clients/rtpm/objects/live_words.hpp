#pragma once

#include <string>
#include <vector>

#include "cli/context.hpp"

namespace rtpm::tool {

/// The words of the running system that may follow a command: names of objects without a `target`,
/// else the target's methods (`call`), parameters (`config get|set|reset`) or calibrations (`config
/// calibrate`). Words with characters that a shell would interpret are left out.
/// @param command  "call", "config set"
/// @errors   no registry, no object, or no answer
[[nodiscard]] expected<std::vector<std::string>, SetupError> live_words(Context& context,
                                                                        const std::string& command,
                                                                        const std::string& target);

}  // namespace rtpm::tool
